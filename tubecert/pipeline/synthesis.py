"""Synthesis of a metric for a specification: objectives, the table over rates, the metric file, and why there is none.

The ladder of `tubecert.synthesis` finds metrics at given rates; here they are compared by what the user wants in the
end, which for `adaptation` and `tube` is a certification with each of them. What is returned was read back from the
text that a metric file will hold, and is what its proof is about.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import inf

from tubecert.claims.advice import (
    AskForRateBelow,
    EnlargeSafeSet,
    GiveInput,
    LowerRate,
    MeasureTube,
    OtherVariables,
    RaiseBudget,
    RaiseConditionNumber,
    ReduceRadii,
    ShrinkSafeSet,
)
from tubecert.claims.failures import (
    ConditionNumber,
    Failure,
    NoneCertified,
    NotProvenAsWritten,
    NotWritable,
    RankUnproven,
)
from tubecert.claims.family import Reason, Relax
from tubecert.claims.statements import MetricFound, TubeInSafeSet
from tubecert.digits import near
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import Witness, round_down
from tubecert.errors import SpecError
from tubecert.metric.verify import MetricProof, Proofs
from tubecert.model import build, rank_decision
from tubecert.pipeline.candidates import judged_row, measured_in
from tubecert.pipeline.certification import question_of
from tubecert.pipeline.checks import missing_radii
from tubecert.pipeline.climb import Climb, pace, slow_scale
from tubecert.pipeline.listening import Cut, Deadline, Listeners, OutOfTime, cut_by
from tubecert.pipeline.synthesised import Row, Synthesised, TooLongError, file_of, read_back, shorter
from tubecert.pipeline.unfound import (
    equilibria,
    half_widths,
    none_certified,
    otherwise,
    remedies,
    tried,
)
from tubecert.progress import Phase, Step, Unit
from tubecert.spec import Spec, Synthesis
from tubecert.stages.question import Memory, Options, Question
from tubecert.synthesis.diagnose import uncontrollable_mode
from tubecert.synthesis.family import FamilyError
from tubecert.synthesis.ladder import Ladder, Request, routes
from tubecert.synthesis.problem import FLOORS, Floor
from tubecert.synthesis.rounding import VerifiedMetric
from tubecert.verdict import Verdict

_RATES = 5  # of a table
_GAP = Fraction(1, 5)  # to which constants are known where metrics are compared
_BOXES = 100_000  # and what each claim may cost there


class SynthesisRun:
    """One synthesis: its ladder, and the certifications that metrics are compared by.

    `enough`: a metric whose tube needs no adaptation is.
    """

    def __init__(
        self,
        spec: Spec,
        wanted: Synthesis,
        options: Options,
        listeners: Listeners,
        *,
        enough: bool = False,
        proofs: Proofs | None = None,
    ) -> None:
        self.spec, self.wanted, self.options, self.listeners = spec, wanted, options, listeners
        self.model = build(replace(spec, metric=None))
        self.memory = Memory(proofs=proofs or Proofs())
        whole_way = wanted.objective in ("adaptation", "tube")
        budget = min(options.budget, _BOXES) if whole_way and wanted.rate is None else options.budget
        self.effort = Effort(
            gap=float(options.gap), budget=budget, progress=lambda step: self.listeners.deadline.check()
        )
        self.limit = None if wanted.condition_number is None else float(wanted.condition_number)
        self.ladder = Ladder(
            Request(
                model=self.model,
                safe_set=spec.safe_set,
                routes=routes(wanted.route),
                degree=wanted.degree,
                variables=wanted.variables,
                limit=self.limit,
                solver=wanted.solver,
                coordinates=wanted.coordinates,
                half_widths=half_widths(spec),
                effort=self.effort,
                proofs=self.memory.proofs,
                pace=pace(slow_scale(self.model, spec)),
                progress=self._tell,
            )
        )
        self.rows: dict[tuple[Fraction, Floor, int], Row] = {}
        self.climb = Climb(self._compare, wanted.objective, enough and wanted.objective == "adaptation")
        self.cut: Cut | None = None
        self.said = self.noted = 0
        self.known: tuple[VerifiedMetric | None, int] = (None, 0)
        self.last: Synthesised | None = None

    def run(self, *, table: bool) -> Synthesised:
        """The metric that was asked for, or why there is none."""
        rank = rank_decision(self.model, self.spec.safe_set, self.effort)
        if rank.verdict is not Verdict.CERTIFIED:
            verdict = Verdict.REFUTED if rank.verdict is Verdict.REFUTED else Verdict.UNDECIDED
            at = Witness(x=tuple(rank.at.get(name, 0.0) for name in self.model.states)) if rank.at else None
            return self._failed(RankUnproven(), ShrinkSafeSet(), verdict=verdict, at=at)
        rate = self.wanted.rate
        points = equilibria(self.spec)
        if rate is not None and (mode := uncontrollable_mode(self.model, points, rate)) is not None:
            lower = AskForRateBelow(rate=mode.limit) if mode.bound > 0 else GiveInput()
            verdict = Verdict.REFUTED if mode.excludes(rate) else Verdict.UNDECIDED
            at = Witness(x=tuple(map(float, mode.at)))
            return self._failed(mode.failure(), lower, verdict=verdict, at=at)
        try:
            best = self._best()
        except FamilyError as error:  # what C3 forbids
            return self._failed(error.failure, OtherVariables())
        except TooLongError as error:
            return self._failed(NotWritable(code=error.code), shorter(error.metric))
        except (OutOfTime, KeyboardInterrupt) as end:
            best = self._so_far(end)
        if best is None:
            try:
                return self._explained()
            except OutOfTime as end:
                self._so_far(end)
                return self._explained()
        if table and not self.rows and not self.cut:
            self._over_rates(best.rate)
        return self._written(best)

    def _so_far(self, end: BaseException) -> VerifiedMetric | None:
        """The best of what is proven when the search is cut short; an interruption goes on if nothing was judged."""
        self.listeners, self.cut = replace(self.listeners, deadline=Deadline()), cut_by(end)
        found = self._best_so_far()
        if found is None and self.cut == "interrupted" and none_certified(self._table()) is None:
            raise end
        return found

    def _best_so_far(self) -> VerifiedMetric | None:
        wanted = self.wanted
        if wanted.objective in ("adaptation", "tube"):
            return self._chosen()
        proven = [metric for metric in self.ladder.proven if self._allowed(metric)]
        if wanted.rate is None:
            return max(proven, key=lambda metric: metric.rate, default=None)
        proven = [metric for metric in proven if metric.rate >= wanted.rate]
        found = min(proven, key=lambda metric: metric.condition_number.above, default=None)
        return found and self._at_rate(found, wanted.rate)

    def _keep(self) -> None:
        """Tells what there is, as it would come out now."""
        if self.listeners.kept is None:
            return
        attempts, best = tuple(self.ladder.attempts), self._best_so_far()
        if self.last is None or (best, len(self.rows)) != self.known:
            self.known = best, len(self.rows)
            self.last = self._failed(tried(attempts)) if best is None else self._written(best)
        self.last = replace(self.last, attempts=attempts)
        self.listeners.kept(self.last)

    # -- objectives ------------------------------------------------------------------------------------------------

    def _best(self) -> VerifiedMetric | None:
        wanted = self.wanted
        if wanted.objective == "rate":
            found = self.ladder.largest_rate(self.limit)
            return found and self.ladder.metric(found.rate)
        if wanted.objective in ("adaptation", "tube"):
            return self._end_to_end()
        assert wanted.rate is not None
        found = self.ladder.metric(wanted.rate)
        if found is None or not self._allowed(found):
            return None
        if wanted.objective == "condition":
            return found
        limit = self.limit or 2 * found.condition_number.above
        wide = self.ladder.largest_rate(limit, least=wanted.rate)
        return (wide and self._at_rate(wide, wanted.rate)) or found

    def _at_rate(self, metric: VerifiedMetric, rate: Fraction) -> VerifiedMetric | None:
        """The same metric with the rate that was asked for: what it supports beyond is its margin."""
        proof = self._verified(metric, rate)
        return replace(metric, rate=rate, proof=proof) if proof.verdict is Verdict.CERTIFIED else None

    def _verified(self, metric: VerifiedMetric, rate: Fraction) -> MetricProof:
        model = replace(self.model, W=metric.dual_metric, rate=rate)
        return self.memory.proofs.of(model, self.spec.safe_set, self.effort)

    def _allowed(self, metric: VerifiedMetric) -> bool:
        return self.limit is None or metric.condition_number.above <= self.limit

    def _end_to_end(self) -> VerifiedMetric | None:
        """The metric whose certification comes out best, over rates and over what is bounded from below.

        Raises `SpecError` if the end cannot be judged: what `certify` needs is missing.
        """
        if missing := missing_radii(self.spec):
            raise SpecError(missing)
        if self.wanted.rate is not None:
            self.climb.at(self.wanted.rate)
        else:
            self.climb.run(slow_scale(self.model, self.spec))
        self.cut = self.climb.ended
        return self._chosen()

    def _chosen(self) -> VerifiedMetric | None:
        best = self.climb.best
        return None if best is None else best.metric

    def _over_rates(self, last: Fraction) -> None:
        for k in range(_RATES):
            for floor in FLOORS:
                self._compare(round_down(last / 2**k, 3), floor, full=True)

    def _compare(self, rate: Fraction, floor: Floor, full: bool) -> Row | None:
        """A row for a metric of this rate; None if there is none."""
        self._keep()
        enough = 0.0 if full else inf if self.limit is None else self.limit
        # where B moves, so does W: higher degrees are dear, and hardly pay
        any_degree = full and self.ladder.flat
        metric = self.ladder.metric(rate, floor, enough, None if any_degree else self.climb.degree)
        if metric is None or (floor == "identity" and not self._allowed(metric)):
            return None
        key = rate, floor, metric.family.degree
        if key not in self.rows:
            self.rows[key] = self._row(metric, floor)
        return self.rows[key]

    def _row(self, metric: VerifiedMetric, floor: Floor) -> Row:
        row = Row(
            rate=metric.rate,
            floor=floor,
            degree=metric.family.degree,
            condition_number=metric.condition_number.above,
            metric=metric,
        )
        if missing_radii(self.spec):
            return row
        try:
            spec = read_back(self.spec, metric)
        except SpecError as error:  # too long to be written, as the metrics of other rates are, too
            if self.climb.best is None:
                raise TooLongError(metric, error.findings[0].code) from None
            return row
        self._say(f"rate {near(metric.rate, 4)}: certifying")
        outputs = measured_in(self.spec, self.wanted.outputs)
        return judged_row(row, self._question(spec, self._judging()), outputs)

    def _judging(self) -> Options:
        """How closely a metric is judged that is to be compared."""
        return replace(
            self.options,
            gap=max(self.options.gap, _GAP),
            budget=min(self.options.budget, _BOXES),
            metric=None,
        )

    def _question(self, spec: Spec, options: Options) -> Question:
        return question_of(spec, options, self.listeners, self.memory)

    # -- outcomes ---------------------------------------------------------------------------------------------------

    def _written(self, metric: VerifiedMetric) -> Synthesised:
        """The metric as a file will hold it: read back, and proven as read."""
        try:
            spec = read_back(self.spec, metric)
        except SpecError as error:
            return self._failed(NotWritable(code=error.findings[0].code), shorter(metric))
        model = build(spec)
        proof = self.memory.proofs.of(model, spec.safe_set, self.effort)
        if proof.failed is not None:
            return self._failed(NotProvenAsWritten(condition=proof.failed), RaiseBudget())
        file, limits = file_of(spec, proof, metric), self.climb.limits()
        return replace(self._ended(proof.verdict), spec=spec, file=file, limits=limits)

    def _ended(self, verdict: Verdict) -> Synthesised:
        """A verdict, with what was tried."""
        return Synthesised(
            verdict=verdict,
            objective=self.wanted.objective,
            rate=self.wanted.rate,
            wanted=self.wanted,
            rows=self._table(),
            attempts=tuple(self.ladder.attempts),
            cut=self.cut,
        )

    def _table(self) -> tuple[Row, ...]:
        return tuple(sorted(self.rows.values(), key=lambda row: (row.rate, row.floor, row.degree)))

    def _failed(
        self,
        failure: Failure,
        *relax: Relax,
        verdict: Verdict = Verdict.UNDECIDED,
        at: Witness | None = None,
    ) -> Synthesised:
        reason = Reason(claim=MetricFound(failure=failure), verdict=verdict, at=at, relax=relax)
        return replace(self._ended(verdict), reason=reason)

    def _explained(self) -> Synthesised:
        """Why there is no metric, where no mode excludes the rate: condition number, degree, rate, box."""
        rate = self.wanted.rate
        if rate is not None:
            found = self.ladder.metric(rate)
            if found is not None and not self._allowed(found):
                number = found.condition_number.above
                return self._failed(
                    ConditionNumber(rate=rate, condition_number=number),
                    RaiseConditionNumber(to=number),
                    LowerRate(),
                )
        if (failure := none_certified(self._table())) is not None:
            return self._none(failure)
        if self.listeners.told is not None:
            self.listeners.told(self._failed(tried(self.ladder.attempts)))
        return self._failed(
            tried(self.ladder.attempts), *remedies(self.ladder, rate, self.wanted.degree, self._say)
        )

    def _none(self, failure: NoneCertified) -> Synthesised:
        """Why none of the metrics certifies."""
        if self.cut == "plan":
            mends = [row.mend for row in self.rows.values() if row.mend is not None]
            return self._failed(failure, *sorted(mends, key=lambda mend: mend.share)[:1])
        if (tube := self._other_tube()) is not None:
            return self._failed(failure, tube)
        small = isinstance(failure.slow, TubeInSafeSet)
        return self._failed(failure, *((ReduceRadii(), EnlargeSafeSet()) if small else ()))

    def _other_tube(self) -> MeasureTube | None:
        """A tube that certifies with one of the metrics, where radii measure states that are unlike."""
        rows = [row for row in self.rows.values() if row.floor == "identity"] if self.cut is None else []
        judging = replace(self._judging(), epsilon=None, rho_a=None)
        for spec in otherwise(self.spec) if rows else ():
            self._say("trying another tube")
            own = [judged_row(row, self._question(read_back(spec, row.metric), judging)) for row in rows]
            best = min(
                (row for row in own if row.counts), key=lambda row: row.score("adaptation"), default=None
            )
            if best is not None:
                widths = dict(spec.tube.half_widths)
                return MeasureTube(
                    half_widths=widths, bandwidth=best.bandwidth, adaptation_rate=best.adaptation_rate
                )
        return None

    def _say(self, words: str) -> None:
        self._tell(Step(phase=Phase.SYNTHESIS, name=words))

    def _tell(self, step: Step) -> None:
        self.said += 1
        self.listeners(replace(step, count=self.said, unit=Unit.STEPS))
        if len(self.ladder.attempts) > self.noted:
            self.noted = len(self.ladder.attempts)
            self._keep()
