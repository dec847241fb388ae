"""The two systems of the tests, as models and as independent formulas that run on floats, Fractions and balls."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from tubecert.enclosure.tape import Tape
from tubecert.expression import constant, cos, norm, parse, sin, symbol
from tubecert.expression.matrix import identity
from tubecert.model import ControlAffineModel
from tubecert.trajectory import Plan, constant_plan

Rows = list[list[Any]]
THREE = ("x1", "x2", "x3")
TWO = ("x1", "x2")

# -- three states: W = Wc + Wl x1 + Wq x1^2, B = (0, 0, 1) ------------------------------------------------------

WC = [
    ["0.20365", "0.00015", "-0.00566"],
    ["0.00015", "0.21671", "-0.00566"],
    ["-0.00566", "-0.00566", "0.21607"],
]
WL = [["0", "-0.4073", "-0.00133"], ["-0.4073", "-0.00061", "0.00998"], ["-0.00133", "0.00998", "0.06785"]]
WQ = [["0", "0", "0.00053"], ["0", "0.81459", "0.00308"], ["0.00053", "0.00308", "0.00343"]]
PRINTED_THREE = [
    ["0.2", "-0.41*x1", "-0.01"],
    ["-0.41*x1", "0.81*x1**2 + 0.22", "0.01*x1 - 0.01"],
    ["-0.01", "0.01*x1 - 0.01", "0.07*x1 + 0.22"],
]
F_THREE = ("-x1 + x3", "x1**2 - 2*x1*x3 - x2 + x3", "-x2")
BOX_THREE = ((Fraction(-1, 10), Fraction(1, 10)),) * 3

W_TWO = [["4.25828", "-0.93423"], ["-0.93423", "3.76692"]]
PRINTED_TWO = [["4.26", "-0.93"], ["-0.93", "3.77"]]
F_TWO = ("-x1 + 2*x2", "-0.25*x2**3 - 3*x1 + 4*x2")
BOX_TWO = ((Fraction(-6), Fraction(6)),) * 2


def polynomial_three() -> list[list[str]]:
    """W of the three-state system as texts."""
    return [[f"{WC[i][j]} + ({WL[i][j]})*x1 + ({WQ[i][j]})*x1**2" for j in range(3)] for i in range(3)]


def matrix_of(rows: Sequence[Sequence[str]], names: Sequence[str]) -> tuple[tuple[Any, ...], ...]:
    symbols = {name: symbol(name) for name in names}
    return tuple(tuple(parse(e, symbols=symbols).expression for e in row) for row in rows)


def plain_model(states: Sequence[str], f: Sequence[str], B: Sequence[Sequence[str]]) -> ControlAffineModel:
    """x' = f + B u without a metric."""
    m = len(B[0])
    return ControlAffineModel(
        states=tuple(states),
        inputs=("u",) if m == 1 else tuple(f"u{j}" for j in range(m)),
        f=matrix_of([f], states)[0],
        B=matrix_of(B, states),
        W=(),
        rate=Fraction(0),
        h=None,
    )


def model_of(
    states: Sequence[str], f: Sequence[str], B: Any, W: Any = None, rate: str = "1", *, h: Any = None
) -> ControlAffineModel:
    """x' = f + B u, with one input u or inputs u1, u2, ...; without W that is the identity."""
    names = tuple(states)
    count = len(B[0])
    return ControlAffineModel(
        states=names,
        inputs=("u",) if count == 1 else tuple(f"u{j + 1}" for j in range(count)),
        f=matrix_of([f], names)[0],
        B=matrix_of(B, names),
        W=identity(len(names)) if W is None else matrix_of(W, names),
        rate=Fraction(rate),
        h=h,
    )


def at_rest(*x: str, inputs: int = 1) -> Plan:
    """The plan that stays at a point, with no input."""
    return constant_plan([Fraction(e) for e in x], [Fraction(0)] * inputs, None)


