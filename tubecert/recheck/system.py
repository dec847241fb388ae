"""The specification inside a certificate (`result.spec.effective`, canonical) as the exact terms of a system.

The reader knows the canonical form only: every number is a text, every expression is in the grammar, all that the
certificate rests on is written out. Whatever is not of this form is an error (TC603).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from tubecert.recheck.curve import Curve, Knots, expressed, hermite
from tubecert.recheck.document import Node, wrong
from tubecert.recheck.reading import TIME, Duty, Reader, rows_of, sized
from tubecert.recheck.terms import (
    Matrix,
    all_zero,
    matrix_slopes,
    plus,
    scaled,
    times,
    turned,
    variable,
)


@dataclass(frozen=True, slots=True)
class Plant:
    """x' = f + B u on a box; all exact."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: Matrix  # (n, 1)
    B: Matrix
    safe_set: dict[str, tuple[Fraction, Fraction]]


@dataclass(frozen=True)
class System:
    """x' = f + B (u + h) with dual metric W at a rate, a plan, and the options of the loop; all exact."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: Matrix  # (n, 1)
    B: Matrix
    W: Matrix
    rate: Fraction
    h: Matrix | None  # (m, 1)
    declared: dict[str, Fraction]  # bounds of h, h_x, h_t
    safe_set: dict[str, tuple[Fraction, Fraction]]
    x0: list[Fraction] | None
    within: Fraction | None
    epsilon: Fraction
    rho_a: Fraction
    A_m: list[list[Fraction]] | None  # None: auto
    smooth: Fraction | None
    kernel: str
    horizon: Fraction | None
    duties: tuple[Duty, ...]

    @cached_property
    def f_x(self) -> Matrix:
        """df/dx, (n, n)."""
        columns = [[row[0] for row in matrix_slopes(self.f, name)] for name in self.states]
        return turned(columns)

    @cached_property
    def W_x(self) -> list[Matrix]:
        """dW/dx_i for every state."""
        return [matrix_slopes(self.W, name) for name in self.states]

    @cached_property
    def BBt(self) -> Matrix:
        """B B'."""
        return times(self.B, turned(self.B))

    @cached_property
    def drift(self) -> Matrix:
        """f + B u in the states and inputs, (n, 1)."""
        return plus(self.f, times(self.B, [[variable(name)] for name in self.inputs]))

    @cached_property
    def contraction(self) -> Matrix:
        """-d_f W + f_x W + W f_x', (n, n)."""
        moved = along(self.W_x, self.f)
        product = times(self.f_x, self.W)
        return plus(plus(product, turned(product)), moved, -1)

    @cached_property
    def F(self) -> Matrix:
        """The same plus 2 rate W."""
        return plus(self.contraction, self.W, 2 * self.rate)

    @property
    def flat(self) -> bool:
        """Whether the metric is constant."""
        return all(all_zero(slope) for slope in self.W_x)


def along(slopes_by_state: list[Matrix], direction: Matrix) -> Matrix:
    """sum_i v_i dW/dx_i for a column v."""
    total = scaled(0, slopes_by_state[0])
    for slope, (v,) in zip(slopes_by_state, direction, strict=True):
        total = plus(total, [[v * e for e in row] for row in slope])
    return total


def read_plant(spec: Node) -> Plant:
    """What a canonical specification says of the system alone."""
    return _plant(spec)[0]


def _plant(spec: Node) -> tuple[Plant, Reader]:
    _known(spec)
    system = spec["system"]
    states, inputs = tuple(system["states"].texts()), tuple(system["inputs"].texts())
    n, m = len(states), len(inputs)
    if not (0 < m <= n) or len({*states, *inputs, TIME}) != n + m + 1:
        raise wrong("TC603", f"{system.path} must name states, and at most as many inputs, all different")
    reader = Reader(states)
    plant = Plant(
        states=states,
        inputs=inputs,
        f=reader.column(system["f"], n, "set"),
        B=[[reader.term(e, "set") for e in row] for row in rows_of(system["B"], n, m)],
        safe_set=_safe_set(spec["safe_set"], states),
    )
    return plant, reader


def read_system(spec: Node) -> System:
    """The system of a canonical specification."""
    plant, reader = _plant(spec)
    n, m = len(plant.states), len(plant.inputs)
    adaptation = spec["adaptation"]
    uncertainty = spec["uncertainty"]
    bounds = uncertainty.get("bounds")
    start, metric = spec["initial_state"], spec["metric"]
    within, at = start.get("within"), start.get("at")
    A_m, projection = adaptation["A_m"], adaptation["projection"]
    h = uncertainty.get("h")
    horizon = spec["trajectory"].get("horizon")
    found = System(
        states=plant.states,
        inputs=plant.inputs,
        f=plant.f,
        B=plant.B,
        W=[[reader.term(e, "set") for e in row] for row in rows_of(metric["dual_metric"], n, n)],
        rate=metric["rate"].number(),
        h=None if h is None else reader.column(h, m, "time", time=True, kinks=True),
        declared={} if bounds is None else {key: value.number() for key, value in bounds.items()},
        safe_set=plant.safe_set,
        x0=None if at is None else [item.number() for item in sized(at, n)],
        within=None if within is None else within.number(),
        epsilon=spec["tube"]["epsilon"].number(),
        rho_a=spec["tube"]["rho_a"].number(),
        A_m=None if A_m.value == "auto" else [[e.number() for e in row] for row in rows_of(A_m, n, n)],
        smooth=None if projection.value == "hard" else projection["smooth"].number(),
        kernel=_kernel(spec),
        horizon=None if horizon is None else horizon.number(),
        duties=tuple(reader.duties),
    )
    return _sane(spec, found)


