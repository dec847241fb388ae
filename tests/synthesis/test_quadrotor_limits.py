"""Why the published box of the quadrotor has no constant metric: a certificate of infeasibility, checked exactly.

With G = d(vdot)/d(thrust, phi, theta) and X = W_uv, C2 in the rows of v asks G X + X'G' + 2 rate W_vv <= 0 at every
point. Matrices Z_i >= 0, not all zero, with sum_i Z_i G_i = 0 give 2 rate tr(W_vv sum_i Z_i) <= 0: a contradiction.
"""

from fractions import Fraction as Q
from itertools import product

import numpy as np
import pytest
import sympy as sp
from oracle import optimum

from tubecert.synthesis import cegis

T, phi, theta = sp.symbols("T phi theta")
VDOT = sp.Matrix([-T * sp.sin(theta), T * sp.cos(theta) * sp.sin(phi), -T * sp.cos(theta) * sp.cos(phi)])
THRUSTS = (sp.Rational("4.9033"), sp.Rational("19.6132"))


def exact_slopes(half_tangent):
    """G at thrusts from g/2 to 2 g and tilts of -a, 0, a, tan(a/2) = `half_tangent`: rational matrices."""
    h = sp.Rational(half_tangent)
    turned = {k: (2 * k * h / (1 + h**2), (1 - h**2) / (1 + h**2)) for k in (-1, 1)}
    circle = {0: (sp.Integer(0), sp.Integer(1)), **turned}
    G = VDOT.jacobian([T, phi, theta])
    slopes = []
    for thrust, i, j in product(THRUSTS, (-1, 0, 1), (-1, 0, 1)):
        functions = (sp.sin(phi), sp.cos(phi), sp.sin(theta), sp.cos(theta), T)
        slopes.append(G.subs(dict(zip(functions, (*circle[i], *circle[j], thrust), strict=True))))
    return slopes


def certificate(slopes):
    """Z_i with sum_i Z_i G_i = 0 exactly, from floats with the largest least eigenvalue that a solver finds."""
    import cvxpy as cp

    floats = [np.array(G.tolist(), dtype=float) / 10 for G in slopes]
    Z, t = [cp.Variable((3, 3), symmetric=True) for _ in floats], cp.Variable()
    total = sum(z @ g for z, g in zip(Z, floats, strict=True))
    conditions = [*(z >> t * np.eye(3) for z in Z), sum(cp.trace(z) for z in Z) == 1, total == 0]
    task = cp.Problem(cp.Maximize(t), conditions)
    assert optimum(task) is not None
    near = [[sp.Rational(Q(float(x)).limit_denominator(10**7)) for x in z.value.flat] for z in Z]
    rounded = [(z + z.T) / 2 for z in (sp.Matrix(3, 3, entries) for entries in near)]
    # the rounding error of the sum is taken out exactly, by the least change of all Z_i
    i, j = np.triu_indices(3)
    units = []
    for a, b in zip(i, j, strict=True):
        unit = sp.zeros(3, 3)
        unit[a, b] = unit[b, a] = 1
        units.append(unit)
    rows = sp.Matrix.hstack(*[(unit * G).reshape(9, 1) for G in slopes for unit in units])
    error = sum((z * G for z, G in zip(rounded, slopes, strict=True)), start=sp.zeros(3, 3)).reshape(9, 1)
    change = rows.T * (rows * rows.T).LUsolve(error)
    moves = [[change[6 * k + u] * unit for u, unit in enumerate(units)] for k in range(len(rounded))]
    return [z - sum(own, start=sp.zeros(3, 3)) for z, own in zip(rounded, moves, strict=True)]


def is_certificate(Z, slopes):
    total = sum((z * G for z, G in zip(Z, slopes, strict=True)), start=sp.zeros(3, 3))
    return total == sp.zeros(3, 3) and all(z[:k, :k].det() > 0 and z == z.T for z in Z for k in (1, 2, 3))


@pytest.mark.slow
def test_no_constant_metric_on_the_published_box():
    slopes = exact_slopes("4/7")  # 59.5 degrees, inside the published 60
    assert 2 * np.arctan(4 / 7) < np.pi / 3
    Z = certificate(slopes)
    assert is_certificate(Z, slopes)
    Z[0] = -Z[0]
    assert not is_certificate(Z, slopes)


@pytest.mark.slow
def test_where_there_is_a_metric_there_is_no_certificate():
    slopes = exact_slopes("4/10")  # 43.6 degrees
    assert not is_certificate(certificate(slopes), slopes)


@pytest.mark.slow
def test_synthesis_says_the_same():
    from test_cegis import QUADROTOR, problem, quadrotor_box

    for angle, feasible in (("1.0471975", False), ("0.761", True)):
        asked = problem(QUADROTOR, quadrotor_box(angle), 0.1)
        assert bool(cegis.propose(asked).feasible) is feasible
