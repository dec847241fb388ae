"""What users write by mistake, and what they are told: the table is `mistakes.MISTAKES`."""

import json
import re
from fractions import Fraction
from importlib import resources

import pytest
from mistakes import GOOD, MISTAKES, ON_A_MACHINE

from tubecert.errors import TubecertError
from tubecert.expression import Lookup, elsewhere
from tubecert.findings import Finding
from tubecert.pipeline import inspect
from tubecert.spec import load_text

JARGON = re.compile(r"value error|pydantic|NoneType|Traceback|instance of|expected type", re.IGNORECASE)


def found(text: str) -> list[Finding]:
    try:
        spec = load_text(text, "spec.yaml")
    except TubecertError as error:
        return list(error.findings)
    return inspect(spec)


@pytest.mark.parametrize("text", [GOOD, ON_A_MACHINE], ids=["in continuous time", "on a machine"])
def test_without_a_mistake_nothing_is_said(text: str) -> None:
    assert found(text) == []


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake[1].strip()[:40] or "left out")
def test_a_mistake_is_located_and_what_to_write_is_said(mistake: tuple[str, str, str, int, int, str]) -> None:
    old, new, code, line, column, words = mistake
    good = GOOD if old in GOOD else ON_A_MACHINE
    assert old in good
    findings = found(good.replace(old, new, 1))
    said = [f"{item.code} {item.location} {item.message} / {item.help}" for item in findings]
    own = [item for item in findings if item.location and words in f"{item.message} / {item.help}"]
    places = [(item.code, item.location.line, item.location.column) for item in own]
    assert (code, line, column) in places, "\n".join(said)
    assert not any(JARGON.search(text) for text in said)


@pytest.mark.parametrize("power", [2, 3])
def test_the_table_that_is_told_for_drag_is_it_exactly(power: int) -> None:
    text = GOOD.replace("c/m*v", "c/m*abs(v)*v", 1)
    help = next(item.help for item in found(text))
    if power == 2:  # as it stands, where it says
        pasted = re.sub(r".*with (tables: .*?\}\}) in system.*", r"system:\n  \1\n", help)
        assert not found(GOOD.replace("system:\n", pasted, 1).replace("c/m*v", "c/m*drag(v)", 1))
    rows = re.findall(r"\[(-?\d+), (-?\d+), (-?\d+)\]", help)
    x, y, slopes = zip(*(map(Fraction, row) for row in (rows[:3] if power == 2 else rows[3:])), strict=True)
    drag = Lookup("drag", x, y, slopes)
    for v in (Fraction(k, 7) for k in range(-62, 63)):
        assert drag.at(v) == (v * abs(v) if power == 2 else abs(v) ** 3)


def test_there_are_many_of_them() -> None:
    assert len({(old, new) for old, new, *_ in MISTAKES}) == len(MISTAKES) >= 300


def test_a_delay_may_use_a_parameter_whose_name_is_about_samples() -> None:
    text = ON_A_MACHINE.replace("k: 3}", "k: 3, sample_time: 0.001}")
    spec = load_text(text.replace("delay: 0.001", "delay: sample_time/2"))
    assert spec.hardware is not None
    assert spec.hardware.delay == Fraction(1, 2000)


def test_the_sections_that_may_be_indented_too_far_are_those_of_the_schema():
    schema = json.loads(resources.files("tubecert.schemas").joinpath("spec.schema.json").read_text("utf-8"))
    assert set(schema["properties"]) - {"tubecert"} == elsewhere("sections").keys()
