"""The certificate, read into closed types: every object with the keys that it must have and may have, and no others.

A key that is missing, unknown or of another kind is an error (TC603). Numbers are exact: the decimals that are written.
Members that claim nothing are read all the same (`orientation`), so that nothing unknown can stand beside what is
verified.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Members, Node, digest
from tubecert.recheck.orientation import around, elasticities, run, samples, synthesis
from tubecert.recheck.reasons import (
    VERDICTS,
    Assumption,
    Enclosure,
    Reason,
    enclosure,
    read_assumption,
    read_reason,
)
from tubecert.recheck.specification import (
    Numbers,
    Range,
    Resting,
    Rows,
    Specification,
    Tabled,
    Wanted,
    read_specification,
)

MEASURED = (
    "lower",
    "upper",
    "f",
    "f_x",
    "B",
    "B_x",
    "b_x",
    "B_pinv",
    "B_pinv_x",
    "M_x",
    "u_star",
    "h",
    "h_x",
    "h_t",
    "h_initial",
    "feedback_gain",
    "metric_input_gain",
    "drift_on_plan",
    "initial_distance",
    "plan_defect",
    "plan_defect_metric",
    "input_gain_least",
    "contraction_excess",
)
DERIVED = (
    "speed",
    "uncertainty_rate",
    "prediction_error",
    "filter_error",
    "theta",
    "Psi_x",
    "geodesic_rate",
    "Psi_rate",
    "zeta_1",
    "zeta_2",
    "zeta_3",
)
INFIMA = ("lower", "input_gain_least")  # constants whose lower side is used
CLAIMS_26 = ("26a", "26b", "26c")


@dataclass(frozen=True, slots=True)
class Claim:
    """What the certificate says that it claims, in its own words."""

    id: str
    horizon: Fraction | None
    for_all_time: str | None
    period: str | None
    domain: dict[str, Range]
    start: tuple[Numbers | None, Fraction | None]  # x(0), or how far from x*(0) it may be
    uncertainty: str


@dataclass(frozen=True, slots=True)
class Overrides:
    """What the command line replaced in the specification; gains that were asked for."""

    epsilon: Fraction | None
    rho_a: Fraction | None
    bandwidth: Fraction | None
    adaptation_rate: Fraction | None
    metric: str | None


@dataclass(frozen=True, slots=True)
class Knots:
    """Exact knots of a plan, row by row."""

    t: Numbers
    x: Rows
    u: Rows


@dataclass(frozen=True, slots=True)
class Plan:
    """The plan as it was certified: `interpolation` is None where a certification ended before there was one."""

    kind: str
    interpolation: str | None
    curve: str | None
    knots: Knots | None
    samples: tuple[Numbers, Rows] | None
    file: str | None
    file_hash: str | None


@dataclass(frozen=True, slots=True)
class Geodesics:
    """The test for their uniqueness."""

    value: Enclosure
    holds: bool


@dataclass(frozen=True, slots=True)
class MetricSection:
    """What is claimed of the metric; None where a certification ended before."""

    rate: Fraction
    dual_metric: tuple[tuple[str, ...], ...]
    verdict: str
    margin: Enclosure | None
    largest_rate: Enclosure | None
    lower_on_set: Enclosure | None
    upper_on_set: Enclosure | None
    lower: Enclosure | None
    upper: Enclosure | None
    geodesics: Geodesics | None


@dataclass(frozen=True, slots=True)
class TubeSection:
    """Radii and half-widths; a tube that leaves the set has no half-widths."""

    epsilon: Fraction
    rho_a: Fraction
    rho: Fraction
    rho_r: Fraction | None
    half_widths: dict[str, Fraction] | None


@dataclass(frozen=True, slots=True)
class Pair:
    """Gains of A and B: omega, Gamma, the g of A_m = -g I (None: the matrix of the specification), R_H."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction | None
    projection_radius: Fraction


@dataclass(frozen=True, slots=True)
class RatePair:
    """A pair of A with its margins."""

    gains: Pair
    margins: dict[str, Enclosure]


@dataclass(frozen=True, slots=True)
class DistancePair:
    """A pair of B with its margin."""

    gains: Pair
    margin: Enclosure
    ultimate_radius: Fraction | None


