"""The certificate of a sampled loop on a terminal and as a page: short, rounded outward, never more than is proven."""

import re
import xml.etree.ElementTree as ET
from dataclasses import asdict, replace
from fractions import Fraction

import pages
import pytest
import sampled
from hypothesis import given
from hypothesis import strategies as st

from tubecert.report import html, markdown, notebook
from tubecert.report import pages as explained
from tubecert.report.claimed import ends
from tubecert.report.sampled_loop import page_of
from tubecert.report.terminal import Terminal
from tubecert.report.text import screen
from tubecert.sampled_loop.record import (
    Claim,
    Cleared,
    InputUse,
    Lack,
    Notes,
    Shares,
    Stage,
    certificate_text,
    read,
)
from tubecert.verdict import Verdict
from tubecert.words.sampled_loop import NOTHING, SHARES, filling, percents, remedy, why

TEXTS = {"cart": sampled.SPEC, "family": sampled.FAMILY, "drone": sampled.DRONE}
KEYS = "box", "hold", "slow wind", "h and slow wind", "hardware.rate", "hardware.delay", "hardware.noise"
LONG = re.sub(r"\bp\b", "position", sampled.SPEC)
OF_CART = sampled.certificate().result
CLOSING = [("certificate", "cart.certificate.json"), ("next", "a"), ("", "b"), ("", "c")]
LACKS = {
    "inputs": Lack(kind="inputs", where="F", needed=1.58, allowed=1.0),
    "mode": Lack(kind="no_design", where="p", needed=0.3),
    "nothing found": Lack(kind="no_design"),
    "no tube": Lack(kind="no_fixed_point", where="v"),
    "safe set": Lack(kind="safe_set", where="v", needed=0.5),
    "wish": Lack(kind="wish", where="p", needed=0.2, allowed=0.15),
    "obstacle": Lack(kind="obstacle", where="1"),
    "safe set, by how much is not known": Lack(kind="safe_set", where="v"),
    "undefined": Lack(kind="undefined", where="p"),
    "start": Lack(kind="start", where="p", needed=0.2, allowed=0.1),
    "not proven": Lack(kind="not_proven"),
}


def shown(certificate, *, verbose=False):
    terminal = Terminal(stream=None, colored=False, width=80, interactive=False)
    return terminal.text(screen(page_of(certificate), CLOSING, verbose=verbose))


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_the_first_screen_is_a_screen(text):
    lines = shown(sampled.certificate(text)).splitlines()
    assert len(lines) <= 15
    assert all(len(line) <= 80 for line in lines)
    assert lines[0].startswith("certified ")
    assert [line.split() for line in lines[-4:]] == [
        ["certificate", "cart.certificate.json"], ["next", "a"], ["b"], ["c"],
    ]  # fmt: skip


@pytest.mark.parametrize("lack", LACKS.values(), ids=LACKS)
def test_what_is_lacking_is_told_with_what_helps_and_never_as_proven(lack):
    text = shown(sampled.undecided(lack))
    assert text.startswith("undecided cart: ")
    assert len(text.splitlines()) <= 18
    assert why(lack, OF_CART.spec.effective) in " ".join(text.split())
    assert "None" not in text + shown(sampled.undecided(lack), verbose=True)
    assert not [words for words in ("- of -", "\n  tube  ", "tube keeps away", "of the way") if words in text]
    assert "\n  help  " in text
    assert "not proven" in text


@pytest.mark.parametrize(("name", "verbose", "told"), [
    ("cart", False, "500 Hz, delay 0.0005 s, noise p 0.001 m, v 0.002 m/s"),
    ("cart", False, "at p = 0.1 m, all else 0"),
    ("cart", False, "p (m)       0.1321    0.034       0.15"),  # rounded up
    ("cart", False, "-3.1 to 3.1 N of -8 to 8: 38.8 % of the way to a limit"),
    ("cart", False, "wind 59 %, noise 32 %, delay and holding 6 %, remainder 3 %"),
    ("cart", False, "the plan for all t >= 0"),
    ("family", False, "every plan of the family"),
    ("family", False, "p* in [-0.2, 0.2], v* in [0, 0], F* in [-1, 1]; |F*'| <= 2"),
    ("long", False, "\n  tube           from 0 s"),  # all values begin in one column
    ("long", False, "\n  position (m)   0.1321"),
    ("long", False, "\n  fills position wind 59 %"),
    ("long", False, "\n  certificate    cart.certificate"),
    ("open", False, "not proven to keep away from number 1"),
    ("cart", True, "Half-widths, and what fills them"),
    ("cart", True, "F (N)       3.1       1.2"),
    ("cart", True, "start 61 %, noise 23 %, wind 13 %,"),
    ("cart", True, "- the controller computes in double precision"),
    ("cart", True, "before the first command acts, the actuators hold"),
])  # fmt: skip
def test_the_screen_says_what_is_proven(name, verbose, told):
    certificate = sampled.certificate({**TEXTS, "long": LONG}.get(name, sampled.SPEC))
    if name == "open":
        certificate = sampled.certificate(clearance=(Cleared(index=0, verdict=Verdict.UNDECIDED),))
    assert told in shown(certificate, verbose=verbose)


