"""One certification: its claims in their order. A claim that fails ends it: what rests on it is not computed."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from tubecert.bounds.compute import Radius, bound_constants, least_radius
from tubecert.bounds.constants import BoundConstants, Constant, Witness
from tubecert.bounds.start import InitialState, KnownStart, StartWithin
from tubecert.bounds.suprema import Suprema
from tubecert.certificate.file import digest
from tubecert.certificate.sections import (
    assumptions,
    claim_data,
    constant_data,
    decimal_data,
    declared_data,
    declared_metric,
    declared_uncertainty,
    metric_data,
    pair_data,
    plan_data,
    safe_set_data,
)
from tubecert.claims import (
    Claim,
    ConstantBounded,
    DeclareMetricBound,
    DeclareUncertaintyBound,
    EnlargeSafeSet,
    LowerRate,
    MendPlan,
    MetricBound,
    MetricContraction,
    MetricKilling,
    OtherMetric,
    PlanBounded,
    RaiseBudget,
    RankOfB,
    Reason,
    ReduceInitialError,
    ReduceRadii,
    Relax,
    Side,
    TubeInSafeSet,
    TubeRadius,
    UncertaintyBound,
)
from tubecert.conditions.kernels import Kernel
from tubecert.conditions.problem import Drift, Formulas, TubeProblem
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import printable_above
from tubecert.enclosure.domain import Range
from tubecert.enclosure.interval import Interval, fraction_bounds, sqrt
from tubecert.kinds.table import needed_by_all
from tubecert.metric.geodesic import unique_geodesics
from tubecert.metric.verify import MetricProof, verify_metric
from tubecert.model import TIME, ControlAffineModel, build, rank_decision
from tubecert.pipeline.checks import period_of
from tubecert.pipeline.gains import gains
from tubecert.pipeline.options import Options, Progress, Step, overrides_data
from tubecert.pipeline.reasons import UNBOUNDED_RELAX
from tubecert.pipeline.synthesised import Synthesised
from tubecert.planner.propose import course_of, knots_of
from tubecert.records import to_json
from tubecert.spec import Spec, canonical
from tubecert.trajectory import Plan
from tubecert.trajectory.make import Room, plan_of, remedy
from tubecert.tube import Tube
from tubecert.verdict import Verdict

Result = dict[str, Any]
_NOTABLE = 0.02  # share of the tube that a plan's defect may take before it is worth a word


class Certification:
    """One run; `result` grows as the rooms answer."""

    def __init__(
        self,
        spec: Spec,
        options: Options,
        time: Range | None,
        progress: Progress | None,
        found: Synthesised | None = None,
    ) -> None:
        self.spec, self.options, self.time, self.found = spec, options, time, found
        self.model: ControlAffineModel = build(spec)
        self.plan: Plan
        within = spec.within
        self.start: InitialState = KnownStart(spec.x0) if within is None else StartWithin(within)
        self.progress = progress
        self.effort = Effort(gap=float(options.gap), budget=options.budget)
        text = canonical(spec)
        self.result: Result = {
            "formulas": options.formulas,
            "spec": {
                "effective": text,
                "effective_hash": digest(text),
                "file_hash": "sha256:" + hashlib.sha256(spec.source.encode()).hexdigest(),
            },
            "claim": claim_data(spec, period_of(spec)),
            "overrides": overrides_data(options),
            "effort": {"gap": decimal_data(options.gap), "budget": options.budget},
            "plan": {"kind": spec.trajectory.kind},
            "safe_set": safe_set_data(spec),
            "assumptions": to_json(assumptions(spec, self.model)),
            "declared": declared_data(spec),
            "reasons": [],
            "proof": {},
        }

    def run(self) -> Result:
        """Every claim in its order; the first that fails decides."""
        if self._rank() and self._metric():
            self._plan()
            radius = self._radius()
            if radius is not None:
                self._conditions(radius)
        return self.result

    # -- claims ------------------------------------------------------------------------------------------------

    def _rank(self) -> bool:
        decision = rank_decision(self.model, self.spec.safe_set, self.effort)
        if decision.verdict == "proven":
            return True
        x = tuple(decision.at.get(name, 0.0) for name in self.model.states)
        return self._stop(RankOfB(), decision.verdict, Witness(x=x))

    def _metric(self) -> bool:
        if self.found is not None:
            self.result["synthesis"] = self.found.data()
        if self.spec.metric is None:
            assert self.found is not None
            assert self.found.reason is not None
            return self._give_up(self.found.reason)
        proof = verify_metric(self.model, self.spec.safe_set, self._effort("metric"))
        self.result["metric"] = metric_data(self.spec, proof)
        if proof.failed is not None:
            at = proof.at if proof.verdict == "refuted" else None
            return self._stop(proof.failed, proof.verdict, at, self._relax_metric(proof))
        self._lower = proof.lower_on_set
        return self._declared_metric(proof)

    def _plan(self) -> None:
        """The plan; what is planned here is refined until its defect costs next to nothing of the least tube."""
        report = None
        if self.progress is not None:
            show = self.progress

            def report(name: str, count: int, unit: str) -> None:
                show(Step(name=name, boxes=count, unit=unit))

        task, proposed = self.spec.trajectory.task, None
        if task is not None:
            course = course_of(self.spec, task, self.model, report)
            proposed = knots_of(self.spec, course, self.model, self._room(), report)
        self.plan = plan_of(self.spec, self.model, proposed)
        self.result["plan"] = plan_data(self.spec, self.plan)

    def _room(self) -> Room:
        """What a defect is measured against: the least tube that there can be."""
        tube = self.spec.tube
        assert tube.epsilon is not None
        assert tube.rho_a is not None
        assert self._lower is not None
        return Room(rho=tube.epsilon + tube.rho_a, lower=self._lower.below, effort=self.effort)

    def _relax_metric(self, proof: MetricProof) -> tuple[Relax, ...]:
        if proof.verdict == "undecided" and not isinstance(proof.failed, MetricKilling):
            return (RaiseBudget(), LowerRate())
        if proof.largest_rate is None or not isinstance(proof.failed, MetricContraction):
            return (OtherMetric(),)
        return (LowerRate(to=proof.largest_rate.below), OtherMetric())

    def _declared_metric(self, proof: MetricProof) -> bool:
        """The bounds a, A that a specification may declare must hold on the safe set."""
        metric = self.spec.metric
        assert metric is not None
        assert proof.lower_on_set is not None
        assert proof.upper_on_set is not None
        least, most = proof.lower_on_set, proof.upper_on_set
        if metric.lower is not None and Fraction(least.below) < metric.lower:
            claim = MetricBound(side="lower", declared=metric.lower, reaches=_finite(least.above))
            relax = DeclareMetricBound(side="lower", value=_finite(least.below))
            refuted = Fraction(least.above) < metric.lower
            return self._stop(claim, "refuted" if refuted else "undecided", least.at, (relax,))
        if metric.upper is not None and Fraction(most.above) > metric.upper:
            claim = MetricBound(side="upper", declared=metric.upper, reaches=_finite(most.below))
            relax = DeclareMetricBound(side="upper", value=_finite(most.above))
            refuted = Fraction(most.below) > metric.upper
            return self._stop(claim, "refuted" if refuted else "undecided", most.at, (relax,))
        return True

    def _suprema(self) -> Suprema:
        report = None
        if self.progress is not None:
            show = self.progress

            def report(name: str, boxes: int, below: float, above: float) -> None:
                show(Step(name=name, boxes=boxes, below=below, above=above))

        return Suprema(self.model, self.plan, 0.0, self.time, self.effort, report)

    def _radius(self) -> Radius | None:
        tube = self.spec.tube
        assert tube.epsilon is not None
        assert tube.rho_a is not None
        suprema = self._suprema()
        declared = declared_metric(self.spec)
        width = tube.epsilon + tube.rho_a
        radius = least_radius(suprema, self.spec.safe_set, self.start.offset(suprema), width, declared)
        contained = radius.contained
        if radius.obstacle is not None:
            claim = TubeRadius(obstacle=radius.obstacle, radius=radius.rho)
            relax = (ReduceInitialError(), DeclareMetricBound(), RaiseBudget())
            self._stop(claim, "undecided", relax=relax)
            return None
        if contained.verdict == "certified":
            return radius
        radii = {"epsilon": tube.epsilon, "rho_a": tube.rho_a, "rho": radius.rho}
        self.result["tube"] = {name: decimal_data(value) for name, value in radii.items()}
        self._stop(
            _containment(radius),
            contained.verdict,
            Witness(t=contained.t, x=contained.x),
            (ReduceRadii(), EnlargeSafeSet()),
        )
        return None

    def _conditions(self, radius: Radius) -> None:
        assert radius.lower is not None
        assert radius.upper is not None
        suprema = self._suprema().with_radius(radius.rho)
        declared = declared_uncertainty(self.spec)
        constants = bound_constants(suprema, self.start, (radius.lower, radius.upper), declared)
        self.result["metric"] |= {"lower": pair_data(constants.lower), "upper": pair_data(constants.upper)}
        self.result["constants"] = {
            name: constant_data(value, meaning) for name, value, meaning in constants.items()
        }
        problem = self._problem(suprema, radius, constants)
        if not (self._finite(problem) and self._declared_holds(suprema, declared)):
            return
        self._tube(suprema, radius)
        self._geodesics(suprema)
        self._search(problem)

    def _finite(self, problem: TubeProblem) -> bool:
        """Whether what every certificate needs is bounded; what only some of them need is for those to say."""
        needed = needed_by_all(problem)
        for name, value, _ in problem.constants.items():
            if name in needed and not math.isfinite(value.above):
                return self._stop(ConstantBounded(constant=name), "undecided", value.at, UNBOUNDED_RELAX)
        return True

    def _declared_holds(self, suprema: Suprema, declared: Mapping[str, Constant]) -> bool:
        """Declared bounds of h must cover the h that is given as expressions."""
        if not declared or self.model.h is None:
            return True
        for name, derived in zip(("h", "h_x", "h_t"), suprema.uncertainty(), strict=True):
            if name in declared and derived.above > declared[name].above:
                broken = derived.below > declared[name].above
                claim = UncertaintyBound(
                    constant=name, declared=declared[name].above, reaches=_finite(derived.below)
                )
                relax = DeclareUncertaintyBound(constant=name, value=_finite(derived.above))
                return self._stop(claim, "refuted" if broken else "undecided", derived.at, (relax,))
        return True

    def _problem(self, suprema: Suprema, radius: Radius, constants: BoundConstants) -> TubeProblem:
        tube, adaptation = self.spec.tube, self.spec.adaptation
        assert tube.epsilon is not None
        assert tube.rho_a is not None
        rho = radius.rho
        printed = self.options.formulas == "as-printed"
        return TubeProblem(
            constants=constants,
            rate=self.model.rate,
            epsilon=tube.epsilon,
            rho_a=tube.rho_a,
            rho_r=rho - tube.rho_a,
            rho=rho,
            initial_offset=self.start.offset(suprema),
            horizon=self.spec.trajectory.horizon,
            states=len(self.spec.states),
            A_m=None if adaptation.A_m == "auto" else adaptation.A_m,
            smooth=adaptation.smooth,
            formulas=Formulas(self.options.formulas),
            kernel=None if self.spec.kernel is None else Kernel(self.spec.kernel),
            drift=Drift.SUM if printed else Drift.PLAN,
        )

    # -- result ------------------------------------------------------------------------------------------------

    def _tube(self, suprema: Suprema, radius: Radius) -> None:
        """The radii, and half-widths per state: |x_i - x_i*| <= sqrt(W_ii) d with d < dbar = sqrt(a) rho."""
        tube = self.spec.tube
        assert tube.rho_a is not None
        assert radius.lower is not None
        rho = radius.rho
        reach = sqrt(Interval(radius.lower.below)) * Interval.of(radius.rho)  # certified: d < dbar
        widths = {
            name: printable_above(min(float((Interval(width.above) * reach).hi), fraction_bounds(rho)[1]))
            for name, width in zip(self.spec.states, suprema.half_widths(), strict=True)
        }
        self.result["tube"] = {
            "epsilon": decimal_data(tube.epsilon),
            "rho_a": decimal_data(tube.rho_a),
            "rho_r": decimal_data(rho - tube.rho_a),
            "rho": decimal_data(radius.rho),
            "half_widths": widths,
        }

    def _geodesics(self, suprema: Suprema) -> None:
        """Whether minimising geodesics are proven unique; if not, that stays an assumption."""
        tube = Tube(
            self.plan,
            suprema.rho,
            states=self.model.states,
            inputs=self.model.inputs,
            time=self.plan.time.get(TIME),
        )
        test = unique_geodesics(self.model, tube, suprema.rho, self._effort("geodesics"))
        self.result["metric"]["unique_geodesics"] = {
            "value": pair_data(test.value.printable()),
            "holds": test.holds,
        }
        self.result["assumptions"] = to_json(assumptions(self.spec, self.model, test))

    def _search(self, problem: TubeProblem) -> None:
        """Gains of A, B and C, and the verdict."""
        found = gains(problem, self.options)
        self.result["constants"] |= found.pop("constants")
        reasons = self._advised(problem, found.pop("reasons"))
        self.result["reasons"] += to_json(reasons)
        self.result |= found

    def _advised(self, problem: TubeProblem, reasons: list[Reason]) -> list[Reason]:
        """Where gains are missing and the plan's defect takes a part of the tube that matters, that is said too."""
        certified = all(reason.verdict is Verdict.CERTIFIED for reason in reasons)
        constants, defect = problem.constants, problem.constants.plan_defect
        reach = float(problem.rate) * math.sqrt(constants.lower.below) * float(problem.rho)
        share = constants.plan_defect_metric.above / reach
        if certified or share < _NOTABLE:
            return reasons
        mend = MendPlan(
            defect=defect.above,
            t=None if defect.at is None else defect.at.t,
            share=share,
            remedy=remedy(self.plan, self.model, self._room()),
        )
        return [
            reason if reason.verdict is Verdict.CERTIFIED else replace(reason, relax=(*reason.relax, mend))
            for reason in reasons
        ]

    def _stop(
        self, claim: Claim, verdict: str, at: Witness | None = None, relax: tuple[Relax, ...] = ()
    ) -> bool:
        """Record a claim that is not proven, as the verdict."""
        return self._give_up(Reason(claim=claim, verdict=Verdict(verdict), at=at, relax=relax))

    def _give_up(self, reason: Reason) -> bool:
        self.result["reasons"].append(to_json(reason))
        self.result["verdict"] = str(reason.verdict)
        return False

    def _effort(self, name: str) -> Effort:
        if self.progress is None:
            return self.effort
        show = self.progress
        return replace(
            self.effort,
            progress=lambda boxes, below, above: show(Step(name=name, boxes=boxes, below=below, above=above)),
        )


def _containment(radius: Radius) -> Claim:
    """What is claimed of a tube that is not proven to lie in the safe set."""
    contained = radius.contained
    if not contained.state:
        return PlanBounded()
    side: Side = "upper" if contained.side == "upper" else "lower"
    return TubeInSafeSet(radius=radius.rho, state=contained.state, side=side, excess=contained.excess)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
