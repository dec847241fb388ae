"""The certificate of a sampled loop on a terminal and as a page: short, rounded outward, never more than is proven."""

import re
import xml.etree.ElementTree as ET
from dataclasses import asdict
from fractions import Fraction

import pages
import pytest
import sampled
from hypothesis import given
from hypothesis import strategies as st

from tubecert.report import html, markdown
from tubecert.report import pages as explained
from tubecert.report.sampled_loop import page_of
from tubecert.report.terminal import Terminal
from tubecert.report.text import screen
from tubecert.sampled_loop.record import Claim, Cleared, InputUse, Lack, Notes, Shares
from tubecert.verdict import Verdict
from tubecert.words.sampled_loop import filling, percents, remedy, why

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


@pytest.mark.parametrize(
    "text", [sampled.SPEC, sampled.FAMILY, sampled.DRONE], ids=["cart", "family", "drone"]
)
def test_the_first_screen_is_a_screen(text):
    lines = shown(sampled.certificate(text)).splitlines()
    assert len(lines) <= 16
    assert all(len(line) <= 80 for line in lines)
    assert lines[0].startswith("certified ")
    assert lines[-4:] == [
        "  certificate cart.certificate.json",
        "  next        a",
        "              b",
        "              c",
    ]


@pytest.mark.parametrize("lack", LACKS.values(), ids=LACKS)
def test_what_is_lacking_is_told_with_what_helps_and_never_as_proven(lack):
    text = shown(sampled.undecided(lack))
    assert text.startswith("undecided cart: ")
    assert len(text.splitlines()) <= 18
    assert why(lack, {"F": "N", "p": "m", "v": "m/s"}) in " ".join(text.split())
    assert "None" not in text + shown(sampled.undecided(lack), verbose=True)
    assert "- of -" not in text
    assert "\n  help  " in text
    assert "\n  tube  " not in text
    assert "not proven" in text
    assert not page_of(sampled.undecided(lack)).tiles


def test_the_screen_says_what_is_proven():
    text = shown(sampled.certificate())
    for told in (
        "500 Hz, delay 0.0005 s, noise p 0.001 m, v 0.002 m/s",
        "at p = 0.1 m, all else 0",
        "p (m)       0.1321    0.034       0.15",  # rounded up
        "-3.1 to 3.1 N of -8 to 8: 38.8 % of the room",
        "wind 59 %, noise 32 %, delay and holding 6 %, remainder 3 %",
    ):
        assert told in text
    assert "the plan for all t >= 0" in text
    assert "every plan of the family" in shown(sampled.certificate(sampled.FAMILY))
    assert "p* in [-0.2, 0.2], v* in [0, 0], F* in [-1, 1]; |F*'| <= 2" in shown(
        sampled.certificate(sampled.FAMILY)
    )


@pytest.mark.parametrize("text", [sampled.SPEC, sampled.FAMILY], ids=["cart", "family"])
def test_explain_knows_every_label(text):
    lines = shown(sampled.certificate(text)).splitlines()[1:-4]
    labels = {match[1] for line in lines if (match := re.match(r"  ([a-z]+)(?: [a-z])?  ", line))}
    assert {"loop", "start", "tube", "fills", "obstacles"} <= labels
    causes = {cause.rsplit(" ", 2)[0] for cause in filling(sampled.WIDE).split(", ")}
    assert not [word for word in {*labels, *causes, "wish", "room"} if explained.find(word) is None]


def test_an_obstacle_that_is_not_cleared_is_not_told_as_one_that_is():
    open_ = sampled.certificate(clearance=(Cleared(index=0, verdict=Verdict.UNDECIDED),))
    assert "not proven to keep away from number 1" in shown(open_)


def test_every_share_of_every_line_is_told_if_asked():
    text = shown(sampled.certificate(), verbose=True)
    assert "Half-widths, and what fills them" in text
    assert "F (N)       3.1       1.2" in text
    assert "start 61 %, noise 23 %, wind 13 %," in text
    assert "- the controller computes in double precision" in text


@given(st.builds(Shares, **dict.fromkeys(asdict(sampled.WIDE), st.floats(0, 1e6))))
def test_shares_add_up(shares):
    found = percents(shares)
    assert sum(found.values()) == (100 if sum(asdict(shares).values()) > 0 else 0)
    assert all(part > 0 for part in found.values())
    assert filling(shares).count("%") == len(found)


@given(st.fractions(-8, 8), st.fractions(-8, 8))
def test_how_much_of_the_room_is_used(one, other):
    use = InputUse(input="u", range=(min(one, other), max(one, other)), limits=(Fraction(-8), Fraction(4)))
    assert (use.share <= 1) is (use.range[1] <= 4)
    assert InputUse(input="u", range=use.range).share is None


def test_the_remedy_names_what_asks_most():
    assert "start" in remedy(LACKS["inputs"], Notes(deviations={"F": sampled.PUSH}))
    assert "wind" in remedy(LACKS["wish"], Notes(long_run={"p": sampled.NARROW}))
    assert "noise, wind, h or delay" in remedy(LACKS["inputs"], Notes())


def test_the_page_is_one_page_with_figures_and_the_same_words():
    page = page_of(sampled.certificate())
    found = pages.Page(html.render_page(page))
    assert found.tags.count("h1") == 1
    (figures,) = (section for section in page.sections if section.key == "figures")
    drawn = {figure.key: figure for figure in figures.blocks[0].figures}
    assert set(drawn) == {"state-0", "state-1", "input-0", "plane-0-1", "shares"}
    for figure in drawn.values():
        assert ET.fromstring(figure.svg).tag == "svg"
    assert {words for _, words in drawn["shares"].legend} == {
        "noise", "delay and holding", "wind", "start", "remainder",
    }  # fmt: skip
    text = markdown.render_page(page)
    assert "| p (m) | 0.1321 | 0.034 | 0.15 |" in text
    assert page.summary.replace(">=", "≥") in text


def test_a_band_that_is_not_proven_is_drawn_as_such():
    styles = {}
    for certificate in (sampled.certificate(), sampled.undecided(LACKS["wish"])):
        figures = next(section for section in page_of(certificate).sections if section.key == "figures")
        styles[certificate.result.verdict] = {
            style for each in figures.blocks[0].figures for style, _ in each.legend
        }
    assert "unproven" not in styles["certified"]
    assert "tube" not in styles["undecided"]
    text = shown(sampled.undecided(LACKS["wish"]))
    assert "keeps away" not in text
    assert "of the room" not in text


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"horizon": Fraction(5)}, "for 0 <= t <= 5 s"),
        ({"afterwards": "rest"}, "for all t >= 0, at rest at the end of the plan after 5 s"),
        ({"afterwards": "repeat"}, "for all t >= 0, which is repeated every 5 s"),
    ],
)
def test_for_how_long(changes, told):
    claim = Claim(**{"horizon": None, "afterwards": "nothing", "hold": "middle", **changes})
    text = sampled.SPEC.replace("input: [0]}", "input: [0], horizon: 5}")
    assert page_of(sampled.certificate(text, claim=claim)).summary.endswith(told)
