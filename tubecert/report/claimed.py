"""What a result claims, in words: its time, its start, its plans, its radius, points, sizes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from tubecert.certificate.effective import SystemView, Tree
from tubecert.digits import down, end, in_unit, short, up
from tubecert.records import to_json
from tubecert.words.sampled_loop import NOTHING

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.enclosure.constant import Witness

_WIDER = 1.1  # times its width is what rounding may make of a range
NOT_RECHECKED = (
    "Not rechecked: this is what the certificate says; whether it is true, tubecert recheck examines."
)


def span(result: Result) -> str:
    """The time that is claimed."""
    last = result.spec.effective.trajectory.horizon
    return "for all t >= 0" if last is None else f"for 0 <= t <= {short(last, 12)} s"


def plan_words(result: Result) -> str:
    """What the state stays close to."""
    return "the plan" if result.claim.plans is None else "every plan of the family"


def start_words(result: Result) -> str:
    """Where the state starts: `at q = 0.1, all else 0`, `anywhere with q in [-0.1, 0.1]`, `within 0.1 of ...`."""
    start, whose = result.claim.start, "the plan" if result.claim.plans is None else "its plan"
    return started(to_json(start), result.spec.effective.system, whose)


def started(told: Tree, system: SystemView, whose: str) -> str:
    """The same of canonical data, where a start is within a length, in a box, or at a point."""
    if "within" in told:
        return f"within {end(Fraction(told['within']))} of the start of {whose}"
    sides = system.ordered(told.get("box", {})) or {
        name: (at, at) for name, at in zip(system.states, told.get("at", ()), strict=False)
    }
    places = {name: _place(*ends) for name, ends in sides.items() if set(ends) != {"0"}}
    said = [f"{name} {in_unit(where, system.units.get(name, ''))}" for name, where in places.items()]
    if len(said) < len(sides):
        said.append("all else 0" if said else "0")
    wide = any(where.startswith("in") for where in places.values())
    return f"{'anywhere with' if wide else 'at'} {', '.join(said)}"


def _place(low: str, high: str) -> str:
    """`= 0.1`, or `in [0, 0.1]`; with pi in it, a number is a range as wide as its 30th digit."""
    a, b = end(Fraction(low)), end(Fraction(high))
    return f"= {a}" if a == b else f"in [{a}, {b}]"


def point(result: Result, at: Witness) -> str:
    """A witness: `t = 0.2 s, x1 = 0.1, ...`."""
    return place(result.spec.effective.system.states, at)


def place(states: Sequence[str], at: Witness) -> str:
    """The same for any states."""
    parts = [] if at.t is None else [f"t = {short(at.t, 6)} s"]
    parts += [f"{name} = {short(value, 6)}" for name, value in zip(states, at.x, strict=False)]
    return ", ".join(parts)


def box(sides: Mapping[str, Sequence[Fraction | str]]) -> str:
    """`x in [-1, 1], ...`, as it is declared."""
    told = ((name, end(Fraction(low)), end(Fraction(high))) for name, (low, high) in sides.items())
    return ", ".join(f"{name} in [{low}, {high}]" for name, low, high in told)


def labelled(name: str, system: SystemView, words: str = "") -> str:
    """A state or an input, or `words` about it, with its unit, if it has one."""
    unit = system.units.get(name, "")
    return f"{words or name} ({unit})" if unit else words or name


def size(bound: Fraction) -> str:
    """A half-width or a deviation, rounded up; what is as good as nothing is said in one way."""
    return f"< {short(NOTHING)}" if 0 < bound < NOTHING else up(bound)


def ends(low: Fraction | float, high: Fraction | float, limits: Sequence[Fraction] | None = None) -> str:
    """Ends of a range, rounded outward to so many digits that it is hardly wider, and not beyond limits that it keeps.

    What is next to round numbers, up to rounding errors, is said to be these, within a bound of the errors.
    """
    rounded = [(down(low, digits), up(high, digits)) for digits in range(4, 18)]
    least, most = limits or (-math.inf, math.inf)
    near = ((a, b) for a, b in rounded if Fraction(b) - Fraction(a) <= _WIDER * float(high - low))
    outward = next(((a, b) for a, b in near if least <= Fraction(a) and Fraction(b) <= most), rounded[0])
    plain = [short(round(Fraction(q), 12)) for q in [low, high]]
    missed = max(abs(float(Fraction(plain[0]) - low)), abs(float(Fraction(plain[1]) - high)))
    if missed == 0 or missed > NOTHING:
        return " to ".join(outward)
    return f"{' to '.join(dict.fromkeys(plain))}, within {short(NOTHING)}"
