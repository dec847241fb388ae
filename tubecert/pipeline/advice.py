"""What would certify: for every knob that could help the smallest change that was found to, by certifications with it.

In: the end of a certification that certified nothing. Out: advice in numbers, each of which was certified as it stands,
with the gap and the budget of the question. Looking for it costs no more boxes than the verdict did, or a small number
of them. Untrusted: it chooses what to try; that a value serves is the kernel's word.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import inf, sqrt
from typing import Final

import numpy as np

from tubecert.bounds.compute import uncertainty_bounds
from tubecert.certificate.result import Result
from tubecert.claims.advice import Knob, NoKnobAlone, ReduceInitialError, ReduceRadii, ShrinkTube, TurnKnob
from tubecert.claims.family import Reason, Relax
from tubecert.claims.tube import TubeInSafeSet, TubeRadius
from tubecert.conditions.problem import Formulas, TubeProblem
from tubecert.conditions.proposal import Asked
from tubecert.errors import TubecertError
from tubecert.kernel import overall
from tubecert.kinds import HARDWARE, RATES
from tubecert.kinds.table import kind_of
from tubecert.pipeline.certification import NOTABLE, defect_share, plan, tube
from tubecert.pipeline.gaps import enclosed as closely
from tubecert.pipeline.levers import (
    Lever,
    each_term_less,
    less_of_all,
    less_uncertainty,
    more_knots,
    nearer_start,
    other_parts,
    smaller_tube,
    wider_tube,
)
from tubecert.progress import Phase, Progress, Step
from tubecert.search.proposers import PROPOSERS, Proposer
from tubecert.spec import Spec
from tubecert.stages.bounded import Bounded, Enclosed, bound
from tubecert.stages.judged import Judged, deciding
from tubecert.stages.memory import Memory
from tubecert.stages.metric import ProvenMetric, prove_metric
from tubecert.stages.options import Options
from tubecert.stages.question import Question, Stopped
from tubecert.stages.result import Stage
from tubecert.stages.tube import Planned
from tubecert.verdict import Verdict

_ROUND: Final = 100  # boxes that a round of a search counts beside its own
_GAINS: Final = 3_000  # boxes that the gains of one kind count
_EXPLAINED: Final = 30_000  # boxes that a verdict on gains counts with all its kinds and what explains them
_CHEAP: Final = 80_000  # boxes that advice may cost where the verdict cost less: some seconds
_COARSE: Final = Fraction(1, 5)  # the gap to which constants are known while a value is looked for
_REFINED: Final = 2  # how often a value that serves is brought nearer
_SHARPER: Final = 10
_VAGUE: Final = (ReduceRadii, ReduceInitialError, ShrinkTube)  # said better by numbers

Ask = Callable[[Spec, Options, Progress, Memory], Question]


class Exhausted(Exception):  # noqa: N818 - an end, no error
    """Advice has cost what it may."""


@dataclass(slots=True)
class Ledger:
    """What the searches of a certification cost, told by their progress; beyond `limit` it raises `Exhausted`.

    `phase`: what they are for, where it is not what they say.
    """

    shown: Progress | None = None
    work: int = 0
    limit: int | None = None
    last: tuple[str, int] = field(default=("", 0))
    phase: Phase | None = None

    def __call__(self, step: Step) -> None:
        """Progress of a search: boxes so far."""
        if step.phase is not Phase.GAINS:  # these are counted by kinds
            name, count = self.last
            self.charge(
                _ROUND + (step.count - count if step.name == name and step.count >= count else step.count)
            )
            self.last = step.name, step.count
        if self.shown is not None:
            self.shown(step if self.phase is None else replace(step, phase=self.phase, done=0, of=None))

    def charge(self, work: int) -> None:
        """Counts it."""
        self.work += work
        if self.limit is not None and self.work > self.limit:
            raise Exhausted


def advised(
    result: Result,
    end: Stage | Stopped,
    ledger: Ledger,
    ask: Ask,
    told: Callable[[Result], None] | None = None,
) -> Result:
    """The result with what would certify, beside the reason that decided. `ask` makes a question of a specification.

    `told` hears the result before anything is looked for. For gains of a theorem that were not proven, or a tube that
    does not fit; H has advice of its own.
    """
    planned, judged = _planned(end), end if isinstance(end, Judged) else None
    told_by_h = HARDWARE.key in deciding(end.question)
    if result.verdict is Verdict.CERTIFIED or result.reason is None or planned is None or told_by_h:
        return result
    if told is not None:
        told(result)
    spent = ledger.work + (0 if judged is None else _EXPLAINED)
    ledger.limit = ledger.work + max(spent, _CHEAP)
    ledger.phase = Phase.ADVICE
    found = tuple(_Search(planned, judged, ledger, ask).run())
    return replace(result, reasons=_with(result.reasons, result.reason, found)) if found else result


def _planned(end: Stage | Stopped) -> Planned | None:
    """The plan of a certification that other values may help; None if they cannot."""
    if isinstance(end, Judged):
        sound = end.bounded.problem.formulas is not Formulas.AS_PRINTED
        return end.bounded.enclosed.tube.planned if sound else None
    if isinstance(end, Stopped) and isinstance(end.reason.claim, TubeInSafeSet | TubeRadius):
        return end.at if isinstance(end.at, Planned) else None
    return None


def _with(reasons: tuple[Reason, ...], decisive: Reason, found: tuple[Relax, ...]) -> tuple[Reason, ...]:
    rest = tuple(item for item in decisive.relax if not isinstance(item, _VAGUE))
    return tuple(
        replace(reason, relax=(*found, *rest)) if reason is decisive else reason for reason in reasons
    )


class _Search:
    """The search for what would certify the question of a certification that ended otherwise."""

    def __init__(self, planned: Planned, judged: Judged | None, ledger: Ledger, ask: Ask) -> None:
        self.planned, self.judged, self.question = planned, judged, planned.question
        self.ledger, self.ask = ledger, ask
        self.options = replace(self.question.options, epsilon=None, rho_a=None)  # the specification has them
        self._coarse = replace(self.options, gap=max(self.options.gap, _COARSE))
        self.keys = deciding(self.question)
        own = self.question.options
        self.gains = Asked(bandwidth=own.bandwidth, adaptation_rate=own.adaptation_rate)
        self.tubes: list[tuple[Lever, Fraction, Enclosed]] = []

    def run(self) -> Iterator[Relax]:
        """Advice, from what is cheapest to try."""
        tried: dict[Knob, None] = {}
        found: list[TurnKnob] = []
        try:
            for lever in self._levers():
                if _is_settled(lever, found, tried):
                    continue
                own = self.judged.bounded.enclosed if lever.same_tube and self.judged is not None else None
                value = self._least_change(lever, own)
                tried[lever.knob] = None
                if value is not None:
                    found.append(_advice(lever, value))
            together = None if found else self._together(tuple(tried))
        except Exhausted:
            together = None
        yield from found
        if not found and tried:
            yield together or NoKnobAlone(tried=tuple(tried))

    # -- knobs -----------------------------------------------------------------------------------------------------

    def _levers(self) -> Iterator[Lever]:
        spec, split = self.question.spec, RATES.key in self.keys
        middle = self.planned.plan.enclose(np.zeros(1), np.zeros(1))[0].mid[0]
        if self.judged is None:
            yield from smaller_tube(spec, split)
            yield from nearer_start(spec, list(map(float, middle)))
            return
        problem = self.judged.bounded.problem
        share = _start_share(problem)
        if share >= 1:  # the start is not in the tube: neither h nor a narrower one can help
            # each needs new constants
            self.ledger.limit = self.ledger.limit and self.ledger.limit + 2 * _CHEAP
            yield from nearer_start(spec, list(map(float, middle)), share)
            yield from wider_tube(spec, split)
            return
        if not self._is_blocked(self.judged):
            yield from less_uncertainty(spec)
        yield from smaller_tube(spec, split)
        yield from wider_tube(spec, split)
        if share >= NOTABLE:
            yield from nearer_start(spec, list(map(float, middle)))
        largest = self.planned.metric.proof.largest_rate
        fixed = self.question.synthesis is not None
        yield from other_parts(spec, None if fixed else inf if largest is None else largest.below)
        if defect_share(problem) >= NOTABLE:
            yield from more_knots(spec)
        if not self._is_blocked(self.judged):
            yield from each_term_less(spec)
        if self.judged.verdict is Verdict.UNDECIDED:  # what is refuted fails with the constants themselves
            yield self._sharper()

    def _sharper(self) -> Lever:
        own = self.question.options.gap
        return Lever(
            knob="gap",
            now=own,
            tries=(own / _SHARPER,),
            turned=lambda gap: self.question.spec,
            steps=False,
        )

    def _is_blocked(self, judged: Judged) -> bool:
        """Whether something fails that no other h can help: an obstacle, or the inputs of the plan."""
        obstacles = any(
            each.obstacle.decides and each.verdict is not Verdict.CERTIFIED
            for each in judged.bounded.clearances
        )
        return obstacles or any(each.verdict is Verdict.REFUTED for each in judged.inputs)

    def _least_change(self, lever: Lever, enclosed: Enclosed | None = None) -> Fraction | None:
        """The value nearest to what stands there that was found to certify; None if none did.

        `enclosed`: the constants, where nothing but h differs from what they are about.
        """
        good = next((value for value in lever.tries if self._promises(lever, value, enclosed)), None)
        if good is None:
            return None
        failed = [
            value for value in lever.tries[: lever.tries.index(good)] if _is_between(value, good, lever.now)
        ]
        bad = failed[-1] if failed else lever.now
        for _ in range(_REFINED + lever.same_tube):  # which is cheap
            middle = lever.between(good, bad)
            if middle is None:
                break
            good, bad = (middle, bad) if self._promises(lever, middle, enclosed) else (good, middle)
        return good if self._certifies(lever, good) else None

    def _together(self, tried: tuple[Knob, ...]) -> NoKnobAlone | None:
        """A tube that was tried, and a share of h, that certify together."""
        for lever, value, enclosed in self.tubes:
            share = self._least_change(less_of_all(lever.turned(value)), enclosed)
            if share is not None:
                return NoKnobAlone(
                    tried=tried,
                    epsilon=value if lever.knob == "epsilon" else None,
                    half_widths=value if lever.knob == "half_widths" else None,
                    uncertainty=share,
                )
        return None

    # -- certifications --------------------------------------------------------------------------------------------

    def _promises(self, lever: Lever, value: Fraction, enclosed: Enclosed | None) -> bool:
        """Whether a value seems to serve: with constants that are known coarsely, and the plan as it is."""
        if lever.knob in ("gap", "knots"):
            return True  # nothing is cheaper than to certify it
        spec = lever.turned(value)
        if enclosed is not None and spec.uncertainty.bounds is None:
            return self._suffices(enclosed, spec)
        end = self._end(spec, self._coarse, self._planned_as_it_is)
        if isinstance(end, Judged) and lever.knob in ("epsilon", "half_widths"):
            self.tubes.append((lever, value, end.bounded.enclosed))
        return isinstance(end, Judged) and end.verdict is Verdict.CERTIFIED

    def _certifies(self, lever: Lever, value: Fraction) -> bool:
        """Whether the specification with this value is certified by what decides, as it would be if it were asked."""
        sharper = replace(self.options, gap=value, by_effect=False) if lever.knob == "gap" else self.options
        end = self._end(lever.turned(value), sharper, plan)
        return isinstance(end, Judged) and end.verdict is Verdict.CERTIFIED

    def _suffices(self, enclosed: Enclosed, spec: Spec) -> bool:
        """The same tube and constants, but those of another h."""
        question = self._asked(spec, self._coarse)
        if question is None:
            return False
        own = enclosed.suprema
        other = replace(
            question.suprema(enclosed.tube.plan), coordinates=own.coordinates, rho=own.rho, sides=own.sides
        )
        _, derived = uncertainty_bounds(other, question.start, {})
        constants = replace(enclosed.constants, **derived).printable()
        return self._verdict(replace(enclosed.problem, constants=constants)) is Verdict.CERTIFIED

    def _end(
        self, spec: Spec, options: Options, planned: Callable[[ProvenMetric], Planned]
    ) -> Judged | Stopped | None:
        """How the certification of a specification ends, judged by the kinds that decide; None if it means nothing."""
        question = self._asked(spec, options)
        try:
            metric = None if question is None else self._metric(question)
            found = None if metric is None else tube(planned(metric))
        except TubecertError:
            return None
        if found is None or isinstance(found, Stopped):
            return found
        bounded = bound(closely(found))
        if isinstance(bounded, Stopped):
            return bounded
        return self._judged(bounded)

    def _asked(self, spec: Spec, options: Options) -> Question | None:
        try:
            return self.ask(spec, options, self.ledger, self.question.memory)
        except TubecertError:
            return None

    def _metric(self, question: Question) -> ProvenMetric | None:
        """The proof that there is, where it is about this metric; else another."""
        known = self.planned.metric
        if known.proof.is_about(question.model, question.spec.safe_set):
            return ProvenMetric(question=question, proof=known.proof, lower=known.lower)
        found = prove_metric(question)
        return None if isinstance(found, Stopped) else found

    def _planned_as_it_is(self, metric: ProvenMetric) -> Planned:
        own, other = self.question.spec.trajectory, metric.question.spec.trajectory
        return replace(self.planned, metric=metric) if own == other else plan(metric)

    def _judged(self, bounded: Bounded) -> Judged:
        """A section of every kind that decides."""
        problem = bounded.problem
        sections = {
            key: kind_of(key).section(problem, self._proposer(key).propose(problem, self.gains))
            for key in self.keys
        }
        return Judged(bounded=bounded, sections=sections)

    def _verdict(self, problem: TubeProblem) -> Verdict:
        """What those kinds say of a problem."""
        proposals = ((key, self._proposer(key).propose(problem, self.gains)) for key in self.keys)
        return overall([kind_of(key).section(problem, proposal).verdict for key, proposal in proposals])

    def _proposer(self, key: str) -> Proposer:
        """Who proposes the gains of a kind, which costs something."""
        kind = kind_of(key)
        self.ledger.charge(_GAINS if kind.name.adapts else 0)
        return PROPOSERS[kind.theorem.recipe]


def _advice(lever: Lever, value: Fraction) -> TurnKnob:
    return TurnKnob(knob=lever.knob, now=lever.now, value=value, input=lever.input, term=lever.term)


def _is_settled(lever: Lever, found: Sequence[TurnKnob], tried: Container[Knob]) -> bool:
    """Whether a knob has its advice; a term of h also where less of all h did not help."""
    same = [each for each in found if each.knob == lever.knob]
    if lever.term is None or lever.knob not in tried:
        return bool(same)
    return not same or any(each.term == lever.term for each in same)


def _is_between(value: Fraction, one: Fraction, other: Fraction) -> bool:
    return min(one, other) < value < max(one, other)


def _start_share(problem: TubeProblem) -> float:
    """How much of the tube the start takes: d0/dbar."""
    constants = problem.constants
    return constants.initial_distance.above / (sqrt(constants.lower.below) * float(problem.rho))