@pytest.mark.parametrize("name", ["cart", "family"])
def test_explain_knows_every_label(name):
    lines = shown(sampled.certificate(TEXTS[name])).splitlines()[1:-4]
    labels = {match[1] for line in lines if (match := re.match(r"  ([a-z]+)(?: [a-z])?  ", line))}
    assert {"loop", "start", "tube", "obstacles"} <= labels
    causes = {cause.rsplit(" ", 2)[0] for cause in filling(sampled.WIDE, SHARES).split(", ")}
    assert not [word for word in {*labels, *causes, "wish", "room", *KEYS} if explained.find(word) is None]


def test_where_parameters_are_not_known_that_is_a_remedy():
    assert "parameters that are known better" in remedy(LACKS["no tube"], OF_CART, Notes())


@given(st.builds(Shares, **dict.fromkeys(asdict(sampled.WIDE), st.floats(0, 1e6))))
def test_shares_add_up(shares):
    found = percents(shares, SHARES)
    assert sum(found.values()) == (100 if sum(asdict(shares).values()) >= NOTHING else 0)
    assert all(part > 0 for part in found.values())
    assert filling(shares, SHARES).count("%") == len(found)


@given(st.fractions(-8, 8), st.fractions(-8, 8))
def test_how_much_of_the_room_is_used(one, other):
    use = InputUse(input="u", range=(min(one, other), max(one, other)), limits=(Fraction(-8), Fraction(4)))
    assert (use.share <= 1) is (use.range[1] <= 4)
    assert InputUse(input="u", range=use.range).share is None


def test_the_remedy_names_what_asks_most():
    assert "start" in remedy(LACKS["inputs"], OF_CART, Notes(deviations={"F": sampled.PUSH}))
    assert "wind" in remedy(LACKS["wish"], OF_CART, Notes(long_run={"p": sampled.NARROW}))
    assert "noise, wind, h, delay or the start" in remedy(LACKS["inputs"], OF_CART, Notes())
    assert "mode of p" in remedy(LACKS["mode"], OF_CART, Notes())
    assert "mode" not in remedy(LACKS["nothing found"], OF_CART, Notes())


def test_without_a_controller_one_is_advised():
    own = sampled.SPEC + "controller: none\n"
    grows, widens = "a mode of p does not die away: it grows by 0.3", "no tube closes: that of v widens"
    for name, told in (("mode", grows), ("no tube", widens)):
        text = shown(sampled.certificate(own, verdict=Verdict.UNDECIDED, lacks=(LACKS[name],)))
        assert f"without a controller {told}" in " ".join(text.split())
        assert "help        controller: auto" in text
    text = shown(sampled.certificate(own, verdict=Verdict.UNDECIDED, lacks=(LACKS["safe set"],)))
    assert "a larger safe_set" in text


def test_what_helps_against_two_lacks_is_told_once():
    lacks = tuple(Lack(kind="plan", where=name, needed=9.0, allowed=8.0) for name in ("left", "right"))
    text = shown(sampled.certificate(sampled.DRONE, verdict=Verdict.UNDECIDED, lacks=lacks))
    assert text.count("wider limits") == 1


def test_where_nothing_acts_it_is_said_in_one_way():
    least = Fraction("1e-30")
    stage = Stage(start=0, half_widths={"p": Fraction("0.1"), "v": least}, deviations={"F": least}, memory=())
    use = InputUse(input="F", range=(-least, Fraction("0.5") + least))
    notes = {"start": {"v": replace(sampled.NARROW, **dict.fromkeys(asdict(sampled.NARROW), 1e-30))}}
    own = sampled.certificate(tube=(stage,), inputs=(use,))
    text = shown(replace(own, notes=replace(own.notes, long_run={}, deviations={}, **notes)), verbose=True)
    assert "e-30" not in text
    assert "v (m/s)     < 1e-12\n" in text
    assert "F           0 to 0.5, within 1e-12 N\n" in text


