"""What a specification says, as values: exact numbers, expressions with their obligations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from tubecert.expression import Lookup
from tubecert.findings import Location
from tubecert.spec.machine import Controller, Hardware
from tubecert.spec.metric import Metric, Synthesis
from tubecert.spec.plan import Trajectory
from tubecert.spec.scene import Obstacle, Simulation
from tubecert.spec.system import Disturbance, Uncertainty
from tubecert.spec.tube import Adaptation, Expectation, Tube
from tubecert.spec.values import Ends, Output, Term, TermMatrix, Vector


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
    ranges: tuple[tuple[str, Ends], ...] = ()
    # names: expressions have them written out
    definitions: tuple[str, ...] = field(default=(), compare=False)
    tables: tuple[Lookup, ...] = ()
    f: tuple[Term, ...]
    drift: tuple[Term, ...] = ()
    B: TermMatrix
    gained: TermMatrix = ()
    outputs: tuple[Output, ...] = ()
    safe_set: tuple[Ends, ...]
    uncertainty: Uncertainty
    trajectory: Trajectory
    x0: Vector
    within: Fraction | None  # instead of x0: any start this near to the plan's
    start_box: tuple[Ends, ...] = ()  # instead of x0, its centre: any start in the box
    metric: Metric | None
    synthesis: Synthesis | None = None  # only where there is no metric
    tube: Tube = field(default_factory=Tube)
    adaptation: Adaptation = field(default_factory=Adaptation)
    decides: str | None
    expect: Expectation | None
    obstacles: tuple[Obstacle, ...] = ()
    limits: tuple[tuple[str, Ends], ...] = ()  # by input, of some of them
    simulation: Simulation | None = None
    hardware: Hardware | None = None  # then there is no metric, and none is asked for
    controller: Controller = "auto"
    disturbance: Disturbance | None = None
    settings: tuple[tuple[str, str], ...] = ()  # keys set by the command line, with their texts
    lacks: tuple[str, ...] = ()  # sections that a file need not have that asks about a metric alone
    locations: Mapping[str, Location] = field(repr=False, compare=False, hash=False)

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
