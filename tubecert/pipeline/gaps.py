"""How closely each constant is enclosed: coarsely at first, and closer where that lowers the gains that decide.

What a constant could still come down to is known: no further than the value proven from below, nor by more than its
gap. Gains with all constants there are those that no sharper enclosures can beat; once they are within the gap of the
question, more work would buy less than that. In: a tube. Out: its constants, with the gap of each. Untrusted: it
chooses gaps; every enclosure is proven at any gap, and what the gains are is for the kernel to say.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from math import inf, isfinite, log, sqrt
from typing import Final, TypeVar

from tubecert.bounds.constants import TABLE, WIND, Constant, Constants
from tubecert.conditions.alone import supremum
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.theorem import Asked
from tubecert.enclosure.constant import round_down
from tubecert.kinds.table import kind_of
from tubecert.search.gains import serves
from tubecert.search.proposers import PROPOSERS
from tubecert.stages.bounded import Enclosed, enclose, unmet
from tubecert.stages.judged import deciding
from tubecert.stages.question import Question
from tubecert.stages.tube import TubeFound

R = TypeVar("R", bound=Constants)
_COARSE: Final = Fraction(1, 5)
_LEAST: Final = Fraction(1, 10**5)
_LEAST_UNDECIDED: Final = Fraction(1, 10**4)  # where there are no gains yet, and perhaps never will be
_CLOSER: Final = (3, 30)  # times, in one round
_ROUNDS: Final = 12
_AIM: Final = 0.9  # of what is left to gain
_MOVED: Final = 0.1  # of what a constant was to come down by: with less, it is as low as it gets
_SURE: Final = frozenset({"lower", "upper", "initial_distance"})  # close in any case
# what inputs with limits are judged by beside the gains
_OF_LIMITS: Final = frozenset({"h", "feedback_gain"})


def enclosed(tube: TubeFound) -> Enclosed:
    """Every constant over the tube: to the gap of the question, or each by its effect where that is asked for."""
    question = tube.question
    if not question.by_effect:
        return enclose(tube)
    return _refined(tube, log(1 + float(question.options.gap)) / 2)  # digits that are printed take the rest


def _refined(tube: TubeFound, tolerance: float) -> Enclosed:
    spec = tube.question.spec
    names = {*TABLE, *WIND} - _SURE - (_OF_LIMITS if spec.limits else set())
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
        self.problem = found.problem
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
        if not all(map(isfinite, now)):
            return self._all_closer(least)
        effects = {
            name: _apart(now, _sizes(_lowered(self.problem, {name: low}), self.question))
            for name, low in least.items()
        }
        wanted = self._shared({name: effect for name, effect in effects.items() if effect > 0}, tolerance)
        return self._to_gaps(wanted)

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
        value = self.constants[name]
        return max(value.below, value.above / (1 + float(self.gaps[name]))) if isfinite(value.above) else inf

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
        wanted = self._to_gaps({name: float(self.gaps[name]) / _CLOSER[1] for name in least})
        return {name: gap for name, gap in wanted.items() if gap >= _LEAST_UNDECIDED}

    def _to_gaps(self, wanted: Mapping[str, float]) -> dict[str, Fraction]:
        """Gaps of about these sizes, each closer than what is known by a factor of `_CLOSER`."""
        found = {}
        for name, gap in wanted.items():
            own = min(float(self.gaps[name]), self._reached(name))
            if own > _CLOSER[0] * _LEAST:
                found[name] = max(round_down(min(max(gap, own / _CLOSER[1]), own / _CLOSER[0]), 2), _LEAST)
        return found


def _constants(problem: TubeProblem) -> Iterator[tuple[str, Constant]]:
    """Every constant of a problem that is a supremum, by name."""
    yield from ((name, value) for name, value, _ in problem.constants.items() if TABLE[name].side == "above")
    yield from ((name, value) for name, value, _ in problem.beside())


def _lowered(problem: TubeProblem, least: Mapping[str, float]) -> TubeProblem:
    """The problem with constants as low as they may turn out to be."""

    def of(record: R) -> R:
        changes = {
            name.removeprefix(record.prefix): Constant(below=min(value.below, least[name]), above=least[name])
            for name, value, _ in record.items()
            if name in least
        }
        return replace(record, **changes)

    wind, residual = problem.wind, problem.residual
    return replace(
        problem,
        constants=of(problem.constants),
        wind=None if wind is None else replace(wind, constants=of(wind.constants)),
        residual=None if residual is None else of(residual),
    )


def _sizes(problem: TubeProblem, question: Question) -> tuple[float, ...]:
    """What is to be small, of each kind that decides: gains, or the distance that is reached."""
    asked = question.options.asked(curve=False)
    return tuple(size for key in deciding(question) for size in _sizes_of(problem, key, asked))


def _sizes_of(problem: TubeProblem, key: str, asked: Asked) -> tuple[float, ...]:
    theorem = kind_of(key).theorem
    recipe = PROPOSERS[theorem.recipe].propose(problem, asked).decisive
    if recipe is None or not serves(problem, recipe):
        return (inf,)
    names = [name for name in ("bandwidth", "adaptation_rate") if hasattr(recipe, name)]
    return tuple(float(getattr(recipe, name)) for name in names) or (float(supremum(problem.floats())),)


def _apart(now: tuple[float, ...], best: tuple[float, ...]) -> float:
    """By how much gains could come down, in logarithms: of the one that could most."""
    pairs = zip(now, best, strict=True) if len(now) == len(best) else [(inf, 1.0)]
    return max((log(a / b) if a < inf and b > 0 else inf for a, b in pairs), default=0.0)