def _known(spec: Node) -> None:
    version = spec["tubecert"]
    if version.value != 1 or isinstance(version.value, bool):
        raise wrong(
            "TC602", f"{version.path} is {version.value!r}; this version reads 1", "use a newer tubecert"
        )


def _safe_set(node: Node, states: tuple[str, ...]) -> dict[str, tuple[Fraction, Fraction]]:
    if set(node.mapping()) != set(states):
        raise wrong("TC603", f"{node.path} must give a range for every state")
    found = {}
    for name in states:
        low, high = node[name].pair()
        found[name] = low.number(), high.number()
    return found


def _kernel(spec: Node) -> str:
    options = spec["conditions"]
    chosen = options.get("kernel")
    kernel = "tight" if chosen is None else chosen.text()
    if kernel not in ("tight", "paper"):
        raise wrong("TC603", f"{options.path}.kernel is {kernel!r}, which is not known")
    return kernel


def _sane(spec: Node, s: System) -> System:
    """Signs without which nothing below means what it says."""
    positive = {"metric.rate": s.rate, "tube.epsilon": s.epsilon, "tube.rho_a": s.rho_a}
    if s.horizon is not None:
        positive["trajectory.horizon"] = s.horizon
    for key, value in positive.items():
        if value <= 0:
            raise wrong("TC603", f"{spec.path}.{key} is not positive")
    least: dict[str, Fraction] = {
        **{f"uncertainty.bounds.{k}": v for k, v in s.declared.items()},
        "initial_state.within": s.within or Fraction(0),
    }
    for key, value in least.items():
        if value < 0:
            raise wrong("TC603", f"{spec.path}.{key} is negative")
    if (s.x0 is None) == (s.within is None):
        raise wrong("TC603", f"{spec.path}.initial_state must be `at` or `within`")
    if any(low >= high for low, high in s.safe_set.values()):
        raise wrong("TC603", f"{spec.path}.safe_set has an empty range")
    if not set(s.declared) <= {"h", "h_x", "h_t"} or (s.h is None and set(s.declared) != {"h", "h_x", "h_t"}):
        raise wrong("TC603", f"{spec.path}.uncertainty must give h, or bounds for h, h_x and h_t")
    if s.smooth is not None and s.smooth <= 0:
        raise wrong("TC603", f"{spec.path}.adaptation.projection.smooth is not positive")
    if any(s.W[i][j] is not s.W[j][i] for i in range(len(s.W)) for j in range(i)):
        raise wrong("TC603", f"{spec.path}.metric.dual_metric is not symmetric")
    return s


def read_curve(spec: Node, plan: Node, s: System) -> tuple[Curve, list[Duty]]:
    """The plan: expressions of the specification, or the knots that the certificate holds."""
    trajectory = spec["trajectory"]
    kind = trajectory["kind"].text()
    if kind not in ("equilibrium", "expressions", "csv", "ilqr"):
        raise wrong("TC603", f"{trajectory.path}.kind is {kind!r}, which is not known")
    if kind in ("csv", "ilqr"):
        knots = _knots(trajectory, plan, s)
        horizon = knots.t[-1] if s.horizon is None else s.horizon
        drift = [row[0] for row in s.drift]
        return hermite(knots, drift, s.states, s.inputs, horizon), []
    reader = Reader(())
    keys = ("at", "input") if kind == "equilibrium" else ("x", "u")
    sizes = len(s.states), len(s.inputs)
    x, u = (
        [row[0] for row in reader.column(trajectory[key], size, "time", time=kind == "expressions")]
        for key, size in zip(keys, sizes, strict=True)
    )
    return expressed(x, u, TIME, s.horizon), reader.duties


def _knots(trajectory: Node, plan: Node, s: System) -> Knots:
    data = plan["knots"]
    t, n, m = data["t"].numbers(), len(s.states), len(s.inputs)
    if len(t) < 2 or t[0] != 0 or any(b <= a for a, b in pairwise(t)):
        raise wrong("TC603", f"{data.path}.t must begin at 0 and increase")
    if s.horizon is not None and t[-1] < s.horizon:
        raise wrong("TC603", f"{data.path}.t ends before the horizon")
    rows = {
        key: [[e.number() for e in sized(row, size)] for row in sized(data[key], len(t))]
        for key, size in (("x", n), ("u", m))
    }
    interpolation = plan["interpolation"].text()
    if interpolation not in ("hold", "linear") or interpolation != trajectory["interpolation"].text():
        raise wrong("TC603", f"{plan.path}.interpolation is not that of the specification")
    return Knots(t=t, x=rows["x"], u=rows["u"], held=interpolation == "hold")
