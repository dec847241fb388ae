"""What a specification says, as values: exact numbers, expressions with their obligations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal

from tubecert.expression import Expression, Lookup, Obligation
from tubecert.findings import Location

Vector = tuple[Fraction, ...]
Matrix = tuple[Vector, ...]
Interpolation = Literal["hold", "linear", "hermite-simpson"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """An expression of the file; each of its `obligations` has the location of the same index in `places`."""

    expression: Expression
    obligations: tuple[Obligation, ...]
    places: tuple[Location, ...] = field(repr=False)
    text: str
    location: Location = field(repr=False)

    def __post_init__(self) -> None:
        assert len(self.obligations) == len(self.places)

    def owed(self) -> Iterator[tuple[Obligation, Location]]:
        """The obligations with where each stands."""
        return zip(self.obligations, self.places, strict=True)


TermMatrix = tuple[tuple[Term, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Declared bounds of |h|, of a Lipschitz constant of h in x, and of |dh/dt|."""

    h: Fraction | None = None
    h_x: Fraction | None = None
    h_t: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """The matched uncertainty: expressions (m), or declared bounds, or both; never neither."""

    h: tuple[Term, ...] | None
    bounds: Bounds | None

    def __post_init__(self) -> None:
        assert self.h is not None or self.bounds is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Knots:
    """A curve by its values: `t` (K) in s from 0 on, `x` (K, n), `u` (K, m), all exact.

    u is held from each knot to the next, or linear between them; or rows are in turn a knot and a point between two, as
    planners by Hermite-Simpson collocation have them, and u is quadratic through a knot, that point and the next knot.
    """

    t: Vector
    x: Matrix
    u: Matrix
    interpolation: Interpolation

    def __post_init__(self) -> None:
        assert len(self.t) == len(self.x) == len(self.u) >= 2
        assert self.t[0] == 0
        assert all(a < b for a, b in zip(self.t, self.t[1:], strict=False))
        assert self.interpolation != "hermite-simpson" or len(self.t) % 2 == 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A plan file: its name as written, the hash of its bytes, its knots, where its header and its rows stand."""

    file: str
    sha256: str
    knots: Knots = field(repr=False)
    header: Location | None = field(default=None, repr=False, compare=False)
    rows: tuple[Location, ...] = field(default=(), repr=False, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What the built-in planner is asked for.

    It minimises the integral of (x - target)' Q (x - target) + (u - input)' R (u - input) from `start`, with `knots`
    knots over the horizon, and ends in `target` if that is the `goal`. `input` None: what best holds the target.
    """

    start: Vector
    target: Vector
    input: Vector | None
    knots: int
    Q: Matrix
    R: Matrix
    goal: bool
    interpolation: Interpolation


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """A family of plans: x* (n ranges) and u* (m ranges) stay in boxes, the defect (state units per s) is limited.

    `input_rate` (m), where it is known, bounds |u*'| of every input; None beside hardware: u* is held as inputs are.
    """

    x: tuple[tuple[Fraction, Fraction], ...]
    u: tuple[tuple[Fraction, Fraction], ...]
    defect: Fraction
    input_rate: Vector | None = None


