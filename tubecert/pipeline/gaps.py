"""How closely each constant is enclosed: coarsely at first, and closer where that lowers the gains that decide.

What a constant could still come down to is known: no further than the value proven from below, nor by more than its
gap. Gains with all constants there are those that no sharper enclosures can beat; once they are within the gap of the
question, more work would buy less than that. In: a tube. Out: its constants, with the gap of each. Untrusted: it
chooses gaps; every enclosure is proven at any gap, and what the gains are is for the kernel to say.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from math import inf, isfinite, log, sqrt
from typing import Final, TypeVar

from tubecert.bounds.constants import TABLE, WIND, Constant
from tubecert.bounds.machines import COVARIANT, HARDWARE
from tubecert.conditions.alone import supremum
from tubecert.conditions.decimals import round_down
from tubecert.conditions.hardware import HardwareRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Asked
from tubecert.kinds import HARDWARE as KIND_H
from tubecert.kinds.table import kind_of
from tubecert.search.proposers import PROPOSERS
from tubecert.search.scan import serves
from tubecert.stages.bounded import Enclosed, enclose, unmet, with_machine
from tubecert.stages.judged import deciding
from tubecert.stages.question import Question
from tubecert.stages.tube import TubeFound

R = TypeVar("R")
_COARSE: Final = Fraction(1, 5)
_LEAST: Final = Fraction(1, 10**5)
_LEAST_UNDECIDED: Final = Fraction(1, 10**4)  # where there are no gains yet, and perhaps never will be
_CLOSER: Final = (3, 30)  # times, in one round
_ROUNDS: Final = 12
_AIM: Final = 0.9  # of what is left to gain
_MOVED: Final = 0.1  # of what a constant was to come down by: with less, it is as low as it gets
_SURE: Final = frozenset(  # close in any case, or known with the geodesics
    {"lower", "upper", "initial_distance", "feedback_slope", "noise_metric", "symbols", "symbols_slope"}
)
_OF_LIMITS: Final = frozenset(
    {"h", "feedback_gain"}
)  # what inputs with limits are judged by beside the gains
_MADE_OF: Final[Mapping[str, tuple[str, ...]]] = {
    "drift_explained": ("drift_explained", "B_pinv", "f_x"),
    "drift_rate": ("drift_rate", "B_pinv"),
    "drift_difference_metric": ("drift_difference_metric", "drift_slope_metric"),
    "plan_speed": ("plan_speed", "plan_defect"),
}


def enclosed(tube: TubeFound) -> Enclosed:
    """Every constant over the tube: to the gap of the question, or each by its effect where that is asked for.

    Windows of time have constants of their own, to the gap of the question; so has the tube around them.
    """
    question = tube.question
    if not question.by_effect or question.spec.tube.windows is not None:
        return enclose(tube)
    return _refined(tube, log(1 + float(question.options.gap)) / 2)  # digits that are printed take the rest


def _refined(tube: TubeFound, tolerance: float) -> Enclosed:
    spec = tube.question.spec
    names = {*TABLE, *WIND, *HARDWARE, *COVARIANT} - _SURE - (_OF_LIMITS if spec.limits else set())
    gaps, fixed = dict.fromkeys(sorted(names), _COARSE), frozenset[str]()
    found = enclose(tube, gaps)
    for _ in range(_ROUNDS):
        if unmet(found) is not None:
            return enclose(tube)
        now = _Known(found, gaps, fixed)
        closer = now.closer(tolerance)
        if not closer:
            return enclose(tube) if now.falls_short else found
        gaps = gaps | closer
        found = enclose(tube, gaps)
        fixed |= now.settled_in(_Known(found, gaps, fixed), closer)
    return found


class _Known:
    """Constants to certain gaps, and what closer ones could make of the gains; `fixed` cannot come down any further."""

    def __init__(self, found: Enclosed, gaps: Mapping[str, Fraction], fixed: frozenset[str]) -> None:
        self.question, self.gaps, self.work = found.question, gaps, Counter(found.work)
        self.by_machine = KIND_H.key in deciding(self.question)
        self.problem = with_machine(found) if self.by_machine else found.problem
        self.falls_short = False  # whether there are no gains, and would be some with closer constants
        self.constants = {
            name: value for name, value in _constants(self.problem) if name in gaps and name not in fixed
        }

    def closer(self, tolerance: float) -> dict[str, Fraction]:
        """Smaller gaps of the constants that the gains react to; none where they would come down by too little."""
        least = {
            name: low for name, value in self.constants.items() if (low := self.least(name)) < value.above
        }
        now = _sizes(self.problem, self.question)
        best = _sizes(_lowered(self.problem, least), self.question) if least else now
        self.falls_short = all(map(isfinite, best)) and not all(map(isfinite, now))
        if not least or not all(map(isfinite, best)) or _apart(now, best) <= tolerance:
            return {}
        if self.by_machine or not all(map(isfinite, now)):  # of a machine, each effect takes a second
            return self._all_closer(least)
        effects = {
            name: _apart(now, _sizes(_lowered(self.problem, {name: low}), self.question))
            for name, low in least.items()
        }
        wanted = self._shared({name: effect for name, effect in effects.items() if effect > 0}, tolerance)
        return {part: gap for name, own in wanted.items() for part, gap in self._to_gap(name, own)}

    def _shared(self, effects: Mapping[str, float], tolerance: float) -> dict[str, float]:
        """Gaps whose effects are the tolerance together, for about the least work; those that need not change left out.

        Work grows as 1/gap, or so: the least of sum(work/gap), where sum(effect gap) is given, has each gap as the root
        of work/effect.
        """
        known = [self.work[name] for name in effects if self.work[name]]
        weights = {
            name: sqrt((self.work[name] or max(known, default=1)) * self._slack(name) / effect)
            for name, effect in effects.items()
        }
        slopes = {name: effect / self._slack(name) for name, effect in effects.items()}
        left, active = _AIM * tolerance, dict(effects)
        while active:
            scale = left / sum(slopes[name] * weights[name] for name in active)
            enough = [name for name in active if scale * weights[name] >= self._slack(name)]
            if not enough or left <= sum(active[name] for name in enough):
                return {name: scale * weights[name] for name in active if name not in enough}
            for name in enough:
                left -= active.pop(name)
        return {}

    def least(self, name: str) -> float:
        """What a constant may come down to."""
        value, gap = self.constants[name], 1.0
        for part in _MADE_OF.get(name, (name,)):
            gap *= 1 + float(self.gaps[part])
        return max(value.below, value.above / gap) if isfinite(value.above) else value.above

    def settled_in(self, then: _Known, closer: Mapping[str, Fraction]) -> frozenset[str]:
        """The constants that are as close as they get: they have not moved, or not as far as they were to."""
        return frozenset(
            name
            for name, value in self.constants.items()
            if name in closer
            and (
                value.above - then.constants[name].above < _MOVED * (value.above - self.least(name))
                or then.constants[name].above > then.constants[name].below * (1 + 2 * float(then.gaps[name]))
            )
        )

    def _slack(self, name: str) -> float:
        least = self.least(name)
        return self.constants[name].above / least - 1 if least > 0 else float(_COARSE)

    def _reached(self, name: str) -> float:
        """How closely a constant is known: often far closer than was asked for."""
        value = self.constants.get(name)
        if value is None or not (value.below > 0 and isfinite(value.above)):
            return inf
        return value.above / value.below - 1

    def _all_closer(self, least: Mapping[str, float]) -> dict[str, Fraction]:
        wanted = {
            part: gap
            for name in least
            for part, gap in self._to_gap(name, float(self.gaps[name]) / _CLOSER[1])
        }
        return {name: gap for name, gap in wanted.items() if gap >= _LEAST_UNDECIDED}

    def _to_gap(self, name: str, gap: float) -> Iterator[tuple[str, Fraction]]:
        """The gaps of a constant and of what it is made of, to come to one of about this size."""
        for part in _MADE_OF.get(name, (name,)):
            own = min(float(self.gaps[part]), self._reached(part))
            if own > _CLOSER[0] * _LEAST:
                yield part, max(round_down(min(max(gap, own / _CLOSER[1]), own / _CLOSER[0]), 2), _LEAST)


def _constants(problem: TubeProblem) -> Iterator[tuple[str, Constant]]:
    """Every constant of a problem that is a supremum, by name."""
    yield from ((name, value) for name, value, _ in problem.constants.items() if TABLE[name].side == "above")
    yield from ((name, value) for name, value, _ in problem.beside())
    if problem.machine is not None:
        yield from ((name, value) for name, value, _ in problem.machine.constants.items())
        bent = problem.machine.covariant
        yield from () if bent is None else ((name, value) for name, value, _ in bent.items())


def _lowered(problem: TubeProblem, least: Mapping[str, float]) -> TubeProblem:
    """The problem with constants as low as they may turn out to be."""

    def of(record: R, names: Iterable[str], prefix: str = "") -> R:
        own: dict[str, Constant] = {name: getattr(record, name) for name in names if prefix + name in least}
        changes = {
            name: Constant(below=min(value.below, least[prefix + name]), above=least[prefix + name])
            for name, value in own.items()
        }
        return replace(record, **changes) if changes else record  # type: ignore[type-var]

    def beside(record: R, prefix: str) -> R:
        return of(record, [name.removeprefix(prefix) for name in WIND if name.startswith(prefix)], prefix)

    machine, wind, residual, gain = problem.machine, problem.wind, problem.residual, problem.gain
    if machine is not None:
        bent = machine.covariant
        machine = replace(
            machine,
            constants=of(machine.constants, HARDWARE),
            covariant=None if bent is None else of(bent, COVARIANT),
        )
    return replace(
        problem,
        constants=of(problem.constants, TABLE),
        wind=None if wind is None else replace(wind, constants=beside(wind.constants, "wind_")),
        residual=None if residual is None else beside(residual, "residual_"),
        gain=None if gain is None else beside(gain, "gain_"),
        machine=machine,
    )


def _sizes(problem: TubeProblem, question: Question) -> tuple[float, ...]:
    """What is to be small, of each kind that decides: gains, the sampling frequency, or the level that is reached."""
    options = question.options
    asked = Asked(bandwidth=options.bandwidth, adaptation_rate=options.adaptation_rate, curve=False)
    return tuple(size for key in deciding(question) for size in _sizes_of(problem, key, asked))


def _sizes_of(problem: TubeProblem, key: str, asked: Asked) -> tuple[float, ...]:
    theorem = kind_of(key).theorem
    recipe = PROPOSERS[theorem.recipe].propose(problem, asked).decisive
    if recipe is None or not serves(problem, recipe):
        return (inf,)
    if isinstance(recipe, HardwareRecipe):
        largest = None if problem.machine is None else problem.machine.asked.largest
        searched = {"sample_time": recipe.sample_time, "delay": recipe.delay, "noise": recipe.noise}
        most = float(searched.get(largest or "", recipe.wind if largest == "wind" else Fraction(1)))
        return float(recipe.level), 1 / most if most > 0 else inf
    gains = (
        float(getattr(recipe, name)) for name in ("bandwidth", "adaptation_rate") if hasattr(recipe, name)
    )
    time = getattr(recipe, "sample_time", None)
    found = (*gains, *(() if time is None else (1 / float(time),)))
    return found or (float(supremum(problem.floats())),)


def _apart(now: tuple[float, ...], best: tuple[float, ...]) -> float:
    """By how much gains could come down, in logarithms: of the one that could most."""
    pairs = zip(now, best, strict=True) if len(now) == len(best) else [(inf, 1.0)]
    return max((log(a / b) if a < inf and b > 0 else inf for a, b in pairs), default=0.0)
