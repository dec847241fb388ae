"""Affine forms against exact arithmetic: what they enclose, and how fast they converge."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import fractions
from systems import matrix_of
from tubecert.enclosure.forms import Form, Forms, contract, least_norm, stacked, thin, unfolded_norm

NAMES = ("x", "y")
G = [["x*y - 1", "x**2"], ["3*y", "x - y**3"]]
H = [["y", "1/3"], ["x*y**2", "2 - x"]]


def exact(rows, x, y):
    """The rows at exact points."""
    return [[eval(e, {"x": x, "y": y, "Fraction": Fraction}) for e in row] for row in rows]


def times(a, b):
    return [
        [sum(p * q for p, q in zip(row, column, strict=True)) for column in zip(*b, strict=True)] for row in a
    ]


def over(rows, lo, hi):
    forms = Forms([matrix_of(rows, NAMES)])
    assert forms.variables == NAMES
    return forms.over(np.array([lo]), np.array([hi]))[0]


def contains(form: Form, e, value) -> bool:
    """Whether exact values (rows) lie in the form at the position e of the box, in exact arithmetic."""
    for index in np.ndindex(form.radius.shape[1:]):
        parts = [Fraction(float(part[(0, *index)])) for part in form.parts]
        middle = parts[0] + sum(c * s for c, s in zip(parts[1:], e, strict=True))
        if abs(value[index[0]][index[1]] - middle) > Fraction(float(form.radius[(0, *index)])):
            return False
    return True


positions = st.tuples(*[fractions(-1, 1, 50)] * 2)
numbers = st.floats(-2, 2, allow_nan=False, allow_subnormal=False)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(numbers, numbers, st.floats(1e-6, 1), st.floats(1e-6, 1), positions)
def test_a_product_of_forms_contains_the_product(x, y, rx, ry, e):
    lo, hi = [x - rx, y - ry], [x + rx, y + ry]
    g, h = over(G, lo, hi), over(H, lo, hi)
    centre = [Fraction(0.5 * a + 0.5 * b) for a, b in zip(lo, hi, strict=True)]
    reach = [Fraction(b) - c for b, c in zip(hi, centre, strict=True)]
    at = [c + s * r for c, s, r in zip(centre, e, reach, strict=True)]
    own = [[e.replace("1/3", "Fraction(1, 3)") for e in row] for row in H]
    # half the width in floats is not the exact one by a rounding: the position along the axis is as near
    wide = [Form(f.parts, f.radius + 1e-15 * np.abs(f.parts).sum(axis=0)) for f in (g, h)]
    assert contains(wide[0], e, exact(G, *at))
    assert contains(contract("ij,jk->ik", *wide), e, times(exact(G, *at), exact(own, *at)))
    both = exact(G, *at), exact(own, *at)
    total = [[p - q for p, q in zip(a, b, strict=True)] for a, b in zip(*both, strict=True)]
    assert contains(wide[0] - wide[1], e, total)
    assert contains(wide[0].turned(1, 0), e, [list(row) for row in zip(*exact(G, *at), strict=True)])


def test_the_rest_of_a_product_shrinks_with_the_square_of_the_box():
    rest = []
    for r in (0.1, 0.05):
        g, h = (over(rows, [0.3 - r, -0.4 - r], [0.3 + r, -0.4 + r]) for rows in (G, H))
        rest.append(contract("ij,jk->ik", g, h).radius.max())
    assert rest[1] < 0.3 * rest[0]


@pytest.mark.parametrize("variables", [1, 3, 7])
def test_norms_over_boxes_are_above_those_of_points(variables):
    rng = np.random.default_rng(variables)
    parts = rng.standard_normal((1 + variables, 4, 2, 3, 3))
    parts[1:] *= 0.1
    form = Form(parts, 0.01 * rng.random((4, 2, 3, 3)))
    value, grown = unfolded_norm(form, (0, 1))
    assert grown.shape == (4, variables)
    for _ in range(200):
        e = rng.uniform(-1, 1, variables)
        tensor = (
            parts[0]
            + np.tensordot(e, parts[1:], axes=1)
            + form.radius * rng.uniform(-1, 1, form.radius.shape)
        )
        assert (np.linalg.norm(tensor.reshape(4, 6, 3), 2, axis=(-2, -1)) <= value).all()


def test_at_a_point_the_norm_is_enclosed():
    values = np.arange(12.0).reshape(1, 2, 2, 3)
    found = least_norm(thin(values, 2), (0,))
    norm = np.linalg.norm(values.reshape(2, 6), 2)
    assert found.lo[0] <= norm <= found.hi[0] <= norm * (1 + 1e-12)
    assert stacked([thin(values, 2)] * 3).radius.shape == (1, 3, 2, 2, 3)


def test_what_is_not_a_number_is_no_bound():
    form = thin(np.full((1, 2, 2), np.nan), 1)
    with np.errstate(all="ignore"):
        assert unfolded_norm(form, (0,))[0][0] == np.inf
