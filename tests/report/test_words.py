"""`explain` knows every label of a report's first screen."""

import re
from fractions import Fraction

import proven
import pytest
from systems import SMALL

from tubecert.certificate.result import Certificate
from tubecert.claims.conditions import SECTIONS
from tubecert.digits import end
from tubecert.kinds import NAMES
from tubecert.report import pages, text
from tubecert.report.certificate_page import page_of
from tubecert.report.gains import ROLES
from tubecert.report.terminal import Terminal
from tubecert.verdict import Verdict

PLANT = """
tubecert: 1
name: cart
system: {states: [z, v], inputs: [F], units: {z: m, v: m/s}, f: [v, "-v"], B: [[0], [1]]}
safe_set: {z: [-1, 1], v: [-2, 2]}
uncertainty: {h: ["0.01*sin(t)"]}
disturbance: {E: [[0], [1]], bound: 0.001}
trajectory: {kind: equilibrium, at: [0, 0], input: [0], horizon: 3}
tube: {half_widths: {z: 0.5}}
metric: {dual_metric: [[1, -1], [-1, 2]], rate: 0.4}
limits: {F: [-5, 5]}
obstacles: [{states: [z, v], disc: {center: [0.9, 1.8], radius: 0.1}}]
conditions: {decides: B}
"""


WIND = 'disturbance: {E: [["0.1"], ["1 + 0.1*x"]], bound: 0.01}\n'
FAMILY = "{kind: any, x: {x: [-0.2, 0.2], y: [-0.2, 0.2]}, u: {u: [-0.5, 0.5]}, defect: 0.001}"
ANY = SMALL.replace("{kind: equilibrium, at: [0, 0], input: [0]}", FAMILY)
UNCERTAIN = SMALL.replace("  f: [", "  parameters: {m: [0.97, 1.03]}\n  f: [").replace("[1]]", '["1/m"]]', 1)
MOST_LINES, CLOSING = 15, 4  # of files and commands
SCREENS = {
    "everything": (PLANT, "distance"),
    "0": (SMALL, "none"),
    "A, B": (SMALL, "all"),
    "B with wind": (SMALL + WIND, "distance"),
    "an uncertain gain": (UNCERTAIN, "distance"),
    "half-widths": (SMALL.replace("{epsilon: 0.2, rho_a: 0.1}", "{half_widths: {x: 0.3}}"), "all"),
    "a family": (ANY.replace("{at: [0.05, 0]}", "{within: 0.01}"), "distance"),
    "undecided": (SMALL + WIND, "26"),
    "refuted": (SMALL.replace("rate: 0.8", "rate: 3"), "26"),
}


def first_screen(plant, **options):
    sealed = Certificate.from_json(proven.proven(plant, **options) | {"run": {}})
    terminal = Terminal(stream=None, colored=False, width=80, interactive=False)
    closing = [("next", "a command")] * CLOSING
    return terminal.text(text.screen(page_of(sealed), closing, verbose=False))


def labels(shown):
    """What stands before rows, and symbols that have a value."""
    found = re.findall(r"^  ([a-z_]+(?: [a-z]+)?) {2,}", shown, re.MULTILINE)
    found += re.findall(r"\b([A-Za-z_]+) (?:=|<|<=) [-\d.]", shown)
    closing = ("next", "more", "for", "t", "x", "y", "z", "v", "it")
    return list(dict.fromkeys(name for name in found if name not in closing))


def test_every_word_of_a_comparison_of_metrics_has_a_page():
    from tubecert.certificate.result import MetricRow
    from tubecert.report.synthesis import FLOORS, _compared

    row = MetricRow(
        rate=Fraction(1), floor="input", degree=2, condition_number=3.0, verdict=Verdict.CERTIFIED
    )
    heads = _compared([row], None).columns
    assert "beta/sqrt(a)" in heads
    assert [word for word in [*heads, *FLOORS.values()] if not pages.find(word)] == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", SCREENS)
def test_every_label_of_every_first_screen_has_a_page(kind):
    plant, conditions = SCREENS[kind]
    shown = first_screen(plant, conditions=conditions)
    assert len(shown.splitlines()) <= MOST_LINES
    assert len(labels(shown)) >= 4
    assert [word for word in labels(shown) if pages.find(word) is None] == []


def test_every_certificate_verdict_and_choice_of_gains_has_a_page():
    words = [*SECTIONS.values(), *(name.letter for name in NAMES), *Verdict, *ROLES.values()]
    words += (
        "kappa", "Lyapunov", "contraction", "matched", "geodesic", "witness", "L1", "class", "predictor",
    )  # fmt: skip
    assert [word for word in words if getattr(pages.find(word), "kind", "") != "word"] == []
    assert [word for word in ("26a", "26b", "26c", "C1", "C2", "C3") if not pages.find(word)] == []


def test_no_spelling_belongs_to_two_words():
    spelled = [also for page in pages.words().values() for also in page.also]
    assert len(spelled) == len(set(spelled))
    assert not set(spelled) & set(pages.words())


@pytest.mark.parametrize("word", sorted(pages.words()))
def test_every_word_has_meaning_and_source(word):
    told = pages.words()[word].text()
    assert told.startswith(f"{word}: ")
    assert "\n\nSource: docs/" in told
    assert max(map(len, told.splitlines())) <= 100
    assert (proven.CONFIGS.parent / pages.words()[word].see.split(",")[0]).exists()


def test_numbers_say_their_unit():
    for word in ("rho", "rho_a", "epsilon", "half-width", "omega", "Gamma", "rate", "h", "noise"):
        assert "\n\nUnit: " in pages.words()[word].text()


def test_a_fraction_of_large_numbers_is_shown_as_a_decimal():
    assert [end(Fraction(q)) for q in ("-10519/12545", "1/3", "0.15")] == ["-0.838501395", "1/3", "0.15"]