def test_ends_are_rounded_outward_and_not_beyond_the_limits():
    """99.99 to 100.1 was said of an input that keeps to 100.01, and moves by less than a tenth of that."""
    assert ends(Fraction("99.9912"), Fraction("100.0062")) == "99.9912 to 100.007"
    assert ends(Fraction("-5.0001"), Fraction("2.00011")) == "-5.001 to 2.001"
    limits = Fraction(-6), Fraction("2.0005")
    assert ends(Fraction("-5.0001"), Fraction("2.00011"), limits) == "-5.0001 to 2.0002"


def test_degrees_are_shown_as_degrees():
    own = sampled.SPEC.replace("{at: [0.1, 0]}", "{box: {p: [-5 deg, 5 deg]}}")
    own = own.replace("p: m, v: m/s", "p: rad, v: rad/s")
    own = own.replace("{p: 0.001, v: 0.002}", "{p: 0.1 deg, v: 2 deg}").replace("{p: 0.15}", "{p: 10 deg}")
    text = shown(sampled.certificate(own))
    assert "noise p 0.1 deg, v 2 deg/s" in text
    assert "anywhere with p in [-5 deg, 5 deg], all else 0" in text
    assert "p (rad)     0.1321    0.034       0.174533" in text


@pytest.mark.parametrize(("missed", "told"), [
    ("input: [2]", "it is no equilibrium: input: [2] is"),
    ("", "it misses its equations, or does not end at rest: tubecert check"),
])  # fmt: skip
def test_a_plan_that_misses_its_own_equations_is_told_on_the_first_screen(missed, told):
    certificate = sampled.certificate()
    assert "plan  " not in shown(certificate)
    text = shown(replace(certificate, notes=replace(certificate.notes, missed=missed)))
    assert f"  plan        {told}" in text
    assert len(text.splitlines()) <= 15


def test_wind_of_a_bounded_rate_is_told_as_that():
    """It is compensated as h is: its share was told to be that of h, and nothing said that its rate is assumed."""
    slow = replace(sampled.NARROW, uncertainty=0.02, wind=0.0)
    filled = {"long_run": {"p": slow, "v": slow}}
    told = ("", "h", "wind is"), (", rate: 0.1", "slow wind", "wind and its rate are")
    for rate, cause, within in told:
        own = sampled.certificate(sampled.SPEC.replace("bound: 0.05", f"bound: 0.05{rate}"))
        text = shown(replace(own, notes=replace(own.notes, **filled)), verbose=True)
        assert f"fills p     {cause} 59 %," in text
        assert f"the {within} within" in " ".join(text.split())
    assert "slow wind" in remedy(LACKS["wish"], own.result, Notes(**filled))


@pytest.mark.parametrize(
    ("h", "cause"),
    [
        ("", "parameters"),
        ("uncertainty: {h: ['0']}\n", "parameters"),
        ("uncertainty: {h: [v]}\n", "h and parameters"),
    ],
)
def test_what_parameters_ask_is_told_as_theirs(h, cause):
    """It is compensated as h is: its share was told to be that of h, where h is 0."""
    text = sampled.SPEC.replace("f: [v,", "parameters: {m: [1, 2]}, f: [v,").replace('"-v"', '"-m*v"') + h
    own = sampled.certificate(text)
    slow = replace(sampled.NARROW, uncertainty=0.02, wind=0.0)
    own = replace(own, notes=replace(own.notes, long_run={"p": slow, "v": slow}))
    assert f"fills p     {cause} 59 %," in shown(own)
    assert explained.find(cause) is not None
    assert any(cause in str(chart) for chart in figures_of(page_of(own)).values())


def test_a_wish_for_an_output_is_on_the_first_screen_with_what_was_found():
    text = sampled.SPEC.replace("f: [v,", "outputs: {tip: p - v/2}, f: [v,")
    text = text.replace("{p: 0.15}", "{tip: 0.2}")
    for verbose in (False, True):  # then in the table of what fills them as well
        lines = [own.split() for own in shown(sampled.certificate(text), verbose=verbose).splitlines()]
        found = [own[:4] for own in lines if own[:1] == ["tip"]]
        assert found == [["tip", "0.1981", "0.051", "0.2"]] * (1 + verbose)