def three_state(
    W: Any = None, rate: str = "0.9999", f: Sequence[str] = F_THREE, B: Any = None
) -> ControlAffineModel:
    h = (constant(Fraction(1, 10)) * sin(2 * symbol("t")),)
    return model_of(THREE, f, B or [["0"], ["0"], ["1"]], polynomial_three() if W is None else W, rate, h=h)


def two_state(W: Any = None, rate: str = "1.74") -> ControlAffineModel:
    t, x1, x2 = symbol("t"), symbol("x1"), symbol("x2")
    h = (-2 * sin(2 * t) - constant(Fraction(1, 10)) * norm([x1, x2]),)
    return model_of(TWO, F_TWO, [["0.5"], ["-2"]], W_TWO if W is None else W, rate, h=h)


def scaled(rows: Sequence[Sequence[str]], factor: str) -> list[list[str]]:
    return [[f"{factor}*({e})" for e in row] for row in rows]


def resting() -> Plan:
    """The three-state system at the origin."""
    return at_rest("0", "0", "0")


def moving() -> Plan:
    """A plan of the two-state system that goes around for 5 s (it does not satisfy the dynamics)."""
    t = symbol("t")
    return Plan((2 * cos(t), -2 * sin(t) + constant(Fraction(1, 2)) * cos(2 * t)), (3 * sin(t),), Fraction(5))


def three_forms(x: Sequence[Any], q: Any) -> dict[str, Any]:
    """f, f_x, W, dW/dx_1 and F_0 = -d_f W + f_x W + W f_x' of the three-state system, written out by hand."""
    x1, x2, x3 = x
    f = [x3 - x1, x1 * x1 - 2 * x1 * x3 - x2 + x3, -x2]
    one, zero = q("1"), q("0")
    f_x = [[-one, zero, one], [2 * x1 - 2 * x3, -one, one - 2 * x1], [zero, -one, zero]]
    W = [[q(WC[i][j]) + q(WL[i][j]) * x1 + q(WQ[i][j]) * x1 * x1 for j in range(3)] for i in range(3)]
    W_1 = [[q(WL[i][j]) + 2 * q(WQ[i][j]) * x1 for j in range(3)] for i in range(3)]
    product = times(f_x, W)
    F0 = [[product[i][j] + product[j][i] - f[0] * W_1[i][j] for j in range(3)] for i in range(3)]
    return {"f": f, "f_x": f_x, "W": W, "W_1": W_1, "F0": F0}


def two_forms(x: Sequence[Any], q: Any) -> dict[str, Any]:
    """f, f_x and F_0 of the two-state system, written out by hand."""
    x1, x2 = x
    f = [2 * x2 - x1, 4 * x2 - 3 * x1 - q("0.25") * x2 * x2 * x2]
    f_x = [[q("-1"), q("2")], [q("-3"), q("4") - q("0.75") * x2 * x2]]
    W = [[q(e) for e in row] for row in W_TWO]
    product = times(f_x, W)
    F0 = [[product[i][j] + product[j][i] for j in range(2)] for i in range(2)]
    return {"f": f, "f_x": f_x, "W": W, "F0": F0}


def values(rows: Sequence[Sequence[Any]], names: Sequence[str], points: Any) -> Any:
    """A matrix of expressions at points (N, n), in plain floats: (N, rows, columns)."""
    tape = Tape([e for row in rows for e in row], tuple(names))
    return tape.run_floats(list(points.T), (len(points),)).T.reshape(len(points), len(rows), -1)


def times(a: Rows, b: Rows) -> Rows:
    return [[sum(a[i][k] * b[k][j] for k in range(len(b))) for j in range(len(b[0]))] for i in range(len(a))]


