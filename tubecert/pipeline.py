"""Certification from a specification to a result: the rooms in their order.

In: a `Spec` and `Options`. Out: the `result` object of a certificate, for every verdict.
A claim that fails ends the work: what rests on it is not computed.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from tubecert.bounds.compute import Radius, bound_constants, least_radius, time_range
from tubecert.bounds.constants import DERIVED, BoundConstants, Constant, Witness
from tubecert.bounds.start import InitialState, KnownStart, StartWithin
from tubecert.bounds.suprema import Suprema
from tubecert.certificate.file import digest
from tubecert.certificate.reasons import defect_advice, reasons_26, reasons_distance, reasons_sampled
from tubecert.certificate.sections import (
    assumptions,
    ceiling_text,
    constant_data,
    decimal_data,
    declared_data,
    declared_metric,
    declared_uncertainty,
    floor_text,
    metric_data,
    pair_data,
    plan_data,
    witness_data,
)
from tubecert.conditions.kernels import Kernel
from tubecert.conditions.problem import Drift, Formulas, TubeProblem
from tubecert.conditions.rates import derived_constants
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import printable_above
from tubecert.enclosure.domain import Range
from tubecert.enclosure.interval import Interval, fraction_bounds, sqrt
from tubecert.errors import SpecError
from tubecert.findings import Finding, Severity
from tubecert.metric.geodesic import unique_geodesics
from tubecert.metric.verify import MetricProof, verify_metric
from tubecert.model import TIME, ControlAffineModel, build, domain_findings, place, rank_decision, time_period
from tubecert.search.distance import search_distance
from tubecert.search.elasticities import elasticities_26, elasticities_distance, halving
from tubecert.search.rates import search_26
from tubecert.search.results import recipe_json
from tubecert.search.sampled import search_sampled
from tubecert.spec import Spec, canonical
from tubecert.trajectory import Plan
from tubecert.trajectory.make import Room, plan_of, remedy
from tubecert.tube import Tube

Result = dict[str, Any]
_ORDER = ("refuted", "undecided", "certified")
_NOTABLE = 0.02  # share of the tube that a plan's defect may take before it is worth a word
CONDITIONS = {"26": "conditions_26", "distance": "distance", "sampled": "sampled"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line asks for beside the specification."""

    rho_a: Fraction | None = None
    epsilon: Fraction | None = None
    metric: Path | None = None
    conditions: str = "26"
    formulas: str = "corrected"
    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None
    gap: Fraction = Fraction(1, 100)
    budget: int = 2_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """Progress: what is being bounded, boxes so far, and the bounds so far.

    Where something is counted that is not boxes and has no bounds, `unit` says what.
    """

    name: str
    boxes: int
    below: float = -math.inf
    above: float = math.inf
    unit: str = "boxes"


Progress = Callable[[Step], None]


def inspect(spec: Spec, budget: int = 200_000) -> list[Finding]:
    """What is wrong with the mathematics of a specification, without certifying it."""
    findings, time = _time(spec)
    if findings:
        return findings
    effort = Effort(budget=budget)
    findings = domain_findings(spec, time, effort)
    if findings:
        return findings
    decision = rank_decision(build(spec), spec.safe_set, effort)
    if decision.verdict == "refuted":
        findings.append(
            Finding(
                code="TC203",
                message=f"B loses rank in the safe set, at {place(decision.at)}",
                location=spec.location("system.B"),
                help="shrink the safe set, or remove an input that does nothing there",
            )
        )
    return findings


def certify(spec: Spec, options: Options, progress: Progress | None = None) -> Result:
    """The result for a specification; raises `SpecError` for what makes the question meaningless."""
    spec = _overridden(spec, options)
    findings, time = _time(spec)
    findings += _complete(spec)
    if not findings:
        findings = domain_findings(spec, time, Effort(budget=options.budget))
    if any(item.severity is Severity.ERROR for item in findings):
        raise SpecError(findings)
    return _Certification(spec, options, time, progress).run()


