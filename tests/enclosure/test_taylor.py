"""Quadratic enclosures of matrix functions: they contain, converge as claimed, and are exact where affine."""

from fractions import Fraction
from itertools import pairwise

import balls
import numpy as np
import pytest
from balls import evaluate
from flint import arb
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import NAMES, read, texts

from tubecert.enclosure import taylor
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ZERO, derivatives, norm, symbol

SETTINGS = settings(max_examples=40, deadline=None)
x, y, z = (symbol(name) for name in "xyz")


precision = balls.precision(300, quiet=True)


def assert_contains(matrices, function, ends, inner):
    """For linear forms c: <c, G(x)> is at most the largest <c, mid> + <|c|, rad + rest> over the vertices."""
    lo = np.array([[ends[v][0] for v in function.variables]])
    hi = np.array([[ends[v][1] for v in function.variables]])
    e = function.expand(lo, hi)
    rng = np.random.default_rng(0)
    for k, matrix in enumerate(matrices):
        exact = [[evaluate(text, inner) for text in row] for row in matrix]
        spread = e.over_vertices(e.filled(k))[0]
        if not np.isfinite(spread).all() or not np.isfinite(e.mid[k]).all():
            continue
        p, q = spread.shape[-2:]
        for _ in range(4):
            c = np.round(rng.standard_normal((p, q)), 2)
            form = sum((arb(float(c[i, j])) * exact[i][j] for i in range(p) for j in range(q)), start=arb(0))
            best = max(
                float(np.sum(c * m) + np.sum(np.abs(c) * r)) for m, r in zip(e.mid[k][0], spread, strict=True)
            )
            assert not form > arb(best) + abs(arb(best)) * 1e-13 + 1e-290


boxes = st.fixed_dictionaries(
    {name: st.tuples(st.floats(-2, 2), st.sampled_from([0.0, 1e-9, 1e-2, 0.3, 1.0])) for name in NAMES}
)
parts = st.fixed_dictionaries(
    {name: st.sampled_from([Fraction(0), Fraction(1), Fraction(1, 2), Fraction(2, 7)]) for name in NAMES}
)


def assert_expanded(matrices, box, part, *order):
    """The expansion on a box contains what it is of, at a point inside."""
    function = MatrixFunction([[[read(t) for t in row] for row in m] for m in matrices], *order)
    ends = {name: (lo, lo + width) for name, (lo, width) in box.items()}
    inner = {n: Fraction(lo) + part[n] * (Fraction(hi) - Fraction(lo)) for n, (lo, hi) in ends.items()}
    assert_contains(matrices, function, ends, inner)
    return function


@pytest.mark.slow
@given(several=st.lists(texts(leaves=5), min_size=4, max_size=4), box=boxes, part=parts)
@SETTINGS
def test_expansions_contain_the_function(several, box, part):
    matrices = [[several[:2], several[2:]], [[several[0]], [several[3]]]]
    assert_expanded(matrices, box, part)


KINKS = ["abs(x)", "norm(x, y)", "x*norm(x, 2*y)**2", "abs(x - y) + y**2", "exp(abs(x))*norm(x, y, 1/2)"]


@pytest.mark.slow
@pytest.mark.parametrize("text", KINKS)
@given(box=boxes, part=parts)
@settings(max_examples=30, deadline=None)
def test_expansions_of_kinks_and_their_gradients_contain_them(text, box, part):
    matrices = [[[text, "x*y"]]]
    function = assert_expanded(matrices, box, part)
    assert function._order == 1
    gradient = MatrixFunction([[derivatives([read(text)], "x")]])
    assert gradient._order == 0


@pytest.mark.parametrize("order", [0, 1, 2])
@given(several=st.lists(texts(leaves=5), min_size=2, max_size=2), box=boxes, part=parts)
@settings(max_examples=25, deadline=None)
def test_lower_orders_contain_too(order, several, box, part):
    assert_expanded([[several]], box, part, order)


def overestimates(e, widths, order=2, names=("x", "y")):
    """How far the largest vertex value plus rest exceeds the densely sampled maximum, by width of the box."""
    function = MatrixFunction([[[e]]], order)
    centre = np.array([0.4, -0.3])[: len(names)]
    assert function.variables == names
    found = []
    for w in widths:
        lo, hi = (centre - w / 2)[None], (centre + w / 2)[None]
        expansion = function.expand(lo, hi)
        upper = (expansion.mid[0] + expansion.over_vertices(expansion.filled(0))).max()
        axes = [np.linspace(a, b, 41) for a, b in zip(lo[0], hi[0], strict=True)]
        points = np.stack([g.ravel() for g in np.meshgrid(*axes)], axis=1)
        found.append(upper - function.floats(points)[0].max())
    return np.array(found)