SMALL = """
tubecert: 1
name: small
system:
  states: [x, y]
  inputs: [u]
  f: ["-x + y", "-y + 0.3*sin(x)"]
  B: [[0], [1]]
safe_set: {x: [-1, 1], y: [-1, 1]}
uncertainty: {h: ["0.1*sin(t) + 0.05*x"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
initial_state: {at: [0.05, 0]}
metric: {rate: 0.8, dual_metric: [[1, "-0.3"], ["-0.3", 2]]}
tube: {epsilon: 0.2, rho_a: 0.1}
adaptation: {A_m: -10}
"""

DISTURBED = 'disturbance: {E: [["0.1"], ["1 + 0.1*x"]], bound: 0.01}\n'

# the same in a wind, of which more than h knows is left
BLOWN = SMALL + DISTURBED

# on a plan that comes to rest, with an output, in a wind, with limits, for certificate B
COMING_TO_REST = (
    SMALL.replace(
        "{kind: equilibrium, at: [0, 0], input: [0]}",
        '{kind: expressions, horizon: 2, x: ["0.3*exp(-2*t)", "-0.3*exp(-2*t)"],'
        ' u: ["0.3*exp(-2*t) - 0.3*sin(0.3*exp(-2*t))"]}',
    )
    .replace("at: [0.05, 0]", "at: [0.31, -0.3]")
    .replace("  B: ", "  outputs: {s: x - 0.5*y}\n  B: ")
    .replace("0.1*sin(t) + 0.05*x", "0.6*sin(3*t) + 0.3*x*(1 + y)")
    .replace("adaptation: {A_m: -10}\n", "")
    + DISTURBED
    + "limits: {u: [-3, 3]}\nconditions: {decides: B}\n"
)

# the smallest: a line that is known well
SCALAR = """
tubecert: 1
name: scalar
system: {states: [x], inputs: [u], f: ["-x + 0.1*sin(x)"], B: [[1]]}
safe_set: {x: [-2, 2]}
uncertainty: {h: ["0.2*sin(t)"]}
trajectory: {kind: equilibrium, at: [0]}
metric: {rate: 0.5, dual_metric: [[1]]}
tube: {epsilon: 0.5, rho_a: 0.5}
"""

# one with a parameter, adapted to
ONE = """tubecert: 1
name: one
system: {states: [x], inputs: [u], parameters: {k: 1}, f: [-k*x], B: [[1]]}
safe_set: {x: [-1, 1]}
uncertainty: {h: [0.1*sin(t)]}
trajectory: {kind: equilibrium, at: [0], horizon: 10}
initial_state: {at: [0.05]}
metric: {rate: 0.5, dual_metric: [[1]]}
tube: {epsilon: 0.2, rho_a: 0.1}
adaptation: {A_m: -1}
"""

# a mass on a spring with friction, at rest for a while
FLAT = """
tubecert: 1
name: flat
system: {states: [p, v], inputs: [u], f: [v, "-p - v"], B: [[0], [1]]}
safe_set: {p: [-2, 2], v: [-2, 2]}
uncertainty: {h: ["0.2*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], horizon: 4}
initial_state: {at: [0.05, 0]}
metric: {rate: 0.4, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.2, rho_a: 0.2}
"""

# any plan of the two-state system in a box
FAMILY_TWO = """
tubecert: 1
name: any_plan
system:
  states: [x1, x2]
  inputs: [u]
  f: [-x1 + 2*x2, -0.25*x2**3 - 3*x1 + 4*x2]
  B: [[0.5], [-2]]
safe_set: {x1: [-6, 6], x2: [-6, 6]}
uncertainty: {h: ["-2*sin(2*t) - 0.1*norm(x1, x2)"]}
trajectory: {kind: any, x: {x1: [-1, 1], x2: [-0.5, 0.5]}, u: {u: [-1, 1]}, defect: 0.01}
initial_state: {within: 0.05}
metric: {rate: 1.74, dual_metric: [["4.25828", "-0.93423"], ["-0.93423", "3.76692"]]}
tube: {epsilon: 0.6, rho_a: 0.1}
"""
