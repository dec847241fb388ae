"""The section `simulation`: what `simulate` does if the command line does not say otherwise. It proves nothing."""

from __future__ import annotations

from fractions import Fraction
from typing import Final

from tubecert.letters import ADAPTIVE, name_of, words_of
from tubecert.spec import codes
from tubecert.spec.names import Names
from tubecert.spec.obstacles import read_plane
from tubecert.spec.reader import Field
from tubecert.spec.types import Simulation, Trajectory

KEYS: Final = ("controllers", "gains", "duration", "runs", "seed", "plane", "h")
CONTROLLERS: Final = ("nominal", "ccm", "reference", "l1")
MAX_RUNS: Final = 1_000_000
MAX_SEED: Final = 2**63 - 1


def read_simulation(field: Field | None, plan: Trajectory | None, names: Names) -> Simulation | None:
    """Defaults of the command `simulate`; None if the section is absent or unsound."""
    entries = field.mapping(optional=KEYS) if field else None
    if field is None or entries is None:
        return None
    before = len(field.reader.findings)
    plane = entries.get("plane")
    h = entries.get("h")
    found = Simulation(
        controllers=_controllers(entries.get("controllers")),
        gains=_gains(entries.get("gains")),
        duration=_duration(entries.get("duration"), plan, names),
        runs=_whole(entries.get("runs"), names, least=1, most=MAX_RUNS),
        seed=_whole(entries.get("seed"), names, least=0, most=MAX_SEED),
        plane=read_plane(plane, field, names) if plane else None,
        h=h.terms(len(names.inputs), names.of_uncertainty(), "expressions, one per input") if h else None,
    )
    return found if len(field.reader.findings) == before else None


def _gains(field: Field | None) -> str | None:
    """The kind whose gains are taken, by its word."""
    word = field.word(words_of(ADAPTIVE)) if field else None
    return None if word is None else name_of(word).option


def _controllers(field: Field | None) -> tuple[str, ...]:
    """The loops, each once."""
    items = field.items(None, "controllers") if field else None
    chosen: list[str] = []
    for item in items or []:
        word = item.word(CONTROLLERS)
        if word in chosen:
            item.fail(codes.RANGE, f"{item.path}: {word} occurs twice", "name each controller once")
        elif word:
            chosen.append(word)
    if field and items is not None and not items:
        field.fail(codes.RANGE, f"{field.path} is empty", f"choose from {', '.join(CONTROLLERS)}")
    return tuple(chosen)


def _duration(field: Field | None, plan: Trajectory | None, names: Names) -> Fraction | None:
    duration = field.number(names.values, above=0) if field else None
    horizon = plan.horizon if plan else None
    if field and duration is not None and horizon is not None and duration > horizon:
        field.fail(codes.RANGE, "the duration exceeds trajectory.horizon", "the plan ends there")
    return duration


def _whole(field: Field | None, names: Names, *, least: int, most: int) -> int | None:
    value = field.number(names.values, least=least, most=most) if field else None
    if field is None or value is None:
        return None
    if value.denominator != 1:
        field.fail(codes.RANGE, f"{field.path} must be a whole number")
    return int(value)
