"""The specification inside a certificate (`result.spec.effective`, canonical), read into closed types.

Every object has a known set of keys; a key that is missing, unknown or of another kind is an error (TC603). Nothing
has a default: the canonical form writes out all that a claim rests on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Members, Node, digest, wrong
from tubecert.recheck.grammar import Owed, is_name
from tubecert.recheck.obstacles import Obstacle, read_obstacle
from tubecert.recheck.reading import TIME, Column, Reader
from tubecert.recheck.terms import Matrix

Range = tuple[Fraction, Fraction]
Numbers = tuple[Fraction, ...]
Rows = tuple[Numbers, ...]

_IDLE = ("name", "expect", "simulation", "obstacles", "limits")
_MOST_STATES = 32
_MOST_WIDE = 10  # sides of a box of starts: all its corners are examined
_LOCKED = ("rho", "clearance", "inputs", "bandwidth", "adaptation_rate", "sample_time")


@dataclass(frozen=True, slots=True)
class Plant:
    """x' = f + B u on a box; all exact, with what the expressions owe there."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: Column
    B: Matrix
    safe_set: dict[str, Range]
    duties: tuple[Owed, ...]


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """h as expressions of t and x, or declared bounds (h, h_x, h_t), or both; never neither."""

    h: Column | None
    declared: dict[str, Fraction]
    duties: tuple[Owed, ...]

    @property
    def words(self) -> str:
        """What the claim covers: the expression, everything within the bounds, or either.

        Beside an expression the bounds count only if |h| itself is declared: else H0 is that of the expression.
        """
        if self.h is None:
            return "bounds"
        return "expression_or_bounds" if "h" in self.declared else "expression"


@dataclass(frozen=True, slots=True)
class Resting:
    """A plan that stays at a point: for ever, or until the horizon."""

    at: Numbers
    input: Numbers
    horizon: Fraction | None
    kind: str = "equilibrium"


@dataclass(frozen=True, slots=True)
class Expressed:
    """x* and u* as expressions of t on [0, horizon]."""

    x: Column
    u: Column
    horizon: Fraction
    duties: tuple[Owed, ...]
    kind: str = "expressions"


@dataclass(frozen=True, slots=True)
class Tabled:
    """A plan from a file: its knots are in the certificate."""

    held: bool
    horizon: Fraction
    kind: str = "csv"


@dataclass(frozen=True, slots=True)
class Planned:
    """A plan from `start` that the planner made: its knots are in the certificate; with a goal it ends in `target`."""

    start: Numbers
    target: Numbers
    goal: bool
    held: bool
    horizon: Fraction
    kind: str = "ilqr"


@dataclass(frozen=True, slots=True)
class AnyPlan:
    """Every plan with x* and u* in boxes, by name, and |x*' - f - B u*| <= `defect`."""

    x: dict[str, Range]
    u: dict[str, Range]
    defect: Fraction
    horizon: Fraction | None
    kind: str = "any"


Trajectory = Resting | Expressed | Tabled | Planned | AnyPlan


@dataclass(frozen=True, slots=True)
class Metric:
    """A dual metric at a rate, and bounds of M that are declared for the safe set."""

    dual: Matrix
    texts: tuple[tuple[str, ...], ...]
    rate: Fraction
    lower: Fraction | None
    upper: Fraction | None
    duties: tuple[Owed, ...]


@dataclass(frozen=True, slots=True)
class Wanted:
    """A metric that is still to be found: at this rate, if one is given."""

    rate: Fraction | None
    condition_number: Fraction | None


@dataclass(frozen=True, slots=True)
class Start:
    """x(0): a point, anything within a radius of x*(0), or anything in a box."""

    at: Numbers | None
    within: Fraction | None
    box: dict[str, Range] | None


@dataclass(frozen=True, slots=True)
class Loop:
    """The predictor (None: -g I for the g that each pair states), the smooth layer of the projection, the kernel."""

    A_m: Rows | None
    smooth: Fraction | None
    kernel: str


@dataclass(frozen=True, slots=True)
class Specification:
    """Everything; `hash` is of the canonical bytes, `content` of those members that a claim may rest on."""

    plant: Plant
    uncertainty: Uncertainty
    trajectory: Trajectory
    start: Start
    metric: Metric | Wanted
    epsilon: Fraction | None  # None: with half-widths they follow from these
    rho_a: Fraction | None
    coordinates: bool  # whether the tube has coordinates of its own
    half_widths: dict[str, Fraction]  # at most; empty if none are asked for
    loop: Loop
    obstacles: tuple[Obstacle, ...]
    limits: dict[str, Range]  # by input, of some of them
    hash: str
    content: str


