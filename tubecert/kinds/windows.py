"""Windows of time as data: what certificates B, C and H prove in each. Implements: theory 4f, 8.9."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.bounds.constants import Meaning
from tubecert.conditions.inputs import InputBound, LimitedInput
from tubecert.conditions.problem import Part, TubeProblem
from tubecert.conditions.stretches import LevelProof, over, shares_in
from tubecert.conditions.theorem import R
from tubecert.enclosure.constant import Constant, printable_above, printable_below
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.kernel import Proof

Ranges = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowData:
    """A window of time from `begin` to `end`, in s: its level, and what follows there.

    `tube` is the radius of the tube that its `constants` hold in, by name the safe side of each that is sharper than
    over the whole tube; d(x*, x) <= `supremum` < `level`, `radius` bounds |x - x*|.
    """

    begin: Fraction
    end: Fraction
    tube: Fraction
    level: Fraction | None
    radius: float | None
    supremum: float | None
    half_widths: Mapping[str, float]
    inputs: Mapping[str, tuple[float, float]]
    constants: Mapping[str, float]


def sharper(whole: TubeProblem, part: TubeProblem) -> Mapping[str, float]:
    """The constants of a window that are sharper than those of the whole tube, by name, each on its safe side."""
    found: dict[str, float] = {}
    for name, value, meaning in _of(part):
        old = next(each for known, each, _ in _of(whole) if known == name)
        if meaning.side == "below" and value.below > old.below:
            found[name] = value.below
        elif meaning.side == "above" and value.above < old.above:
            found[name] = value.above
    return found


def _of(problem: TubeProblem) -> list[tuple[str, Constant, Meaning]]:
    """Every constant that theorem H may use, by its name in a certificate; without a machine those of B and C."""
    machine = problem.machine
    own = [] if machine is None else machine.constants.items()
    bent = [] if machine is None or machine.covariant is None else machine.covariant.items()
    return [*problem.constants.items(), *problem.beside(), *own, *bent]


def widest(ranges: Sequence[Ranges]) -> Ranges:
    """Of every input the range that contains those of all windows."""
    return {
        name: (min(each[name][0] for each in ranges), max(each[name][1] for each in ranges))
        for name in ranges[0]
    }


def told(
    problem: TubeProblem, levels: Sequence[LevelProof], suprema: Sequence[float], radius: Fraction
) -> tuple[WindowData, ...]:
    """What certificate B or C says of each window, by a recipe that is proven; R_H is `radius`."""
    return tuple(
        _window(problem, part, own.level, supremum, radius)
        for part, own, supremum in zip(problem.parts, levels, suprema, strict=True)
    )


def untold(problem: TubeProblem) -> tuple[WindowData, ...]:
    """The windows where nothing is proven in them."""
    return tuple(
        WindowData(
            begin=part.begin,
            end=part.end,
            tube=part.radius,
            level=None,
            radius=None,
            supremum=None,
            half_widths={},
            inputs={},
            constants=sharper(problem, over(problem, part)),
        )
        for part in problem.parts
    )


def bound_of(own: LimitedInput, proof: Proof[R] | None, windows: Sequence[WindowData]) -> InputBound | None:
    """What an input with limits does in a loop that is proven; in windows, in any of them."""
    if proof is None:
        return None
    shares = proof.input_shares
    if shares is None or not windows:
        return own.bound(shares)
    least, greatest = widest([each.inputs for each in windows])[own.name]
    return InputBound(least=least, greatest=greatest, shares=shares)


def _window(
    problem: TubeProblem, part: Part, level: Fraction, supremum: float, radius: Fraction
) -> WindowData:
    top, least = Interval.of(level), Interval.exact(part.constants.lower.below)
    return WindowData(
        begin=part.begin,
        end=part.end,
        tube=part.radius,
        level=level,
        radius=printable_above(float((top / sqrt(least)).hi)),
        supremum=printable_above(supremum),
        half_widths={
            name: printable_above(float((Interval.exact(width) * top).hi))
            for name, width in part.widths.items()
        },
        inputs=dict(_ranges(problem, part, supremum, radius)),
        constants=sharper(problem, over(problem, part)),
    )


def _ranges(
    problem: TubeProblem, part: Part, supremum: float, radius: Fraction
) -> Iterator[tuple[str, tuple[float, float]]]:
    """u_i in [inf u*_i - du D - R, sup u*_i + du D + R]; nothing where du has no bound.

    (4.13) in a window, theorems BW and CW.
    """
    added = shares_in(problem, part, supremum, radius)
    if added is None:
        return
    more = Fraction(added.feedback) + Fraction(added.adaptation)
    for name, (low, high) in part.inputs.items():
        yield name, (printable_below(Fraction(low) - more), printable_above(Fraction(high) + more))