@pytest.mark.parametrize(
    ("text", "order", "least"),
    [("sin(3*x)*exp(y)", 2, 1.9), ("x**3*y**2 + cos(x*y)", 2, 1.9), ("1/(x + y**2 + 2)", 2, 1.9),
     ("sin(3*x)*exp(y)", 1, 0.8), ("norm(x, y) - x", 2, 0.8)],
)  # fmt: skip
def test_the_order_of_convergence_is_as_claimed(text, order, least):
    widths = 2.0 ** -np.arange(2, 8)
    excess = overestimates(read(text), widths, order)
    assert np.all(excess > 0)
    slope = np.polyfit(np.log(widths), np.log(excess), 1)[0]
    assert slope > least


def test_affine_variables_are_exact():
    e = [[[x * y + 2 * x - y + z * x * y * Fraction(1, 3), y - z], [z * y, x]]]
    function = MatrixFunction(e)
    assert function._affine == ("x", "y", "z")
    lo, hi = np.array([[-1.0, 2.0, 0.5]]), np.array([[3.0, 5.0, 0.75]])
    expansion = function.expand(lo, hi)
    assert expansion.signs.shape == (8, 3)
    assert not expansion.rest[0].any()
    assert expansion.rad[0].max() < 1e-13
    for v, signs in enumerate(expansion.signs):
        at = np.where(signs > 0, hi, lo)
        assert np.allclose(function.floats(at)[0][0], expansion.mid[0][0, v], atol=1e-13)


def test_affine_variables_multiply_curvature_at_their_ends():
    function = MatrixFunction([[[y * x**2]]])
    assert function._affine == ("y",)
    expansion = function.expand(np.array([[-1.0, -2.0]]), np.array([[1.0, 3.0]]))
    spread = expansion.over_vertices(expansion.filled(0))
    assert (expansion.mid[0] + spread).max() >= 3
    assert (expansion.mid[0] - spread).min() <= -2


def test_more_variables_than_vertices_are_bounded_by_their_slopes():
    names = [symbol(f"v{i}") for i in range(11)]
    e = sum((v**2 * (i + 1) for i, v in enumerate(names)), start=ZERO)
    linear = sum((w * v for v, w in pairwise(names)), start=ZERO)
    for case in (e, linear):
        function = MatrixFunction([[[case]]])
        lo, hi = np.full((1, 11), -0.5), np.full((1, 11), 1.0)
        expansion = function.expand(lo, hi)
        assert len(expansion.signs) <= 2**taylor.MOST_VERTICES
        upper = (expansion.mid[0] + expansion.over_vertices(expansion.filled(0))).max()
        assert upper >= function.floats(hi)[0].max()
        assert upper <= 4 * function.floats(hi)[0].max()


def test_a_function_without_variables():
    function = MatrixFunction([[[ZERO + 3]]])
    expansion = function.expand(np.zeros((5, 0)), np.zeros((5, 0)))
    assert expansion.mid[0].shape == (5, 1, 1, 1)
    assert np.all(np.abs(expansion.mid[0] - 3) <= expansion.rad[0])


def test_what_is_undefined_on_the_box_is_not_bounded():
    function = MatrixFunction([[[1 / x, y]]])
    expansion = function.expand(np.array([[-1.0, 0.0]]), np.array([[1.0, 1.0]]))
    total = expansion.mid[0] + expansion.over_vertices(expansion.filled(0))
    assert not np.isfinite(total[..., 0, 0]).any()


def test_a_reduced_remainder_is_noticed():
    # 1/2 of the second derivative is needed in full: a quarter is not enough
    text = "x**2"
    function = MatrixFunction([[[read(text)]]])
    lo, hi = np.array([[-1.0]]), np.array([[1.0]])
    e = function.expand(lo, hi)
    assert e.mid[0].max() + e.rest[0].max() >= 1
    assert e.mid[0].max() + 0.98 * e.rest[0].max() < 1


def test_norms_are_lipschitz_and_not_expanded_through_zero():
    function = MatrixFunction([[[norm([x, y])]]])
    expansion = function.expand(np.array([[-1.0, -1.0]]), np.array([[1.0, 1.0]]))
    total = expansion.mid[0] + expansion.over_vertices(expansion.filled(0))
    assert total.max() >= np.sqrt(2)