def read_specification(node: Node) -> Specification:
    """The specification; raises `CertificateError` for whatever is not of the canonical form."""
    own = node.closed(
        "tubecert",
        "name",
        "system",
        "safe_set",
        "uncertainty",
        "trajectory",
        "initial_state",
        "tube",
        "adaptation",
        "conditions",
        "metric",
        optional=_IDLE[1:],
    )
    _version(own["tubecert"])
    own["name"].text()
    plant = _plant(own["system"], own["safe_set"])
    n = len(plant.states)
    tube = _tube(own["tube"], plant)
    found = Specification(
        plant=plant,
        uncertainty=_uncertainty(own["uncertainty"], plant),
        trajectory=_trajectory(own["trajectory"], plant),
        start=read_start(own["initial_state"], plant.states),
        metric=_metric(own["metric"], plant),
        epsilon=tube.get("epsilon", _positive),
        rho_a=tube.get("rho_a", _positive),
        coordinates="coordinates" in tube,
        half_widths=tube.get("half_widths", _widths) or {},
        loop=_loop(own["adaptation"], own["conditions"], n),
        obstacles=tuple(read_obstacle(item, plant.states) for item in own["obstacles"].entries())
        if "obstacles" in own
        else (),
        limits=own.get("limits", lambda item: _limits(item, plant.inputs)) or {},
        hash=digest(node.value),
        content=digest({key: value for key, value in node.mapping().items() if key not in _IDLE}),
    )
    _idle(own, plant)
    if isinstance(found.trajectory, AnyPlan) and found.start.within is None:
        raise own["initial_state"].refused("must be `within`: a family of plans has no start of its own")
    return found


def _version(node: Node) -> None:
    if node.count() != 1:
        raise wrong("TC602", f"{node.path} is {node.value!r}; this version reads 1", "use a newer tubecert")


def _positive(node: Node) -> Fraction:
    q = node.exact()
    if q <= 0:
        raise node.refused("is not positive")
    return q


def _not_negative(node: Node) -> Fraction:
    q = node.exact()
    if q < 0:
        raise node.refused("is negative")
    return q


def _whole(node: Node) -> int:
    q = node.exact()
    if q.denominator != 1 or q < 0:
        raise node.refused("is no whole number")
    return int(q)


def _several(node: Node, size: int) -> Numbers:
    return tuple(item.exact() for item in node.sized(size))


def _square(node: Node, size: int) -> Rows:
    return tuple(_several(row, size) for row in node.sized(size))


def _ends(node: Node) -> Range:
    low, high = (end.exact() for end in node.pair())
    if low >= high:
        raise node.refused("is an empty range")
    return low, high


# -- the system ----------------------------------------------------------------------------------------------------


def _plant(node: Node, box: Node) -> Plant:
    own = node.closed("states", "inputs", "units", "parameters", "f", "B")
    states, inputs = own["states"].texts(), own["inputs"].texts()
    n, m = len(states), len(inputs)
    if not (0 < m <= n <= _MOST_STATES):
        raise node.refused(f"must name 1 to {_MOST_STATES} states, and at most as many inputs")
    _names(node, [*states, *inputs])
    own["units"].closed(optional=(*states, *inputs))
    for _, unit in own["units"].items():
        unit.text()
    for _, value in own["parameters"].items():
        value.exact()  # expressions are written with the values: they have no parameters
    _names(own["parameters"], [*states, *inputs, *own["parameters"].mapping()])
    reader = Reader.of(states)
    sides = box.closed(*states)
    return Plant(
        states=states,
        inputs=inputs,
        f=reader.column(own["f"], n),
        B=reader.matrix(own["B"], n, m),
        safe_set={name: _ends(sides[name]) for name in states},
        duties=tuple(reader.duties),
    )


def _names(node: Node, names: Sequence[str]) -> None:
    """Names that mean one thing each: not a constant, a function or a word of the grammar, and all different."""
    for name in names:
        if not is_name(name):
            raise node.refused(f"has the name {name[:60]!r}, which may not be used")
    if len(set(names)) != len(names):
        raise node.refused("uses a name twice")


