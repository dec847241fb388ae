"""`explain` knows every word of a report's first screen."""

import re

import proven
import pytest
from typer.testing import CliRunner

from tubecert.certificate.result import Certificate
from tubecert.cli.app import app
from tubecert.kinds import NAMES
from tubecert.report import console, pages
from tubecert.report.terminal import Terminal
from tubecert.verdict import Verdict
from tubecert.words.conditions import ROLES, SECTIONS

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
hardware: {rate: 500, delay: 0.001, noise: {z: 0.0001, v: 0.0001}}
limits: {F: [-5, 5]}
obstacles: [{states: [z, v], disc: {center: [0.9, 1.8], radius: 0.1}}]
conditions: {decides: H}
"""


@pytest.fixture(scope="module")
def screen():
    sealed = Certificate.from_json(proven.proven(PLANT) | {"run": {}})
    terminal = Terminal(stream=None, colored=False, width=100, interactive=False)
    return terminal.text(console.report(sealed, target="cart.json", verbose=False))


def labels(shown):
    """Titles of parts, heads of columns, what stands before a colon, and symbols that have a value."""
    found = [line for line in shown.splitlines() if re.fullmatch(r"[A-Z][a-z, ]+", line)]
    found += re.split(r"\s{2,}", shown.split("Gains\n")[1].splitlines()[0].strip())
    found += re.findall(r"^  ([a-z-]+(?: [a-z-]+){0,3}):", shown, re.MULTILINE)
    found += [
        name for name in re.findall(r"\b([A-Za-z_]+) (?:=|<) [-\d.]", shown) if name not in ("for", "t")
    ]
    return list(dict.fromkeys(word.strip() for word in found))


def test_every_label_of_the_first_screen_has_a_page(screen):
    found = labels(screen)
    assert {
        "Gains",
        "margin left",
        "omega",
        "Ts",
        "Machine",
        "what fills the tube",
        "proven tube",
        "filter",
    } <= set(found)
    assert [word for word in found if pages.find(word) is None] == []


def test_every_certificate_verdict_and_choice_of_gains_has_a_page():
    words = [*SECTIONS.values(), *(name.letter for name in NAMES), *Verdict, *ROLES.values()]
    assert [word for word in words if not isinstance(pages.find(word), pages.WordPage)] == []


def test_no_spelling_belongs_to_two_words():
    spelled = [also for page in pages.words().values() for also in page.also]
    assert len(spelled) == len(set(spelled))
    assert not set(spelled) & set(pages.words())


@pytest.mark.parametrize("word", sorted(pages.words()))
def test_every_word_has_meaning_and_source(word):
    text = pages.words()[word].text()
    assert text.startswith(f"{word}: ")
    assert "\n\nSource: docs/" in text
    assert max(map(len, text.splitlines())) <= 100
    assert (proven.CONFIGS.parent / pages.words()[word].see.split(",")[0]).exists()


def test_numbers_say_their_unit():
    for word in (
        "rho",
        "rho_a",
        "epsilon",
        "half-width",
        "level",
        "omega",
        "Gamma",
        "Ts",
        "rate",
        "h",
        "noise",
    ):
        assert "\n\nUnit: " in pages.words()[word].text()


@pytest.mark.parametrize(
    ("asked", "word"),
    [
        ("Rho", "rho"),
        ("GAMMA", "Gamma"),
        ("half-widths", "half-width"),
        ("margin  left", "margin"),
        ("ω", "omega"),
    ],
)
def test_spellings(asked, word):
    result = CliRunner().invoke(app, ["explain", asked])
    assert (result.exit_code, result.stdout.split(":")[0]) == (0, word)