class _Certification:
    """One run; `result` grows as the rooms answer."""

    def __init__(self, spec: Spec, options: Options, time: Range | None, progress: Progress | None) -> None:
        self.spec, self.options, self.time = spec, options, time
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
            "overrides": _overrides(options),
            "plan": {"kind": spec.trajectory.kind},
            "safe_set": {
                name: [decimal_data(low), decimal_data(high)]
                for name, (low, high) in zip(spec.states, spec.safe_set, strict=True)
            },
            "assumptions": assumptions(spec, self.model),
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
        word = (
            "loses rank in the safe set"
            if decision.verdict == "refuted"
            else "could not be proven of full rank"
        )
        return self._stop("rank of B", decision.verdict, f"B {word}", Witness(x=x))

    def _metric(self) -> bool:
        proof = verify_metric(self.model, self.spec.safe_set, self._effort("metric"))
        self.result["metric"] = metric_data(self.spec, proof)
        if proof.verdict != "certified":
            at = proof.at if proof.verdict == "refuted" else None
            return self._stop(
                f"metric, {proof.condition}", proof.verdict, proof.reason, at, self._relax_metric(proof)
            )
        self._lower = proof.lower_on_set
        return self._declared_metric(proof)

    def _plan(self) -> None:
        """The plan; what is planned here is refined until its defect costs next to nothing of the least tube."""
        report = None
        if self.progress is not None:
            show = self.progress

            def report(name: str, count: int, unit: str) -> None:
                show(Step(name=name, boxes=count, unit=unit))

        self.plan = plan_of(self.spec, self.model, self._room(), report)
        self.result["plan"] = plan_data(self.spec, self.plan)

    def _room(self) -> Room:
        """What a defect is measured against: the least tube that there can be."""
        tube = self.spec.tube
        assert tube.epsilon is not None
        assert tube.rho_a is not None
        assert self._lower is not None
        return Room(rho=tube.epsilon + tube.rho_a, lower=self._lower.below, effort=self.effort)

    def _relax_metric(self, proof: MetricProof) -> str:
        if proof.verdict == "undecided" and proof.condition != "C3":
            return "raise --budget, or lower metric.rate"
        if proof.largest_rate is None:
            return "give another dual metric"
        return f"lower metric.rate to {floor_text(proof.largest_rate.below)}, or give another dual metric"

    def _declared_metric(self, proof: MetricProof) -> bool:
        """The bounds a, A that a specification may declare must hold on the safe set."""
        metric = self.spec.metric
        assert metric is not None
        assert proof.lower_on_set is not None
        assert proof.upper_on_set is not None
        claim = "declared bounds of the metric"
        if metric.lower is not None and Fraction(proof.lower_on_set.below) < metric.lower:
            refuted = Fraction(proof.lower_on_set.above) < metric.lower
            return self._stop(
                claim,
                "refuted" if refuted else "undecided",
                f"metric.bounds.lower is {float(metric.lower):g}, but lmin(M) reaches {proof.lower_on_set.above:.8g}",
                proof.lower_on_set.at,
                f"declare lower: {floor_text(proof.lower_on_set.below)}",
            )
        if metric.upper is not None and Fraction(proof.upper_on_set.above) > metric.upper:
            refuted = Fraction(proof.upper_on_set.below) > metric.upper
            return self._stop(
                claim,
                "refuted" if refuted else "undecided",
                f"metric.bounds.upper is {float(metric.upper):g}, but lmax(M) reaches {proof.upper_on_set.below:.8g}",
                proof.upper_on_set.at,
                f"declare upper: {ceiling_text(proof.upper_on_set.above)}",
            )
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
        if contained.verdict == "certified":
            return radius
        radii = {"epsilon": tube.epsilon, "rho_a": tube.rho_a, "rho": radius.rho}
        self.result["tube"] = {name: decimal_data(value) for name, value in radii.items()}
        lies = "leaves" if contained.verdict == "refuted" else "could not be proven to stay in"
        self._stop(
            "assumption 1: the tube lies in the safe set",
            contained.verdict,
            f"the tube of radius {float(radius.rho):.6g} {lies} the safe set through the {contained.side} bound of "
            f"{contained.state}, at t = {contained.t:.6g}, by {contained.excess:.3g}"
            if contained.state
            else "the curve between the plan's knots could not be bounded: two of its times may nearly coincide",
            Witness(t=contained.t, x=contained.x),
            "reduce epsilon, rho_a or the initial error, or enlarge the safe set",
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
        if not (self._finite(constants) and self._declared_holds(suprema, declared)):
            return
        self._tube(suprema, radius)
        self._geodesics(suprema)
        self._search(self._problem(suprema, radius, constants))

    def _finite(self, constants: BoundConstants) -> bool:
        for name, value, meaning in constants.items():
            if not math.isfinite(value.above):
                return self._stop(
                    f"bound of {name}",
                    "undecided",
                    f"{meaning.words} ({meaning.symbol}) could not be bounded within the budget of boxes",
                    value.at,
                    "raise --budget, or shrink the safe set",
                )
        return True

    def _declared_holds(self, suprema: Suprema, declared: Mapping[str, Constant]) -> bool:
        """Declared bounds of h must cover the h that is given as expressions."""
        if not declared or self.model.h is None:
            return True
        for name, derived in zip(("h", "h_x", "h_t"), suprema.uncertainty(), strict=True):
            if name in declared and derived.above > declared[name].above:
                broken = derived.below > declared[name].above
                return self._stop(
                    f"declared bound of {name}",
                    "refuted" if broken else "undecided",
                    f"uncertainty.bounds.{name} is {declared[name].above:g}, but the expression reaches "
                    f"{derived.below:.8g} on the tube",
                    derived.at,
                    f"declare {name}: {ceiling_text(derived.above)}",
                )
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
        self.result["assumptions"] = assumptions(self.spec, self.model, test)

    def _search(self, problem: TubeProblem) -> None:
        """Gains of A, B and C; those conditions that were chosen decide the verdict."""
        asked = {"bandwidth": self.options.bandwidth, "adaptation_rate": self.options.adaptation_rate}
        rates = search_26(problem, **asked)
        distance = search_distance(problem, **asked)
        sampled = search_sampled(problem, bandwidth=self.options.bandwidth)
        if rates.pair is not None:
            for name, value in derived_constants(problem, rates.pair.recipe).items():
                self.result["constants"][name] = constant_data(value.printable(), DERIVED[name])
        slopes = {
            "conditions_26": elasticities_26(problem, rates),
            "distance": elasticities_distance(problem, distance),
        }
        explained = {
            "conditions_26": reasons_26(rates, halving(problem, slopes["conditions_26"], _least_26)),
            "distance": reasons_distance(distance, halving(problem, slopes["distance"], _least_distance)),
            "sampled": reasons_sampled(sampled),
        }
        self.result |= {
            "conditions_26": rates.to_dict(),
            "distance": distance.to_dict(),
            "sampled": sampled.to_dict(),
            "elasticities": slopes,
        }
        pairs = {"conditions_26": rates.pair, "distance": distance.decisive, "sampled": sampled.pair}
        self.result["proof"] = {
            name: recipe_json(pair.recipe)
            for name, pair in pairs.items()
            if pair is not None and self.result[name]["verdict"] == "certified"
        }
        every = self.options.conditions == "all"
        chosen = list(CONDITIONS.values()) if every else [CONDITIONS[self.options.conditions]]
        self.result["decided_by"] = chosen
        self.result["reasons"] += [reason for name in chosen for reason in explained[name]]
        verdicts = {self.result[name]["verdict"] for name in chosen}
        if self.options.formulas == Formulas.AS_PRINTED:
            verdicts.add("undecided")
            verdicts.discard("certified")
            if "conditions_26" not in chosen:
                self.result["reasons"] += explained["conditions_26"]
        self.result["verdict"] = next(word for word in _ORDER if word in verdicts)
        self._advise(problem)

    def _advise(self, problem: TubeProblem) -> None:
        """Where gains are missing and the plan's defect takes a part of the tube that matters, say so."""
        failed = [reason for reason in self.result["reasons"] if reason["verdict"] != "certified"]
        constants = problem.constants
        reach = float(problem.rate) * math.sqrt(constants.lower.below) * float(problem.rho)
        share = constants.plan_defect_metric.above / reach
        if not failed or share < _NOTABLE:
            return
        advice = defect_advice(constants.plan_defect, share, remedy(self.plan, self.model, self._room()))
        for reason in failed:
            reason["relax"] = "; ".join(filter(None, (reason.get("relax"), advice)))

    def _stop(
        self, claim: str, verdict: str, message: str, at: Witness | None = None, relax: str = ""
    ) -> bool:
        """Record a claim that is not proven, as the verdict."""
        reason: Result = {"claim": claim, "verdict": verdict, "message": message}
        if at is not None:
            reason["at"] = witness_data(at)
        if relax:
            reason["relax"] = relax
        self.result["reasons"].append(reason)
        self.result["verdict"] = verdict
        return False

    def _effort(self, name: str) -> Effort:
        if self.progress is None:
            return self.effort
        show = self.progress
        return replace(
            self.effort,
            progress=lambda boxes, below, above: show(Step(name=name, boxes=boxes, below=below, above=above)),
        )


def _least_26(problem: TubeProblem) -> Fraction | None:
    pair = search_26(problem).least_adaptation
    return None if pair is None else pair.recipe.adaptation_rate


def _least_distance(problem: TubeProblem) -> Fraction | None:
    pair = search_distance(problem).least_adaptation
    return None if pair is None else pair.recipe.adaptation_rate


def _overridden(spec: Spec, options: Options) -> Spec:
    tube = replace(
        spec.tube,
        epsilon=spec.tube.epsilon if options.epsilon is None else options.epsilon,
        rho_a=spec.tube.rho_a if options.rho_a is None else options.rho_a,
    )
    return replace(spec, tube=tube)


def _complete(spec: Spec) -> list[Finding]:
    """What a certification needs and a specification may lack."""
    missing = []
    if spec.metric is None:
        missing.append(("metric", "give metric.dual_metric and metric.rate, or --metric FILE"))
    if spec.tube.epsilon is None:
        missing.append(("tube.epsilon", "give tube.epsilon, or --epsilon E"))
    if spec.tube.rho_a is None:
        missing.append(("tube.rho_a", "give tube.rho_a, or --rho-a R"))
    return [
        Finding(code="TC105", message=f"{key} is needed to certify", location=spec.location(key), help=remedy)
        for key, remedy in missing
    ]


def _time(spec: Spec) -> tuple[list[Finding], Range | None]:
    """The range of time that matters for h, or why there is none."""
    h = spec.uncertainty.h
    period = time_period(term.expression for term in h or ())
    try:
        return [], time_range(spec.trajectory.horizon, period)
    except ValueError as error:
        finding = Finding(
            code="TC204",
            message=str(error),
            location=spec.location("uncertainty.h"),
            help="add trajectory.horizon, in seconds",
        )
        return [finding], None


def _overrides(options: Options) -> Result:
    given = {
        "rho_a": options.rho_a,
        "epsilon": options.epsilon,
        "bandwidth": options.bandwidth,
        "adaptation_rate": options.adaptation_rate,
    }
    result: Result = {name: decimal_data(value) for name, value in given.items() if value is not None}
    if options.metric is not None:
        result["metric"] = options.metric.name
    return result