@dataclass(frozen=True, slots=True)
class Point:
    """A point of a curve of gains."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction | None


@dataclass(frozen=True, slots=True)
class Around:
    """Proven margins along the bandwidth, by claim; None where nothing is proven."""

    bandwidths: Numbers
    adaptation_rate: Fraction
    predictor_gain: Fraction | None
    margins: dict[str, tuple[Fraction | None, ...]]


@dataclass(frozen=True, slots=True)
class Shortfall:
    """A condition that is not proven, with its margin."""

    condition: str
    margin: Enclosure


@dataclass(frozen=True, slots=True)
class Predictor:
    """A_m, P and Q as printed."""

    A_m: Rows
    P: Rows
    Q: Rows


@dataclass(frozen=True, slots=True)
class RateSection:
    """Certificate A."""

    verdict: str
    pair: RatePair | None
    predictor: Predictor | None
    ultimate_radius: Fraction | None
    least_adaptation: RatePair | None
    curve: tuple[Point, ...]
    around: Around | None
    binds: str | None
    below_twice_rate: bool
    shortfalls: tuple[Shortfall, ...]


@dataclass(frozen=True, slots=True)
class DistanceSection:
    """Certificate B."""

    verdict: str
    split: DistancePair | None
    least_adaptation: DistancePair | None
    asked: DistancePair | None
    ultimate_radius: Fraction | None
    curve: tuple[Point, ...]
    around: Around | None
    shortfalls: tuple[Shortfall, ...]

    @property
    def pairs(self) -> dict[str, DistancePair]:
        """By name, the one that the verdict is about first."""
        named = {"asked": self.asked, "least_adaptation": self.least_adaptation, "split": self.split}
        return {name: pair for name, pair in named.items() if pair is not None}


@dataclass(frozen=True, slots=True)
class SampledPair:
    """Gains of C: Ts, omega, g, R_H."""

    sample_time: Fraction
    bandwidth: Fraction
    predictor_gain: Fraction
    projection_radius: Fraction


@dataclass(frozen=True, slots=True)
class SampledSection:
    """Certificate C; a curve is of (omega, Ts)."""

    verdict: str
    pair: SampledPair | None
    margin: Enclosure | None
    ultimate_radius: Fraction | None
    curve: tuple[tuple[Fraction, Fraction], ...]
    shortfalls: tuple[Shortfall, ...]


@dataclass(frozen=True, slots=True)
class DistanceRecipe:
    """Y, e and S of theorem B at its gains."""

    gains: Pair
    speed: Fraction
    prediction_error: Fraction
    uncertainty: Fraction


@dataclass(frozen=True, slots=True)
class SampledRecipe:
    """Y of theorem C at its gains."""

    gains: SampledPair
    speed: Fraction


@dataclass(frozen=True, slots=True)
class Recipes:
    """`result.proof`, section by section."""

    rates: Pair | None
    distance: DistanceRecipe | None
    sampled: SampledRecipe | None


@dataclass(frozen=True, slots=True)
class Sections:
    """A, B and C, with those that decide."""

    rates: RateSection
    distance: DistanceSection
    sampled: SampledSection
    decided_by: tuple[str, ...]

    @property
    def by_name(self) -> dict[str, RateSection | DistanceSection | SampledSection]:
        """Each by its key."""
        return {"conditions_26": self.rates, "distance": self.distance, "sampled": self.sampled}


@dataclass(frozen=True, slots=True)
class Result:
    """What was proven: for a verdict other than `certified` as far as the certification came."""

    verdict: str
    formulas: str
    specification: Specification
    effective_hash: str
    claim: Claim
    overrides: Overrides
    plan: Plan
    safe_set: dict[str, Range]
    assumptions: tuple[Assumption, ...]
    declared: dict[str, Fraction]
    reasons: tuple[Reason, ...]
    recipes: Recipes
    synthesised: Wanted | None
    metric: MetricSection | None
    tube: TubeSection | None
    constants: dict[str, Enclosure] | None
    sections: Sections | None


@dataclass(frozen=True, slots=True)
class Certificate:
    """A certificate: its result, the hash that it states, and the hash that the result has."""

    result: Result
    stated_hash: str
    hash: str


def read_certificate(document: Node) -> Certificate:
    """The certificate in a document; raises `CertificateError` for whatever is not of its form."""
    own = document.closed("format", "hash", "result", "run")
    run(own["run"])
    return Certificate(read_result(own["result"]), own["hash"].text(), digest(own["result"].value))


def read_result(node: Node) -> Result:
    """`result`; one that says `certified` must have every section."""
    last = ("constants", "tube", "conditions_26", "distance", "sampled", "decided_by", "elasticities")
    own = node.closed(
        "verdict",
        "formulas",
        "spec",
        "claim",
        "overrides",
        "effort",
        "plan",
        "safe_set",
        "assumptions",
        "declared",
        "reasons",
        "proof",
        optional=("synthesis", "metric", *last),
    )
    verdict = own["verdict"].word(*VERDICTS)
    spec = own["spec"].closed("effective", "effective_hash", "file_hash")
    spec["file_hash"].text()
    effort = own["effort"].closed("gap", "budget")
    effort["gap"].decimal()
    effort["budget"].count()
    specification = read_specification(spec["effective"])
    states = specification.plant.states
    searched = any(key in own for key in last[2:])
    if verdict == "certified" or searched:  # the search comes last: everything else must be there
        own.require("metric", *last)
    result = Result(
        verdict=verdict,
        formulas=own["formulas"].word("corrected", "as-printed"),
        specification=specification,
        effective_hash=spec["effective_hash"].text(),
        claim=_claim(own["claim"], states),
        overrides=_overrides(own["overrides"]),
        plan=_plan(own["plan"], specification),
        safe_set=_box(own["safe_set"], states, Node.decimal),
        assumptions=tuple(map(read_assumption, own["assumptions"].entries())),
        declared=_declared(own["declared"]),
        reasons=tuple(read_reason(item, len(states)) for item in own["reasons"].entries()),
        recipes=_recipes(own["proof"]),
        synthesised=own.get("synthesis", lambda item: synthesis(item, len(states))),
        metric=own.get("metric", lambda item: _metric(item, len(states))),
        tube=own.get("tube", lambda item: _tube(item, states)),
        constants=own.get("constants", lambda item: _constants(item, own)),
        sections=_sections(own, len(states)) if searched else None,
    )
    return _complete(node, result) if verdict == "certified" else result


def _complete(node: Node, result: Result) -> Result:
    """A result that says `certified` states all that this rests on."""
    metric, tube, plan = result.metric, result.tube, result.plan
    assert metric is not None
    assert tube is not None
    parts: list[object] = [metric.lower_on_set, metric.upper_on_set, metric.lower, metric.upper]
    parts.append(metric.geodesics)
    if len(result.specification.plant.inputs) < len(result.specification.plant.states):
        parts += [metric.margin, metric.largest_rate]  # C2 says something
    if any(part is None for part in parts):
        raise node.refused("is certified and lacks a part of `metric`")
    if tube.rho_r is None or tube.half_widths is None:
        raise node.refused("is certified and lacks a part of `tube`")
    if plan.interpolation is None:
        raise node.refused("is certified and lacks a part of `plan`")
    if isinstance(result.specification.metric, Wanted):
        raise node.refused("is certified for a metric that is not in the specification")
    return result


# -- what is claimed, and of what ----------------------------------------------------------------------------------


def _claim(node: Node, states: tuple[str, ...]) -> Claim:
    own = node.closed("id", "horizon", "for_all_time", "period", "domain", "start", "uncertainty")
    start = own["start"].closed(optional=("at", "within"))
    return Claim(
        id=own["id"].text(),
        horizon=own.known("horizon", Node.exact),
        for_all_time=own.known("for_all_time", Node.text),
        period=own.known("period", Node.text),
        domain=_box(own["domain"], states, Node.exact),
        start=(start.get("at", Node.exacts), start.get("within", Node.exact)),
        uncertainty=own["uncertainty"].text(),
    )


def _box(node: Node, states: tuple[str, ...], read: Callable[[Node], Fraction]) -> dict[str, Range]:
    sides = node.closed(*states)
    return {name: (read(low), read(high)) for name in states for low, high in [sides[name].pair()]}


def _overrides(node: Node) -> Overrides:
    own = node.closed(optional=("epsilon", "rho_a", "bandwidth", "adaptation_rate", "metric"))
    return Overrides(
        epsilon=own.get("epsilon", Node.decimal),
        rho_a=own.get("rho_a", Node.decimal),
        bandwidth=own.get("bandwidth", Node.decimal),
        adaptation_rate=own.get("adaptation_rate", Node.decimal),
        metric=own.get("metric", Node.text),
    )


def _declared(node: Node) -> dict[str, Fraction]:
    node.closed(optional=("h", "h_x", "h_t"))
    return {key: value.decimal() for key, value in node.items()}


def _plan(node: Node, specification: Specification) -> Plan:
    n, m = len(specification.plant.states), len(specification.plant.inputs)
    optional = ["interpolation", "samples"]
    if not isinstance(specification.trajectory, Resting) and specification.trajectory.kind != "expressions":
        optional += ["curve", "knots"]
    if isinstance(specification.trajectory, Tabled):
        optional += ["file", "file_hash"]
    own = node.closed("kind", optional=optional)
    knots = own.get("knots", lambda item: _knots(item, n, m))
    if "interpolation" in own:
        own.require(*(key for key in optional if key != "samples"))
    return Plan(
        kind=own["kind"].text(),
        interpolation=own.get("interpolation", lambda item: item.word("exact", "hold", "linear")),
        curve=own.get("curve", Node.text),
        knots=knots,
        samples=own.get("samples", lambda item: samples(item, n)),
        file=own.get("file", Node.text),
        file_hash=own.get("file_hash", Node.text),
    )


def _knots(node: Node, n: int, m: int) -> Knots:
    own = node.closed("t", "x", "u")
    t = own["t"].exacts()
    x, u = (
        tuple(tuple(e.exact() for e in row) for row in own[key].rows(len(t), size))
        for key, size in (("x", n), ("u", m))
    )
    return Knots(t, x, u)


# -- what is measured ----------------------------------------------------------------------------------------------


def _metric(node: Node, n: int) -> MetricSection:
    enclosures = ("margin", "largest_rate", "lower_on_set", "upper_on_set", "lower", "upper")
    own = node.closed("rate", "dual_metric", "verdict", optional=(*enclosures, "unique_geodesics"))
    dual = own["dual_metric"].rows(n, n)
    return MetricSection(
        rate=own["rate"].decimal(),
        dual_metric=tuple(tuple(e.text() for e in row) for row in dual),
        verdict=own["verdict"].word(*VERDICTS),
        margin=own.get("margin", enclosure),
        largest_rate=own.get("largest_rate", enclosure),
        lower_on_set=own.get("lower_on_set", enclosure),
        upper_on_set=own.get("upper_on_set", enclosure),
        lower=own.get("lower", enclosure),
        upper=own.get("upper", enclosure),
        geodesics=own.get("unique_geodesics", _geodesics),
    )


def _geodesics(node: Node) -> Geodesics:
    own = node.closed("value", "holds")
    return Geodesics(enclosure(own["value"]), own["holds"].flag())


def _tube(node: Node, states: tuple[str, ...]) -> TubeSection:
    own = node.closed("epsilon", "rho_a", "rho", optional=("rho_r", "half_widths"))
    widths = own.get("half_widths", lambda item: item.closed(*states))
    return TubeSection(
        epsilon=own["epsilon"].decimal(),
        rho_a=own["rho_a"].decimal(),
        rho=own["rho"].decimal(),
        rho_r=own.get("rho_r", Node.decimal),
        half_widths=None if widths is None else {name: widths[name].decimal() for name in states},
    )


def _constants(node: Node, result: Members) -> dict[str, Enclosure]:
    """Every constant there is, and no other; those that follow from gains only where gains of A are printed."""
    has_gains = "conditions_26" in result and result["conditions_26"].mapping().get("bandwidth") is not None
    names = (*MEASURED, *(DERIVED if has_gains else ()))
    own = node.closed(*names)
    n = len(result["safe_set"].mapping())
    return {name: _constant(own[name], n) for name in names}


def _constant(node: Node, n: int) -> Enclosure:
    labels = ("symbol", "equation", "unit")
    own = node.closed("below", "above", *labels, optional=("at",))
    for key in labels:
        own[key].text()
    if "at" in own:
        point = own["at"].closed("x", optional=("t",))
        if len(point["x"].numbers()) not in (0, n):
            raise point["x"].refused(f"must have {n} entries")
        point.get("t", Node.number)
    return Enclosure(own.known("below", Node.number), own.known("above", Node.number))


# -- gains ---------------------------------------------------------------------------------------------------------


def _sections(own: Members, n: int) -> Sections:
    elasticities(own["elasticities"], MEASURED)
    return Sections(
        rates=_rates(own["conditions_26"], n),
        distance=_distance(own["distance"]),
        sampled=_sampled(own["sampled"]),
        decided_by=own["decided_by"].texts(),
    )


def _gains(own: Members) -> Pair:
    return Pair(
        bandwidth=own["bandwidth"].decimal(),
        adaptation_rate=own["adaptation_rate"].decimal(),
        predictor_gain=own.known("predictor_gain", Node.decimal),
        projection_radius=own["projection_radius"].decimal(),
    )


_GAINS = ("bandwidth", "adaptation_rate", "predictor_gain", "projection_radius")


def _margins(node: Node) -> dict[str, Enclosure]:
    own = node.closed(*CLAIMS_26)
    return {claim: enclosure(own[claim]) for claim in CLAIMS_26}


def _rates(node: Node, n: int) -> RateSection:
    gains = ("bandwidth", "adaptation_rate", "projection_radius", "margins")
    own = node.closed(
        "verdict",
        *gains,
        "A_m",
        "P",
        "Q",
        "ultimate_radius",
        "least_adaptation",
        "curve",
        "bandwidth_infimum",
        "binds",
        "below_twice_rate",
        "shortfalls",
        optional=("margins_around",),
    )
    own.known("bandwidth_infimum", Node.number)
    verdict = own["verdict"].word(*VERDICTS)
    matrices = [own.known(key, lambda item: _matrix(item, n)) for key in ("A_m", "P", "Q")]
    A_m, P, Q = matrices
    predictor = None if A_m is None or P is None or Q is None else Predictor(A_m, P, Q)
    present = [own[key].value is not None for key in gains]
    if any(present) != all(present) or (verdict == "certified" and not (all(present) and predictor)):
        raise node.refused("has a part of its gains only")
    pair = None
    if all(present):
        pair = RatePair(
            Pair(
                own["bandwidth"].decimal(),
                own["adaptation_rate"].decimal(),
                None if predictor is None else _scalar(predictor.A_m),
                own["projection_radius"].decimal(),
            ),
            _margins(own["margins"]),
        )
    return RateSection(
        verdict=verdict,
        pair=pair,
        predictor=predictor,
        ultimate_radius=own.known("ultimate_radius", Node.number),
        least_adaptation=own.known("least_adaptation", _rate_pair),
        curve=tuple(_point(item) for item in own["curve"].entries()),
        around=own.get("margins_around", lambda item: _around(item, CLAIMS_26)),
        binds=own.known("binds", Node.text),
        below_twice_rate=own["below_twice_rate"].flag(),
        shortfalls=_shortfalls(own["shortfalls"]),
    )


def _matrix(node: Node, n: int) -> Rows:
    return tuple(tuple(e.decimal() for e in row) for row in node.rows(n, n))


def _scalar(A: Rows) -> Fraction | None:
    """The g > 0 of A = -g I."""
    g = -A[0][0]
    same = all(e == (-g if i == j else 0) for i, row in enumerate(A) for j, e in enumerate(row))
    return g if same and g > 0 else None


def _rate_pair(node: Node) -> RatePair:
    own = node.closed(*_GAINS, "margins")
    return RatePair(_gains(own), _margins(own["margins"]))


def _distance_pair(node: Node) -> DistancePair:
    own = node.closed(*_GAINS, "margin", "ultimate_radius")
    radius = own.known("ultimate_radius", Node.number)
    return DistancePair(_gains(own), enclosure(own["margin"]), radius)


def _point(node: Node) -> Point:
    own = node.closed("bandwidth", "adaptation_rate", "predictor_gain")
    gains = own["bandwidth"].decimal(), own["adaptation_rate"].decimal()
    return Point(*gains, own.known("predictor_gain", Node.decimal))


def _around(node: Node, claims: tuple[str, ...]) -> Around:
    bandwidths, rate, gain, margins = around(node, claims)
    return Around(bandwidths, rate, gain, margins)


def _shortfalls(node: Node) -> tuple[Shortfall, ...]:
    found = []
    for item in node.entries():
        own = item.closed("condition", "margin", "allowed", "needed", "missing", optional=("constant",))
        own.get("constant", Node.text)
        for key in ("allowed", "needed", "missing"):
            own.known(key, Node.number)
        found.append(Shortfall(own["condition"].text(), enclosure(own["margin"])))
    return tuple(found)


def _distance(node: Node) -> DistanceSection:
    keys = ("verdict", "split", "least_adaptation", "asked", "ultimate_radius", "curve", "shortfalls")
    own = node.closed(*keys, optional=("margins_around",))
    found = DistanceSection(
        verdict=own["verdict"].word(*VERDICTS),
        split=own.known("split", _distance_pair),
        least_adaptation=own.known("least_adaptation", _distance_pair),
        asked=own.known("asked", _distance_pair),
        ultimate_radius=own.known("ultimate_radius", Node.number),
        curve=tuple(_point(item) for item in own["curve"].entries()),
        around=own.get("margins_around", lambda item: _around(item, ("margin",))),
        shortfalls=_shortfalls(own["shortfalls"]),
    )
    if not found.pairs and (found.verdict == "certified" or found.curve or found.around):
        raise node.refused("has no pair of gains")
    return found


_SAMPLED = ("sample_time", "bandwidth", "predictor_gain", "projection_radius")


def _sampled_pair(own: Members) -> SampledPair:
    return SampledPair(*(own[key].decimal() for key in _SAMPLED))


def _sampled(node: Node) -> SampledSection:
    keys = ("verdict", "margin", "ultimate_radius", "sample_time_limit", "curve", "shortfalls")
    own = node.closed(*_SAMPLED, *keys)
    own.known("sample_time_limit", Node.number)
    verdict = own["verdict"].word(*VERDICTS)
    present = [own[key].value is not None for key in (*_SAMPLED, "margin")]
    if any(present) != all(present) or (verdict == "certified" and not all(present)):
        raise node.refused("has a part of its gains only")
    curve = []
    for item in own["curve"].entries():
        point = item.closed("bandwidth", "sample_time")
        curve.append((point["bandwidth"].decimal(), point["sample_time"].decimal()))
    if curve and not all(present):
        raise node.refused("has a curve and no gains")
    return SampledSection(
        verdict=verdict,
        pair=_sampled_pair(own) if all(present) else None,
        margin=own.known("margin", enclosure),
        ultimate_radius=own.known("ultimate_radius", Node.number),
        curve=tuple(curve),
        shortfalls=_shortfalls(own["shortfalls"]),
    )


def _recipes(node: Node) -> Recipes:
    own = node.closed(optional=("conditions_26", "distance", "sampled"))
    return Recipes(
        rates=own.get("conditions_26", lambda item: _gains(item.closed(*_GAINS))),
        distance=own.get("distance", _distance_recipe),
        sampled=own.get("sampled", _sampled_recipe),
    )


def _distance_recipe(node: Node) -> DistanceRecipe:
    own = node.closed(*_GAINS, "speed", "prediction_error", "uncertainty")
    numbers = (own[key].decimal() for key in ("speed", "prediction_error", "uncertainty"))
    return DistanceRecipe(_gains(own), *numbers)


def _sampled_recipe(node: Node) -> SampledRecipe:
    own = node.closed(*_SAMPLED, "speed")
    return SampledRecipe(_sampled_pair(own), own["speed"].decimal())
