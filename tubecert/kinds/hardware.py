"""Certificate H: the loop as a computer runs it. Implements: theory 8, theorems H and H-P."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from fractions import Fraction

from tubecert.conditions import hardware
from tubecert.conditions.hardware import LEVEL, STAYS, Budget, HardwareRecipe, Told
from tubecert.conditions.hardware.windows import over
from tubecert.conditions.inputs import InputBound, InputShares, LimitedInput
from tubecert.conditions.machine import Machine, Window
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal
from tubecert.enclosure.constant import Constant, printable_above, printable_below
from tubecert.enclosure.interval import Interval
from tubecert.kernel import Checked, judge
from tubecert.kinds import HARDWARE
from tubecert.kinds.data import Pair, Role, SectionData, margin_data, missing_data
from tubecert.kinds.kind import Kind, Section
from tubecert.kinds.windows import WindowData, sharper, widest


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwarePoint:
    """A proven point of a curve: the level that a sample time allows."""

    sample_time: Fraction
    level: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareData(SectionData):
    """Certificate H: the machine, the level d(x*, x) < `level` that is proven for it, and what follows.

    `deadbeat`: the filter has no bandwidth of its own, the newest estimate is used as it is; `noise` is |n|, or in
    units of what is given per state; `clip` by input, empty for a ball of `clip_radius`; `radius` bounds |x - x*|
    (a length in the coordinates of the tube, where it has some),
    `half_widths` |x_i - x_i*|, `inputs` every input; `margin` is that of (H.12), `level_margin` that of (H.10).
    With `windows` these are the largest of them, and margins the least.
    """

    name = HARDWARE
    sample_time: Fraction | None
    delay: Fraction | None
    feedback_time: Fraction | None
    bandwidth: Fraction | None
    deadbeat: bool
    noise: Fraction | None
    wind: Fraction | None
    predict: bool
    clip: tuple[tuple[Fraction, Fraction], ...]
    clip_radius: Fraction | None
    level: Fraction | None
    radius: float | None
    half_widths: Mapping[str, float]
    inputs: Mapping[str, tuple[float, float]]
    margin: Constant | None
    level_margin: Constant | None
    budget: Budget | None
    curve: tuple[HardwarePoint, ...]
    largest: str | None = None
    windows: tuple[WindowData, ...] = ()

    def pairs(self, *, asked: bool) -> tuple[Pair, ...]:
        """The one machine."""
        del asked
        if self.sample_time is None or self.margin is None or self.level_margin is None:
            return ()
        role: Role = "machine" if self.largest is None else "largest"
        margins = {STAYS: self.margin, LEVEL: self.level_margin}
        return (Pair(role=role, bandwidth=self.bandwidth, sample_time=self.sample_time, margins=margins),)

    def points(self) -> tuple[tuple[float, float], ...]:
        """Sample time and level."""
        return tuple((float(p.sample_time), float(p.level)) for p in self.curve)


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareSection(Section[HardwareRecipe]):
    """The machine that was asked for, or the largest that serves, with the least level found for it."""

    name = HARDWARE
    problem: TubeProblem
    machine: Machine
    told: Told | None
    told_in_windows: tuple[Told, ...] = ()

    def data(self) -> HardwareData:
        """The section `hardware` of the certificate."""
        found, proof = self.decisive, self.proof
        r = None if found is None else found.recipe
        known = None if proof is None else self.told
        return HardwareData(
            verdict=self.verdict,
            sample_time=None if r is None else r.sample_time,
            delay=None if r is None else r.delay,
            feedback_time=None if r is None else r.feedback_time,
            bandwidth=None if r is None else r.bandwidth,
            deadbeat=r is not None and r.bandwidth is None,
            noise=None if r is None else r.noise,
            wind=None if r is None else r.wind,
            predict=self.machine.asked.predict,
            clip=self.machine.clip,
            clip_radius=None if r is None else r.clip_radius,
            level=None if r is None else r.level,
            radius=None if known is None else printable_above(known.radius),
            half_widths={} if r is None or known is None else self._half_widths(r.level),
            inputs={} if r is None or known is None else self._inputs(r, known),
            margin=_margin(found, STAYS),
            level_margin=_margin(found, LEVEL),
            ultimate_radius=self.judgement.ultimate_radius,
            budget=None if known is None else _budget(known),
            curve=tuple(HardwarePoint(sample_time=r.sample_time, level=r.level) for r in self.curve),
            largest=self.machine.asked.largest,
            shortfalls=missing_data(self.shortfalls),
            windows=self._windows(),
        )

    def _windows(self) -> tuple[WindowData, ...]:
        """Each window, with what is proven in it if anything is."""
        known = self.told_in_windows or (None,) * len(self.machine.windows)
        return tuple(
            self._window(j, window, own)
            for j, (window, own) in enumerate(zip(self.machine.windows, known, strict=True))
        )

    def _window(self, j: int, window: Window, known: Told | None) -> WindowData:
        recipe = None if self.proof is None else self.proof.recipe
        own = None if recipe is None or known is None else recipe.windows[j]
        return WindowData(
            begin=window.begin,
            end=window.end,
            tube=window.radius,
            level=None if own is None else own.level,
            radius=None if known is None else printable_above(known.radius),
            supremum=None if known is None else printable_above(known.supremum),
            half_widths={} if own is None else self._half_widths(own.level),
            inputs={} if recipe is None or known is None else self._range_of(recipe, known, window.inputs),
            constants=sharper(self.problem, over(self.problem, window)),
        )

    def _half_widths(self, dhat: Fraction) -> Mapping[str, float]:
        """|x_i - x_i*| < dhat sup sqrt(W_ii), theorem H."""
        level = Interval.of(dhat)
        return {
            name: printable_above(float((Interval.exact(width) * level).hi))
            for name, width in self.machine.widths.items()
        }

    def input_bound(self, own: LimitedInput) -> InputBound | None:
        """What an input does with this machine: the range of the section."""
        if self.proof is None or self.told is None:
            return None
        recipe = self.proof.recipe
        found = self._inputs(recipe, self.told).get(own.name)
        if found is None:
            return None
        clip = self.machine.clip[list(self.machine.inputs).index(own.name)] if self.machine.clip else ()
        adaptation = printable_above(max(map(abs, clip), default=recipe.clip_radius))
        shares = InputShares(feedback=printable_above(self.told.feedback), adaptation=adaptation)
        return InputBound(least=found[0], greatest=found[1], shares=shares)

    def input_along(self, name: str) -> tuple[tuple[float, float], ...]:
        """The range of an input in each window."""
        return (
            () if self.proof is None else tuple(w.inputs[name] for w in self._windows() if name in w.inputs)
        )

    def _inputs(self, recipe: HardwareRecipe, known: Told) -> Mapping[str, tuple[float, float]]:
        """What every input does, in any window."""
        windows = zip(self.machine.windows, self.told_in_windows, strict=False)
        found = [self._range_of(recipe, own, window.inputs) for window, own in windows]
        return widest(found) if found else self._range_of(recipe, known, self.machine.inputs)

    def _range_of(
        self, recipe: HardwareRecipe, known: Told, ranges: Mapping[str, tuple[float, float]]
    ) -> Mapping[str, tuple[float, float]]:
        """What every input does, (H.16): u*, the feedback, and the clip with its other sign."""
        R, feedback = recipe.clip_radius, Fraction(known.feedback)
        clip = self.machine.clip if self.machine.clip and ranges else tuple((-R, R) for _ in ranges)
        return {
            name: (
                printable_below(Fraction(low) - feedback - most),
                printable_above(Fraction(high) + feedback - least),
            )
            for (name, (low, high)), (least, most) in zip(ranges.items(), clip, strict=True)
        }


def _margin(found: Checked[HardwareRecipe] | None, condition: str) -> Constant | None:
    return None if found is None else margin_data(found.margins[condition])


def _budget(known: Told) -> Budget:
    """The shares as they are printed."""
    return Budget(**{item.name: printable_above(getattr(known.budget, item.name)) for item in fields(Budget)})


class Hardware(Kind[HardwareRecipe]):
    """Certificate H."""

    name = HARDWARE
    theorem = hardware.THEOREM
    form = HardwareData

    def applies(self, problem: TubeProblem) -> bool:
        """Whether the specification says what the hardware is."""
        return problem.machine is not None

    def section(self, problem: TubeProblem, proposal: Proposal[HardwareRecipe]) -> HardwareSection:
        """The section about a proposal; `ValueError` where it does not apply."""
        if problem.machine is None:
            raise ValueError("the specification says nothing of the hardware")
        judgement = judge(problem, self.theorem, proposal)
        proof = judgement.proof
        return HardwareSection(
            judgement=judgement,
            problem=problem,
            machine=problem.machine,
            told=None if proof is None else hardware.told(problem, proof.recipe),
            told_in_windows=()
            if proof is None or not proof.recipe.windows
            else hardware.told_in_windows(problem, proof.recipe),
        )