def figures_of(page):
    (section,) = (section for section in page.sections if section.key == "figures")
    return {figure.key: figure for figure in section.blocks[0].figures}


def test_the_page_is_one_page_with_figures_and_the_same_words():
    page = page_of(sampled.certificate())
    assert pages.Page(html.render_page(page)).tags.count("h1") == 1
    drawn, text = figures_of(page), markdown.render_page(page)
    assert set(drawn) == {"state-0", "state-1", "input-0", "plane-0-1", "shares"}
    assert all(ET.fromstring(figure.svg).tag == "svg" for figure in drawn.values())
    causes = {words for _, words in drawn["shares"].legend}
    assert causes == {"noise", "delay and holding", "wind", "start", "remainder"}
    assert "| p (m) | 0.1321 | 0.034 | 0.15 |" in text
    assert page.summary.replace(">=", "≥") in text


def test_the_page_has_the_equations_of_the_loop_and_how_to_check_it():
    text = markdown.render_page(page_of(sampled.certificate()))
    for told in (
        "- wind: bound = 0.05",
        "- limits: F = ",
        "v' = -v + (F + h) + w",
        "u = u* + M z_k + N (y_k - x*(t_k)),   held for a sample time from t_k + delay on",
        "recheck CERT.json --spec SPEC.yaml",
        "recheck CERT.json --controller FOLDER",
    ):
        assert told in text
    renamed = sampled.SPEC.replace("v", "w")
    assert "w' = -w + (F + h) + wind" in markdown.render_page(page_of(sampled.certificate(renamed)))
    alone = markdown.render_page(page_of(sampled.certificate(sampled.SPEC + "controller: none\n")))
    assert "--spec" in alone
    assert not [told for told in ("--controller", "z_k") if told in alone]


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_the_page_is_the_same_before_and_after_the_certificate_is_written(text):
    """States are told in their own order, not in that of the alphabet, which a file has."""
    box = "initial_state: {box: {p: [-0.1, 0.1], v: [-0.2, 0.1]}}"
    renamed = re.sub(r"\bp\b", "z", text.replace("initial_state: {at: [0.1, 0]}", box))
    made = sampled.certificate(renamed)
    assert page_of(read(certificate_text(made), "it")) == page_of(made)


def test_how_far_from_its_plan_is_drawn_where_the_plan_moves():
    texts = sampled.SPEC, sampled.FAMILY
    still, family = (figures_of(page_of(sampled.certificate(text))) for text in texts)
    assert {"deviation-0", "deviation-1", "shares"} == set(family)
    assert not [key for key in still if key.startswith("deviation")]
    assert [words for _, words in family["deviation-0"].legend] == ["wish", "proven in the loop", "plan"]
    svg = ET.fromstring(family["deviation-1"].svg)
    (band,) = (each.get("d") for each in svg.iter() if each.get("class") == "tube")
    assert len(set(re.findall(r"[ML][\d.]+[ ,]([\d.]+)", band))) == 4  # both sides, of both stages


def test_a_band_is_drawn_as_proven_where_it_is():
    for certificate, other in (sampled.certificate(), "unproven"), (sampled.undecided(LACKS["wish"]), "tube"):
        drawn = figures_of(page_of(certificate)).values()
        assert other not in {style for each in drawn for style, _ in each.legend}


@pytest.mark.parametrize(("changes", "told"), [
    ({"horizon": Fraction(5)}, "for 0 <= t <= 5 s"),
    ({"afterwards": "rest"}, "for all t >= 0, at rest at the end of the plan after 5 s"),
    ({"afterwards": "repeat"}, "for all t >= 0, which is repeated every 5 s"),
])  # fmt: skip
def test_for_how_long(changes, told):
    claim = Claim(**{"horizon": None, "afterwards": "nothing", "hold": "middle", **changes})
    text = sampled.SPEC.replace("input: [0]}", "input: [0], horizon: 5}")
    assert page_of(sampled.certificate(text, claim=claim)).summary.endswith(told)


def test_a_page_without_figures_has_no_empty_section_and_a_card_promises_nothing_below_it():
    certificate = sampled.certificate()
    text = markdown.render_page(page_of(certificate))
    assert not re.search(r"^## .*\n+(?=## |\Z)", text, re.MULTILINE)
    assert "below" not in notebook.of_page(page_of(certificate)).split("<table>")[0]