PlanKind = Literal["equilibrium", "expressions", "csv", "ilqr", "any"]
Afterwards = Literal["nothing", "rest", "repeat"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """The plan: horizon in s, and what its kind needs.

    x (n) and u (m) are expressions of t (constants for an equilibrium); csv has a `table`, ilqr a `task`, any
    a `bundle` instead. `afterwards`: what a computer does when the horizon is over, of which the tube holds as well.
    """

    kind: PlanKind
    x: tuple[Term, ...] = ()
    u: tuple[Term, ...] = ()
    horizon: Fraction | None
    table: Table | None = None
    task: Task | None = None
    bundle: Bundle | None = None
    afterwards: Afterwards = "nothing"

    def __post_init__(self) -> None:
        assert self.horizon is not None or self.afterwards == "nothing"
        assert (self.table is not None) == (self.kind == "csv")
        assert (self.task is not None) == (self.kind == "ilqr")
        assert (self.bundle is not None) == (self.kind == "any")

    @property
    def written(self) -> bool:
        """Whether x* and u* are written down as expressions, and neither data nor still to be found."""
        return bool(self.x)

    @property
    def moves(self) -> bool:
        """Whether it is one plan along which x* may move: no point that is held, and no family."""
        return self.kind not in ("equilibrium", "any")


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """The dual metric W (n, n), the rate in 1/s, and declared bounds `lower` I <= W^-1 <= `upper` I."""

    dual_metric: TermMatrix
    rate: Fraction
    lower: Fraction | None = None
    upper: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """A linear combination of the states that a half-width may be asked of: `row` (n,) times x."""

    name: str
    row: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Synthesis:
    """What metric is asked for in place of a given one.

    `rate` in 1/s, None if it is searched for; `objective`: least condition number, greatest margin (in C2), greatest
    rate, least adaptation rate of the distance form, smallest tube; `degree` and `variables` of W, None: chosen
    automatically; `condition_number`: not to be exceeded; `coordinates`: those in
    which it is least, auto: half-widths of the safe set; `solver`: clarabel, scs or cvxpy:NAME. `outputs`: the states
    and outputs in which the tube is to be small; none: all of it.
    """

    rate: Fraction | None = None
    objective: str = "adaptation"
    degree: int | None = None
    variables: tuple[str, ...] | None = None
    condition_number: Fraction | None = None
    coordinates: Literal["auto", "identity"] = "auto"
    route: str = "auto"
    solver: str = "clarabel"
    outputs: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """The tube's two radii, or half-widths (name, w) of states and outputs; the radii may come from the command line.

    `coordinates` None: what was not said, `identity` unless there are half-widths. `gap`: how closely the
    constants over the tube are enclosed; auto: each by its effect on the gains, None: as the command says.
    """

    epsilon: Fraction | None = None
    rho_a: Fraction | None = None
    coordinates: Literal["identity", "auto"] | None = None
    half_widths: tuple[tuple[str, Fraction], ...] = ()
    gap: Literal["auto"] | None = None

    @property
    def auto(self) -> bool:
        """Whether the tube has coordinates of its own, in which it is measured by the metric."""
        return self.coordinates == "auto" or (self.coordinates is None and bool(self.half_widths))


@dataclass(frozen=True, slots=True, kw_only=True)
class Adaptation:
    """The g of the predictor A_m = -g I, None: chosen with the gains; the smooth projection's layer, None if hard."""

    predictor_gain: Fraction | None = None
    smooth: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """A locked result: a verdict, what is known of the metric, and ranges in the certificate's own words."""

    verdict: str | None
    metric: str | None
    ranges: tuple[tuple[str, tuple[Fraction, Fraction]], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A simple polygon with corners (K, 2), or a disc, in the plane of two states.

    `decides`: whether the verdict asks for clearance from it.
    """

    states: tuple[str, str]
    polygon: Matrix = ()
    center: Vector = ()
    radius: Fraction | None = None
    decides: bool = True

    def __post_init__(self) -> None:
        assert (len(self.polygon) >= 3) == (self.radius is None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """What `simulate` does by default: duration in s; no part of any claim.

    h (m) is the uncertainty that acts in place of `uncertainty.h`.
    """

    controllers: tuple[str, ...] = ()
    gains: str | None = None
    duration: Fraction | None = None
    runs: int | None = None
    seed: int | None = None
    plane: tuple[str, str] | None = None
    h: tuple[Term, ...] | None = None


Arithmetic = Literal["double", "single"]
Hold = Literal["middle", "left", "continuous"]
Controller = Literal["auto", "none"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """The computer, the sensors and their delay; times in s.

    `sample_time` of the inputs; `delay` from a sample to its input, None: one sample time, whatever that is; `noise`:
    |n| is at most, or |n_i| per state (n), in units of the states; `arithmetic`: what the controller computes in;
    `hold`: of u* over the time in which an input acts, its middle, its left end, or all of it.
    """

    sample_time: Fraction
    delay: Fraction | None = Fraction(0)
    noise: Fraction | Vector = Fraction(0)
    arithmetic: Arithmetic = "double"
    hold: Hold = "middle"

    @property
    def delayed(self) -> Fraction:
        """The delay in s."""
        return self.sample_time if self.delay is None else self.delay


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """What acts beside the inputs: E(x) w, E (n, k), |w| <= `bound`, or |w_i| <= `bound`[i] (k) beside hardware.

    `rate` in 1/s, if |w'|, or every |w_i'|, is at most that: what of it the inputs can reach is adapted to.
    """

    E: TermMatrix
    bound: Fraction | Vector
    rate: Fraction | None = None

    @property
    def length(self) -> Fraction:
        """The bound of |w| of a loop in continuous time."""
        assert isinstance(self.bound, Fraction)
        return self.bound


class Places(Mapping[str, Location]):
    """Where the value of each key of the file stands; read-only, and it can be pickled."""

    __slots__ = ("_found",)

    def __init__(self, found: Mapping[str, Location]) -> None:
        self._found = dict(found)

    def __getitem__(self, path: str) -> Location:
        return self._found[path]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """A system, its safe set, uncertainty, plan, metric and options; everything exact.

    f (n), B (n, m), `safe_set` (n pairs) and x0 (n) are in the order of `states`. Parameters are substituted
    in every expression; of those in `ranges` the plant's is anywhere in its range, constant: `drift` is f of them, and
    f itself is that of their middles, which the controller knows. `locations` says where a key's value stands, by
    dotted path (`metric.rate`, `system.f[0]`). `gained` is the plant's B, if parameters in `ranges` stand in it.
    """

    name: str
    path: str
    source: str = field(repr=False)
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    units: tuple[tuple[str, str], ...]
    parameters: tuple[tuple[str, Fraction], ...]
    ranges: tuple[tuple[str, tuple[Fraction, Fraction]], ...] = ()
    definitions: tuple[str, ...] = field(
        default=(), compare=False
    )  # their names: expressions have them written out
    tables: tuple[Lookup, ...] = ()
    f: tuple[Term, ...]
    drift: tuple[Term, ...] = ()
    B: TermMatrix
    gained: TermMatrix = ()
    outputs: tuple[Output, ...] = ()
    safe_set: tuple[tuple[Fraction, Fraction], ...]
    uncertainty: Uncertainty
    trajectory: Trajectory
    x0: Vector
    within: Fraction | None  # instead of x0: any start this near to the plan's
    start_box: tuple[tuple[Fraction, Fraction], ...] = ()  # instead of x0, its centre: any start in the box
    metric: Metric | None
    synthesis: Synthesis | None = None  # only where there is no metric
    tube: Tube
    adaptation: Adaptation
    decides: str | None
    expect: Expectation | None
    obstacles: tuple[Obstacle, ...] = ()
    limits: tuple[tuple[str, tuple[Fraction, Fraction]], ...] = ()  # by input, of some of them
    simulation: Simulation | None = None
    hardware: Hardware | None = None  # then there is no metric, and none is asked for
    controller: Controller = "auto"
    disturbance: Disturbance | None = None
    settings: tuple[tuple[str, str], ...] = ()  # keys set by the command line, with their texts
    lacks: tuple[str, ...] = ()  # sections that a file need not have that asks about a metric alone
    locations: Places = field(repr=False, compare=False, hash=False)

    def __post_init__(self) -> None:
        n, m = len(self.states), len(self.inputs)
        assert len(self.f) == len(self.B) == len(self.safe_set) == len(self.x0) == n
        assert all(len(row) == m for row in self.B)
        assert len(self.start_box) in (0, n)
        assert self.disturbance is None or len(self.disturbance.E) == n
        assert self.hardware is None or (self.metric is None and self.synthesis is None)

    @property
    def lengths(self) -> tuple[str, ...]:
        """What has a half-width: states, then outputs."""
        return *self.states, *(output.name for output in self.outputs)

    def location(self, path: str) -> Location | None:
        """Where the value of `path` stands, or the nearest enclosing key that is in the file."""
        while path and path not in self.locations:
            path = path[: max(path.rfind("."), path.rfind("["), 0)]
        return self.locations.get(path)