def _uncertainty(node: Node, plant: Plant) -> Uncertainty:
    own = node.closed(optional=("h", "bounds"))
    reader = Reader.of((*plant.states, TIME), kinks=True)
    h = own.get("h", lambda item: reader.column(item, len(plant.inputs)))
    declared: dict[str, Fraction] = {}
    if "bounds" in own:
        own["bounds"].closed(optional=("h", "h_x", "h_t"))
        declared = {key: _not_negative(value) for key, value in own["bounds"].items()}
    if h is None and len(declared) < 3:
        raise node.refused("must give h, or bounds for h, h_x and h_t")
    return Uncertainty(h, declared, tuple(reader.duties))


# -- plan and start ------------------------------------------------------------------------------------------------


def _trajectory(node: Node, plant: Plant) -> Trajectory:
    kind, n, m = node.mapping().get("kind"), len(plant.states), len(plant.inputs)
    if kind == "any":
        return _any(node, plant)
    readers: dict[object, Callable[[Node, int, int], Trajectory]] = {
        "equilibrium": _resting,
        "expressions": _expressed,
        "csv": _tabled,
        "ilqr": _planned,
    }
    if not isinstance(kind, str) or kind not in readers:
        raise node.refused(f"must have a kind, one of {', '.join(map(str, readers))}, any")
    return readers[kind](node, n, m)


def _resting(node: Node, n: int, m: int) -> Resting:
    own = node.closed("kind", "at", "input", optional=("horizon",))
    return Resting(_several(own["at"], n), _several(own["input"], m), own.get("horizon", _positive))


def _expressed(node: Node, n: int, m: int) -> Expressed:
    own = node.closed("kind", "x", "u", "horizon")
    reader = Reader.of((TIME,))
    x, u = reader.column(own["x"], n), reader.column(own["u"], m)
    return Expressed(x, u, _positive(own["horizon"]), tuple(reader.duties))


def _any(node: Node, plant: Plant) -> AnyPlan:
    own = node.closed("kind", "x", "u", "defect", optional=("horizon",))
    x, u = (
        {name: _span(ends[name]) for name in names}
        for names, ends in (
            (plant.states, own["x"].closed(*plant.states)),
            (plant.inputs, own["u"].closed(*plant.inputs)),
        )
    )
    return AnyPlan(x, u, _not_negative(own["defect"]), own.get("horizon", _positive))


def _span(node: Node) -> Range:
    """Ends that may be one point."""
    low, high = (end.exact() for end in node.pair())
    if low > high:
        raise node.refused("is an empty range")
    return low, high


def _held(node: Node) -> bool:
    return node.word("hold", "linear") == "hold"


def _tabled(node: Node, n: int, m: int) -> Tabled:
    del n, m
    own = node.closed("kind", "file", "interpolation", "horizon")
    own["file"].text()
    return Tabled(_held(own["interpolation"]), _positive(own["horizon"]))


def _planned(node: Node, n: int, m: int) -> Planned:
    keys = ("kind", "start", "target", "knots", "Q", "R", "goal", "interpolation", "horizon")
    own = node.closed(*keys, optional=("input",))
    own.get("input", lambda item: _several(item, m))
    _square(own["Q"], n)
    _square(own["R"], m)
    _whole(own["knots"])
    return Planned(
        start=_several(own["start"], n),
        target=_several(own["target"], n),
        goal=own["goal"].word("true", "false") == "true",
        held=_held(own["interpolation"]),
        horizon=_positive(own["horizon"]),
    )


def read_start(node: Node, states: Sequence[str]) -> Start:
    """The start; a claim says it in the same words."""
    own = node.closed(optional=("at", "within", "box"))
    if len(node.mapping()) != 1:
        raise node.refused("must be `at`, `within` or `box`")
    return Start(
        own.get("at", lambda item: _several(item, len(states))),
        own.get("within", _not_negative),
        own.get("box", lambda item: _start_box(item, states)),
    )


def _start_box(node: Node, states: Sequence[str]) -> dict[str, Range]:
    """A range for every state, which may be a point, but not all of them."""
    own = node.closed(*states)
    box: dict[str, Range] = {}
    for name in states:
        low, high = (end.exact() for end in own[name].pair())
        if low > high:
            raise own[name].refused("is an empty range")
        box[name] = low, high
    if not 0 < sum(low < high for low, high in box.values()) <= _MOST_WIDE:
        raise node.refused(f"must have a width in 1 to {_MOST_WIDE} states")
    return box


