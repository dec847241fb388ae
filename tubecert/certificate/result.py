"""The certificate as values: every key of the JSON is a field, every id a type.

In: JSON of the format, or the values of a certification. Out: a `Certificate`, and JSON again, byte for byte. Reading
is strict: what is missing, not known, or of another kind is a `FormError` that says where. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

from tubecert.bounds.clearance import Shape
from tubecert.certificate.effective import Asked, Effective
from tubecert.certificate.notes import joined, split
from tubecert.claims.failures import Attempt
from tubecert.claims.family import Assumption, Reason
from tubecert.conditions.inputs import InputBound
from tubecert.conditions.theorem import Recipe
from tubecert.enclosure.constant import Constant, Witness
from tubecert.enclosure.interval import Interval
from tubecert.kinds.kind import Pair, SectionData
from tubecert.kinds.table import KINDS
from tubecert.records import FormError, Json, from_json, keyed, to_json
from tubecert.spec import Interpolation, Knots, PlanKind
from tubecert.spec.metric_file import FORMAT
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricRow:
    """One metric of a comparison; `input_gain` is beta/sqrt(a) over the tube.

    `bandwidth`, `adaptation_rate` and `demand` are of the kind that decides, else of B; `demand` is Gamma |B|^2, in
    1/s^2: where a tube has coordinates of its own they are of the metric, and Gamma alone compares nothing.
    """

    rate: Fraction
    floor: Literal["identity", "input"]
    degree: int
    condition_number: float
    verdict: Verdict | None = None
    input_gain: float | None = None
    rho: float | None = None
    ultimate_radius: float | None = None
    adaptation_rate: float | None = None
    bandwidth: float | None = None
    demand: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RateLimit:
    """What is against another rate, with `factor` times the demand there; `idle` is told of the rate chosen."""

    rate: Fraction
    cause: Literal["distance", "overshoot", "gains", "no_metric", "idle", "input_gain", "tube"]
    factor: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RateLimits:
    """What is against slower and against faster rates than the one that was chosen."""

    slower: RateLimit | None = None
    faster: RateLimit | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverData:
    """How a metric was found; `variables`: those that W depends on; `digits`: how many its entries have."""

    route: str
    degree: int
    variables: tuple[str, ...]
    digits: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchData:
    """What was tried by a synthesis, and why there is no metric where there is none.

    `objective`: what it was to be best in; `verdict`: whether one was found, or is excluded; `cut`: what ended it.
    """

    objective: str
    verdict: Verdict
    attempts: tuple[Attempt, ...]
    rate: Fraction | None = None
    table: tuple[MetricRow, ...] = ()
    limits: RateLimits | None = None
    cut: Literal["deadline", "interrupted", "no_adaptation", "plan"] | None = None
    solver: SolverData | None = None
    reason: Reason | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SynthesisData:
    """What was asked of a synthesis, and how it went; `asked`: what the metric has to be."""

    asked: Asked
    search: SearchData | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceData:
    """An obstacle of the specification, in its order: the clearance of the tube, and the time at which it is least.

    `verdict`: certified if the tube keeps away from it at all times, refuted if it contains a point of it; `decides`:
    whether the verdict of the certificate asks for it; `clearance`: by how much the tube keeps away at least, and what
    was found at a time; `t`: the time of that, in s; `inside`: a point of the obstacle that the tube contains then.
    """

    verdict: Verdict
    decides: bool
    clearance: Constant
    shape: Shape
    t: float | None = None
    inside: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanInputData:
    """What one input is on the plan; `least`: encloses inf u*; `greatest`: encloses sup u*."""

    least: Constant
    greatest: Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class InputData:
    """An input with limits: what it does on the plan, and in the loop of every kind that is certified, by its key.

    `input`: its name; `limits`: those of the specification; `verdict`: certified if the plan, and every loop whose kind
    decides, stays within them, refuted if the plan itself does not; `bounds`: what it is in each loop, by section.
    """

    input: str
    limits: tuple[Fraction, Fraction]
    verdict: Verdict
    plan: PlanInputData
    bounds: Mapping[str, InputBound]

    def use(self, kinds: Iterable[str]) -> float | None:
        """The share of its limits that it uses at most: 0 in the middle, 1 at a limit; None without bounds."""
        found = [self.bounds[key] for key in kinds if key in self.bounds]
        low, high = self.limits
        ends = [end for bound in found for end in (bound.least, bound.greatest)]
        return max((float(abs(2 * Fraction(end) - low - high) / (high - low)) for end in ends), default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """What the claim is about; `effective`: the specification after overrides, defaults written out, numbers exact,
    itself a specification; `effective_hash`: the hash of its canonical bytes; `file_hash`: the hash of the file's text.
    """

    effective: Effective
    effective_hash: str
    file_hash: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """The initial state that is claimed about, one of these; `at`: the point; `within`: the radius about the plan's
    start; `box`: the range of every state.
    """

    at: tuple[str, ...] | None = None
    within: str | None = None
    box: Mapping[str, tuple[str, str]] | None = None

    def __post_init__(self) -> None:
        if (self.at is None) + (self.within is None) + (self.box is None) != 2:
            raise ValueError("a start is either a point, a radius or a box")


@dataclass(frozen=True, slots=True, kw_only=True)
class Plans:
    """Every plan that is claimed about, in exact texts; `x`: the box of x*, [lower, upper] by state; `u`: the box of
    u*, by input; `defect`: what |x*' - f(x*) - B(x*) u*| is at most.
    """

    x: Mapping[str, tuple[str, str]]
    u: Mapping[str, tuple[str, str]]
    defect: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Blowing:
    """Every wind that is claimed about, in exact texts; `bound`: what |w| is at most; `rate`: what |w'| is at most."""

    bound: str
    rate: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Claimed:
    """What is claimed, in words of its own, exact texts; `recheck` derives it again from the specification.

    `id`: the state stays within the tube; `horizon`: until when, in s, or null for all t >= 0; `for_all_time`: why the
    claim is for all t >= 0: the plan rests or is any of a family, and h is free of t or periodic; `period`: the period
    of h, in s; `domain`: the safe set, [lower, upper] by state; `uncertainty`: the h of the specification, whatever
    obeys the declared bounds, or either; `parameters`: each constant, anywhere in [lower, upper].
    """

    id: Literal["tube"]
    horizon: str | None
    for_all_time: Literal["autonomous", "periodic"] | None
    period: str | None
    domain: Mapping[str, tuple[str, str]]
    start: Start
    uncertainty: Literal["bounds", "expression", "expression_or_bounds"]
    plans: Plans | None = None
    wind: Blowing | None = None
    parameters: Mapping[str, tuple[str, str]] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Overrides:
    """What the command line changed; `settings`: keys of the specification, with the texts of their values (--set);
    `conditions`: which certificate decides; `metric`: the name of the file of a metric.
    """

    rho_a: Fraction | None = None
    epsilon: Fraction | None = None
    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None
    conditions: str | None = None
    metric: str | None = None
    settings: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """What bounded the work; `gap`: the relative width at which a constant is sharp enough; `budget`: boxes per claim;
    `gaps`: the widths of constants that have one of their own, by name.
    """

    gap: Fraction
    budget: int
    gaps: Mapping[str, Fraction] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class KnotTexts:
    """Exact knots as texts; `t`: times (K,); `x`: states (K, n); `u`: inputs (K, m) or one row less.

    With hermite-simpson every second row is a point between two knots, of which u counts and x does not.
    """

    t: tuple[str, ...]
    x: tuple[tuple[str, ...], ...]
    u: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Points of the plan, to draw it; `t`: times (K,); `x`: states (K, n)."""

    t: tuple[float, ...]
    x: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanData:
    """The plan as it was certified: `exact` expressions, or knots with the rule that fills the gaps.

    `kind`: as specified; `interpolation`: what u* does between knots; `curve`: what x* does there: the cubic whose
    slopes at its ends are f(x*) + B(x*) u*; `file`: the plan file; `file_hash`: the hash of its bytes.
    """

    kind: PlanKind
    interpolation: Literal["exact", "hold", "linear", "hermite-simpson"] | None = None
    curve: Literal["hermite"] | None = None
    knots: KnotTexts | None = None
    samples: Samples | None = None
    file: str | None = None
    file_hash: str | None = None

    def exact_knots(self) -> Knots | None:
        """The knots as numbers; None for a plan of expressions."""
        if self.knots is None or self.interpolation is None or self.interpolation == "exact":
            return None
        interpolation: Interpolation = self.interpolation
        x, u = (tuple(tuple(map(Fraction, row)) for row in rows) for rows in (self.knots.x, self.knots.u))
        return Knots(t=tuple(map(Fraction, self.knots.t)), x=x, u=u, interpolation=interpolation)


@dataclass(frozen=True, slots=True, kw_only=True)
class Geodesics:
    """The test for unique geodesics; `value`: encloses G rho + L_G rho^2/8; `holds`: this is below 1."""

    value: Constant
    holds: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricData:
    """The metric, what C1-C3 on the safe set tell of it, and its bounds over the tube.

    `dual_metric`: W(x), by rows; `verdict`: whether C1-C3 hold on the safe set; `margin`: the extra rate, in 1/s, that
    C2 supports; `largest_rate`: the largest that C2 supports, in 1/s; `lower` and `upper`: eigenvalues of M over the
    tube, of S^-T M S^-1 with its coordinates S; `lower_on_set` and `upper_on_set`: eigenvalues of M on the safe set.
    """

    rate: Fraction
    dual_metric: tuple[tuple[str, ...], ...]
    verdict: Verdict
    margin: Constant | None = None
    largest_rate: Constant | None = None
    lower_on_set: Constant | None = None
    upper_on_set: Constant | None = None
    lower: Constant | None = None
    upper: Constant | None = None
    unique_geodesics: Geodesics | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeData:
    """The radii, and the half-widths once the tube is proven to lie in the safe set.

    `rho_r`: the radius rho - rho_a; `half_widths`: bounds of |x_i - x_i*|, and of |c'(x - x*)| for outputs;
    `coordinates`: S by rows, exact: radii are lengths in z = S x, and the tube is |S (x - x*)| <= rho cut to the
    half-widths.
    """

    epsilon: Fraction
    rho_a: Fraction
    rho: Fraction
    rho_r: Fraction | None = None
    half_widths: Mapping[str, float] | None = None
    coordinates: tuple[tuple[str, ...], ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """A constant over the tube; `below`: proven below; `above`: proven above, null where no bound was found; `symbol`:
    how it is written; `equation`: where it is defined; `unit`: its unit, in those of states x, inputs u, distance d.
    """

    below: float | None
    above: float | None
    symbol: str = ""
    equation: str = ""
    unit: str = ""
    at: Witness | None = None


def _sections() -> dict[str, type[SectionData]]:
    return {kind.key: kind.form for kind in KINDS}


def _recipes() -> dict[str, type[Recipe]]:
    return {kind.key: kind.theorem.recipe for kind in KINDS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipes:
    """What proves the gains of each kind that is certified, by the name of its section."""

    of: Mapping[str, Recipe] = field(default_factory=dict, metadata=keyed(_recipes))


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What was found: a pure function of the specification and the options; what of it claims nothing is in `notes`.

    What was not reached is None or empty. `verdict`: only certified says that the tube holds; `decided_by`: the kinds
    that decide the verdict; `reasons`: why the verdict is what it is; `safe_set`: [lower, upper] by state;
    `assumptions`: all that is assumed and not proven; `declared`: bounds of h that are believed, not proven;
    `elasticities`: per cent of Gamma per per cent of a constant, by section.
    """

    verdict: Verdict
    spec: Source
    claim: Claimed
    overrides: Overrides
    plan: PlanData
    safe_set: Mapping[str, tuple[Fraction, Fraction]]
    assumptions: tuple[Assumption, ...]
    declared: Mapping[str, float]
    reasons: tuple[Reason, ...]
    proof: Recipes
    effort: Work | None = None
    synthesis: SynthesisData | None = None
    metric: MetricData | None = None
    tube: TubeData | None = None
    clearance: tuple[ClearanceData, ...] = ()
    inputs: tuple[InputData, ...] = ()
    constants: Mapping[str, Bound] = field(default_factory=dict)
    sections: Mapping[str, SectionData] = field(default_factory=dict, metadata=keyed(_sections))
    elasticities: Mapping[str, Mapping[str, float]] | None = None
    decided_by: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        system = self.spec.effective.system
        widths = None if self.tube is None else self.tube.half_widths
        if self.safe_set is not None and set(self.safe_set) != set(system.states):
            raise ValueError("safe_set is not about the states of the specification")
        if widths is not None and set(widths) != set(system.lengths):
            raise ValueError("tube.half_widths is not about the states of the specification")
        if not set(self.decided_by) <= set(self.sections):
            raise ValueError("decided_by names a section that is not there")

    @property
    def asked(self) -> bool:
        """Whether the command asked for gains."""
        return self.overrides.bandwidth is not None

    @property
    def reason(self) -> Reason | None:
        """The reason that decided: the first with the verdict's own word, else the first."""
        own = [reason for reason in self.reasons if reason.verdict is self.verdict]
        return next(iter([*own, *self.reasons]), None)

    @property
    def failed(self) -> list[Reason]:
        """What is not proven."""
        return [reason for reason in self.reasons if reason.verdict is not Verdict.CERTIFIED]

    def deciding(self) -> Mapping[str, Pair]:
        """The gains that the verdict is about, by section."""
        found = {
            key: self.sections[key].decisive(asked=self.asked)
            for key in self.decided_by
            if key in self.sections
        }
        return {key: pair for key, pair in found.items() if pair is not None}

    def to_json(self) -> Json:
        """What `result` and `notes` hold, as one."""
        return to_json(self)

    @classmethod
    def from_json(cls, data: Json) -> Result:
        """What `result` says, with or without its notes; raises `FormError`."""
        return from_json(cls, data, "result")


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """How it was made; `command`: its line; `started`: when; `seconds`: how long; `versions`: of what it rests on."""

    command: str | None = None
    started: str | None = None
    seconds: float | None = None
    versions: Mapping[str, str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """A sealed result: `hash` is that of its canonical bytes, without its notes."""

    format: str
    hash: str
    result: Result
    run: Run

    @classmethod
    def from_json(cls, data: Json) -> Certificate:
        """What a file says; raises `FormError`. The hash is not compared."""
        match data:
            case {"notes": notes, "result": result, **rest}:
                return from_json(cls, {**rest, "result": joined(result, notes)}, "certificate")
            case {"result": _}:
                raise FormError("certificate.notes", "is missing")
        return from_json(cls, data, "certificate")

    def to_json(self) -> dict[str, object]:
        """What the file says."""
        result, notes = split(self.result.to_json())
        return {
            "format": self.format,
            "hash": self.hash,
            "result": result,
            "notes": notes,
            "run": to_json(self.run),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricFile:
    """W and its rate in 1/s; on `verified_on`, `lower` I <= M <= `upper` I and C2 has `margin` in 1/s to spare;
    `condition_number`: upper/lower.
    """

    format: str
    rate: Fraction
    dual_metric: tuple[tuple[str, ...], ...]
    verified_on: Mapping[str, tuple[Fraction, Fraction]]
    lower: Constant
    upper: Constant
    condition_number: Constant
    solver: SolverData
    margin: Constant | None = None

    def to_json(self) -> Json:
        """What the file holds."""
        return to_json(self)


def metric_file(
    safe_set: Mapping[str, tuple[Fraction, Fraction]], metric: MetricData, solver: SolverData
) -> MetricFile:
    """The metric file of a metric that is proven on a safe set; raises `ValueError` if it is not."""
    lower, upper = metric.lower_on_set, metric.upper_on_set
    if lower is None or upper is None:
        raise ValueError("a proven metric has bounds")
    ratio = Interval(upper.below, upper.above) / Interval(lower.below, lower.above)
    return MetricFile(
        format=FORMAT,
        rate=metric.rate,
        dual_metric=metric.dual_metric,
        verified_on=safe_set,
        lower=lower,
        upper=upper,
        condition_number=Constant(below=float(ratio.lo), above=float(ratio.hi)).printable(),
        solver=solver,
        margin=metric.margin,
    )