def _tube(node: Node, plant: Plant) -> Members:
    """Radii in x, radii in coordinates that the certificate states, or half-widths, which have such coordinates."""
    own = node.closed(optional=("epsilon", "rho_a", "coordinates", "half_widths"))
    own.get("coordinates", lambda item: item.word("auto"))
    if "half_widths" not in own:
        own.require("epsilon", "rho_a")
        return own
    own.require("coordinates")
    widths = own["half_widths"]
    widths.closed(optional=plant.states)
    if "epsilon" in own or not widths.mapping():
        raise node.refused("must have epsilon, or half-widths of some states")
    return own


def _limits(node: Node, inputs: Sequence[str]) -> dict[str, Range]:
    """Limits of some of the inputs, in their order."""
    own = node.closed(optional=inputs)
    if not node.mapping():
        raise node.refused("must have limits of an input")
    return {name: _ends(own[name]) for name in inputs if name in own}


def _widths(node: Node) -> dict[str, Fraction]:
    return {name: _positive(value) for name, value in node.items()}


# -- metric and loop -----------------------------------------------------------------------------------------------


def _metric(node: Node, plant: Plant) -> Metric | Wanted:
    if "synthesise" in node.mapping():
        return read_wanted(node.closed("synthesise")["synthesise"])
    own = node.closed("dual_metric", "rate", optional=("bounds",))
    n = len(plant.states)
    reader = Reader.of(plant.states)
    dual = reader.matrix(own["dual_metric"], n, n)
    if any(dual[i][j] is not dual[j][i] for i in range(n) for j in range(i)):
        raise own["dual_metric"].refused("is not symmetric")
    bounds = own.get("bounds", lambda item: item.closed(optional=("lower", "upper")))
    return Metric(
        dual=dual,
        texts=tuple(row.texts() for row in own["dual_metric"].entries()),
        rate=_positive(own["rate"]),
        lower=None if bounds is None else bounds.get("lower", _positive),
        upper=None if bounds is None else bounds.get("upper", _positive),
        duties=tuple(reader.duties),
    )


def read_wanted(node: Node) -> Wanted:
    """What a metric that is to be synthesised must be; how it is searched for is idle."""
    keys = ("objective", "degree", "variables", "route", "solver")
    own = node.closed(*keys, optional=("rate", "condition_number", "coordinates"))
    own.get("coordinates", Node.text)
    for key in ("objective", "degree", "route", "solver"):
        own[key].text()
    if own["variables"].value != "auto":
        own["variables"].texts()
    return Wanted(own.get("rate", _positive), own.get("condition_number", _positive))


_DECIDES = ("0", "A", "B", "C", "all")


def _loop(adaptation: Node, conditions: Node, n: int) -> Loop:
    own, chosen = adaptation.closed("A_m", "projection"), conditions.closed(optional=("kernel", "decides"))
    A_m, projection = own["A_m"], own["projection"]
    kernel = chosen.get("kernel", lambda item: item.word("tight", "paper"))
    chosen.get(
        "decides", lambda item: item.word(*_DECIDES)
    )  # the certificate says itself which sections decide
    return Loop(
        A_m=None if A_m.value == "auto" else _square(A_m, n),
        smooth=None if projection.value == "hard" else _positive(projection.closed("smooth")["smooth"]),
        kernel=kernel or "tight",  # the form of the certificate: both kernels are theorems
    )


# -- what no claim rests on ----------------------------------------------------------------------------------------


def _idle(own: Members, plant: Plant) -> None:
    """Sections that other commands read: known keys all the same."""
    if "expect" in own:
        locked = own["expect"].closed(optional=("verdict", *_LOCKED))
        locked.get("verdict", Node.text)
        for key in _LOCKED:
            locked.get(key, lambda item: _several(item, 2))
    if "simulation" in own:
        numbers, texts = ("runs", "seed", "duration", "control_rate"), ("controllers", "plane", "h")
        simulation = own["simulation"].closed(optional=("gains", *numbers, *texts))
        simulation.get("gains", Node.text)
        simulation.get(
            "h", lambda item: Reader.of((*plant.states, TIME), kinks=True).column(item, len(plant.inputs))
        )
        for key in numbers:
            simulation.get(key, Node.exact)
        for key in texts:
            simulation.get(key, Node.texts)
