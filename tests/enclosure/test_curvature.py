"""The curvature that an enclosure keeps at the centre of its box: what every proof rests on, against exact rationals.

The oracle is a polynomial as a table of rational coefficients, differentiated and evaluated without the package: of a
cubic the second derivatives are affine, so that their exact ranges, and with them the docstring's theorem, are known.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import combinations, product
from math import prod

import balls
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import fractions
from systems import values

from tubecert.bounds.feedback import tangents
from tubecert.enclosure import taylor
from tubecert.enclosure.objective import MetricNorm, SumOfNorms, Target
from tubecert.enclosure.pencil import Pencil, ProjectedPencil, SumOfPencils, WeightedPencil, Weights, scalar
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ZERO, Expression, constant, exp, norm, sin, sqrt, symbol
from tubecert.expression.matrix import combine, identity, multiply, transpose

QUICK = settings(max_examples=20, deadline=None)
HALF, QUARTER = Fraction(1, 2), Fraction(1, 4)
Power = tuple[int, ...]


precision = balls.precision(53, quiet=True)


@dataclass(frozen=True)
class Polynomial:
    """Coefficients by exponents; its variables are v0, v1, ... in this order."""

    terms: Mapping[Power, Fraction]

    def __call__(self, point):
        return sum(
            (c * prod(x**k for x, k in zip(point, p, strict=True)) for p, c in self.terms.items()),
            Fraction(0),
        )

    def slope(self, i):
        lowered = {}
        for p, c in self.terms.items():
            if p[i]:
                q = (*p[:i], p[i] - 1, *p[i + 1 :])
                lowered[q] = lowered.get(q, Fraction(0)) + c * p[i]
        return Polynomial(lowered)

    def range(self, lo, hi):
        """The exact range of one that is affine: midpoint and radius."""
        values = [self(corner) for corner in product(*zip(lo, hi, strict=True))]
        return (max(values) + min(values)) / 2, (max(values) - min(values)) / 2

    @property
    def expression(self) -> Expression:
        total = ZERO
        for p, c in self.terms.items():
            term = constant(c)
            for i, k in enumerate(p):
                term = term * symbol(f"v{i}") ** k if k else term
            total = total + term
        return total


def support(e, k, c):
    """The largest value of <c, G> that the enclosure allows, exactly."""
    best = None
    for v in range(e.mid[k].shape[1]):
        total = Fraction(0)
        for place, weight in c.items():
            end = v % e.rad[k].shape[1]
            spread = Fraction(float(e.rad[k][0, end][place]))
            spread += sum(Fraction(float(part[0, end][place])) for part in e.rest[k])
            total += weight * Fraction(float(e.mid[k][0, v][place])) + abs(weight) * spread
        best = total if best is None or total > best else best
    return best


def powers(dim, degree):
    return [p for p in product(range(degree + 1), repeat=dim) if sum(p) <= degree]


@cache
def polynomials(dim, degree, *, curved=True):
    """Coefficients that are no floats; `curved`: with every square."""

    def finished(values):
        terms = {p: c for p, c in zip(powers(dim, degree), values, strict=True) if c}
        for i in range(dim if curved else 0):
            square = tuple(2 * (i == j) for j in range(dim))
            terms[square] = terms.get(square) or Fraction(1, 3)
        return Polynomial(terms)

    count = len(powers(dim, degree))
    return st.lists(fractions(-3, 3, 7), min_size=count, max_size=count).map(finished)


ends = st.tuples(st.floats(-2, 2), st.sampled_from([0.0, 1e-12, 1e-5, 0.1, 1.0, 3.0]))
shares = st.sampled_from([Fraction(0), Fraction(1), HALF, QUARTER, Fraction(2, 7), Fraction(9, 10)])


@cache
def placed(dim):
    """A box, and an exact point of it; strategies that are made anew for every example take longer than the tests."""

    def drawn(sides):
        lo, hi = [a for (a, _), _ in sides], [a + width for (a, width), _ in sides]
        parts = (part for _, part in sides)
        exact = [Fraction(a) + q * (Fraction(b) - Fraction(a)) for a, b, q in zip(lo, hi, parts, strict=True)]
        return lo, hi, exact

    return st.lists(st.tuples(ends, shares), min_size=dim, max_size=dim).map(drawn)


@pytest.mark.slow
@pytest.mark.parametrize("dim", [1, 2, 3])
@given(data=st.data())
@QUICK
def test_the_enclosure_is_that_of_the_theorem(dim, data):
    """Mid part and rest of a cubic, vertex by vertex and cause by cause, are those that the docstring states."""
    p = data.draw(polynomials(dim, 3))
    lo, hi, _ = data.draw(placed(dim))
    function = MatrixFunction([[[p.expression]]])
    assume(len(function._curved) == dim)  # a square may be lost beside a cube
    e = function.expand(np.array([lo]), np.array([hi]))
    a, b = [Fraction(x) for x in lo], [Fraction(x) for x in hi]
    c, r = [(x + y) / 2 for x, y in zip(a, b, strict=True)], [(y - x) / 2 for x, y in zip(a, b, strict=True)]
    H = {(i, j): p.slope(i).slope(j).range(a, b) for i in range(dim) for j in range(dim)}
    size = 1 + sum(abs(q) * 3**3 for q in p.terms.values())
    near = Fraction(1, 10**11) * size
    for v, signs in enumerate(e.signs):
        d = [int(s) * q for s, q in zip(signs, r, strict=True)]
        mid = p(c) + sum(d[i] * p.slope(i)(c) for i in range(dim))
        mid += sum(d[i] * d[j] * H[i, j][0] for i in range(dim) for j in range(i + 1, dim))
        mid += sum(r[i] ** 2 * QUARTER * H[i, i][0] for i in range(dim))
        assert abs(Fraction(float(e.mid[0][0, v, 0, 0])) - mid) <= near
        assert Fraction(float(e.rad[0][0, 0, 0, 0])) <= near
        for i in range(dim):
            rest = r[i] ** 2 * QUARTER * abs(H[i, i][0])
            rest += HALF * sum((r[i] * r[j] * H[i, j][1] for j in range(dim)), Fraction(0))
            assert abs(Fraction(float(e.rest[0][i, 0, 0, 0, 0])) - rest) <= near


@pytest.mark.slow
@pytest.mark.parametrize(("dim", "degree"), [(1, 4), (2, 3), (3, 2), (3, 3)])
@given(data=st.data())
@QUICK
def test_every_value_lies_in_the_hull_of_the_vertices(dim, degree, data):
    """Two polynomials side by side: every linear form of them is below its support over the vertices, exactly."""
    pair = [data.draw(polynomials(dim, degree, curved=False)) for _ in range(2)]
    lo, hi, point = data.draw(placed(dim))
    function = MatrixFunction([[[p.expression for p in pair]]])
    own = [int(name[1:]) for name in function.variables]
    e = function.expand(np.array([lo])[:, own], np.array([hi])[:, own])
    values = [p(point) for p in pair]
    for weights in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -2), (-3, 1)):
        c = {(0, k): Fraction(w) for k, w in enumerate(weights)}
        assert sum(w * q for w, q in zip(weights, values, strict=True)) <= support(e, 0, c)


@pytest.mark.slow
def test_roundings_of_products_and_sums_are_covered():
    """Bilinear forms whose squares are negligible: nothing but the slack covers the sums over many vertices."""
    rng = np.random.default_rng(4)
    dim, count = 5, 15
    pairs = [(i, j) for i in range(dim) for j in range(i + 1, dim)]
    for scale in (1.0, 1e-140, 1e140):
        terms = {
            tuple(int(k in (i, j)) for k in range(dim)): Fraction(int(rng.integers(1, 10**6)), 999_983)
            for i, j in pairs
        }
        for i in range(dim):
            terms[tuple(int(k == i) for k in range(dim))] = Fraction(
                int(rng.integers(-(10**6), 10**6)), 999_979
            )
            terms[tuple(2 * (k == i) for k in range(dim))] = Fraction(1, 10**40)
        p = Polynomial({q: c * Fraction(scale) for q, c in terms.items()})
        function = MatrixFunction([[[p.expression]]])
        assert len(function._curved) == dim
        lo = rng.uniform(-2, 2, (count, dim))
        hi = lo + rng.uniform(0, 1, (count, dim))
        e = function.expand(lo, hi)
        spread = e.over_vertices(e.filled(0))
        for n in range(count):
            reach = [
                (Fraction(float(m)) - Fraction(float(s)), Fraction(float(m)) + Fraction(float(s)))
                for m, s in zip(e.mid[0][n, :, 0, 0], spread[n, :, 0, 0], strict=True)
            ]
            corners = [p(corner) for corner in product(*exact_ends(lo[n], hi[n]))]
            assert max(corners) <= max(high for _, high in reach)
            assert min(corners) >= min(low for low, _ in reach)


def test_boxes_of_one_unit_in_the_last_place_reach_both_ends():
    """Their centre is one of the ends: the radius is the distance to the other."""
    for lo in (1.0, float(np.nextafter(1.0, 2.0)), -1.5):
        hi = float(np.nextafter(lo, np.inf))
        e = x - Fraction(lo)
        found = MatrixFunction([[[10**10 * e + e**2]]]).expand(np.array([[lo]]), np.array([[hi]]))
        for end in (lo, hi):
            d = Fraction(end) - Fraction(lo)
            assert -support(found, 0, {(0, 0): Fraction(-1)}) <= 10**10 * d + d**2
            assert 10**10 * d + d**2 <= support(found, 0, {(0, 0): Fraction(1)})


def test_what_a_sum_over_vertices_swallows_is_in_the_slack():
    """Twelve products of 0.9 half ulps are lost beside one of 1: more than the radii were rounded up by."""
    dim = 8
    half_ulp = 2.0**-53
    r = np.array([1.0, 1.0, *[0.9 * half_ulp] * (dim - 2)])
    terms = {tuple(int(k in pair) for k in range(dim)): Fraction(1) for pair in combinations(range(dim), 2)}
    terms |= {tuple(2 * (k == i) for k in range(dim)): Fraction(1, 10**40) for i in range(dim)}
    p = Polynomial(terms)
    e = MatrixFunction([[[p.expression]]]).expand(-r[None], r[None])
    assert p([Fraction(float(q)) for q in r]) <= support(e, 0, {(0, 0): Fraction(1)})


def exact_ends(lo, hi):
    return [(Fraction(float(a)), Fraction(float(b))) for a, b in zip(lo, hi, strict=True)]


@pytest.mark.parametrize("width", [0.0, 5e-324, 1e-308, 1e-200, 1e-160, 1e-150, 1e-20])
@pytest.mark.parametrize("size", [1e-200, 1.0, 1e100, 1e250])
def test_thin_boxes_about_zero_lose_nothing_to_underflow(width, size):
    """The square of a radius may underflow where its curvature is large enough to count."""
    p = Polynomial(
        {(2, 0): Fraction(size), (1, 1): Fraction(size) * 3, (0, 2): -Fraction(size), (3, 0): Fraction(size)}
    )
    function = MatrixFunction([[[p.expression]]])
    lo, hi = np.array([[-width, -width]]), np.array([[width, width]])
    e = function.expand(lo, hi)
    for corner in product((Fraction(-width), Fraction(0), Fraction(width)), repeat=2):
        for sign in (1, -1):
            reached = support_or_inf(e, sign)
            assert sign * p(corner) <= reached
    assert not np.isnan(e.rest[0]).any()


def support_or_inf(e, sign):
    parts = (e.mid[0], e.rad[0], e.rest[0])
    if not all(np.isfinite(part).all() for part in parts):
        return float("inf")
    return support(e, 0, {(0, 0): Fraction(sign)})


def top(e):
    return float((e.mid[0] + e.over_vertices(e.filled(0))).max())


def bottom(e):
    return float((e.mid[0] - e.over_vertices(e.filled(0))).min())


x, y, z = (symbol(name) for name in "xyz")
# function, box, its least and largest value, and how much its bounds from below and above may lose: squares are bounded
# without loss where they grow away from the centre of the box
TIGHT = {
    "square": (x**2, [(-2, 2)], (0, 4), (0, 0)),
    "minus a square": (-(x**2), [(-2, 2)], (-4, 0), (0, 0)),
    "square off the centre": (3 * x**2 + x, [(1, 2)], (4, 14), (0.75, 0)),
    "two squares": (x**2 - y**2 / 2, [(-1, 1), (-2, 2)], (-2, 1), (0, 0)),
    "a product among squares": (8 * x * y + x**2 + y**2, [(-1, 1), (-1, 1)], (-6, 10), (2, 0)),
    "the same, other sign": (-8 * x * y + x**2 + y**2, [(-1, 1), (-1, 1)], (-6, 10), (2, 0)),
    "sides of unequal length": (8 * x * y + x**2 + y**2, [(-1, 1), (-2, 2)], (-11, 21), (5, 0)),
    "at the ends of an affine variable": (z * x**2, [(-1, 1), (-3, 5)], (-3, 5), (0, 0)),
}


@pytest.mark.parametrize("name", TIGHT)
def test_quadratics_are_bounded_as_tightly_as_claimed(name):
    """Of a quadratic no second derivative varies: what is bounded by a millionth less, or more, is wrong."""
    e, box, (least, most), (below, above) = TIGHT[name]
    function = MatrixFunction([[[e]]])
    lo, hi = np.array([[a for a, _ in box]], dtype=float), np.array([[b for _, b in box]], dtype=float)
    found = function.expand(lo, hi)
    assert most <= top(found) <= most + above + 1e-6
    assert least - below - 1e-6 <= bottom(found) <= least


@pytest.mark.parametrize("several", [1, 2, 3])
def test_curvature_that_changes_its_sign_is_needed_by_more_than_half(several):
    """s - sin s about 0 has H = 0, D = 1: half the remainder would not hold its value at 3."""
    names = [symbol(f"v{i}") for i in range(several)]
    s = sum(names, start=ZERO)
    function = MatrixFunction([[[s - sin(s)]]])
    box = np.full((1, several), 3.0 / several)
    e = function.expand(-box, box)
    true = 3 - np.sin(3)
    assert true <= top(e) <= 4.6
    assert bottom(e) <= -true


def test_variables_beyond_the_vertices_keep_the_whole_curvature(monkeypatch):
    monkeypatch.setattr(taylor, "MOST_VERTICES", 1)
    for f, least, most in (
        (x * y * 4 + x**2 + y**2, -2, 6),
        (x * y + z * x + y * z + x**2 + y**2 + z**2, -1.5, 6),
    ):
        function = MatrixFunction([[[f]]])
        box = np.ones((1, len(function.variables)))
        e = function.expand(-box, box)
        assert len(e.signs) == 2
        assert top(e) >= most
        assert bottom(e) <= least


@pytest.mark.slow
@given(data=st.data(), kept=st.integers(0, 3))
@QUICK
def test_any_number_of_vertices_contains(data, kept):
    """The order of variables and how many are expanded change how tight a bound is, nothing else."""
    p = data.draw(polynomials(3, 3, curved=False))
    lo, hi, point = data.draw(placed(3))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(taylor, "MOST_VERTICES", kept)
        function = MatrixFunction([[[p.expression]]])
        own = [int(name[1:]) for name in function.variables]
        e = function.expand(np.array([lo])[:, own], np.array([hi])[:, own])
    assert len(e.signs) <= 2**kept
    for sign in (1, -1):
        assert sign * p(point) <= support(e, 0, {(0, 0): Fraction(sign)})


@pytest.mark.slow
@given(data=st.data(), order=st.sampled_from([0, 1, 2]))
@QUICK
def test_fixed_variables_enter_with_their_whole_range(data, order):
    p = data.draw(polynomials(3, 3, curved=False))
    lo, hi, point = data.draw(placed(3))
    function = MatrixFunction([[[p.expression]]], order, fixed=frozenset({"v1"}))
    assert "v1" not in (*function._curved, *function._affine)
    own = [int(name[1:]) for name in function.variables]
    e = function.expand(np.array([lo])[:, own], np.array([hi])[:, own])
    if "v1" in function.variables:
        place = function.variables.index("v1")
        assert not e.signs[:, place].any()
        assert not e.rest[0][place].any()  # it causes nothing, so it is never split
    for sign in (1, -1):
        assert sign * p(point) <= support(e, 0, {(0, 0): Fraction(sign)})


def test_slopes_take_the_range_of_fixed_variables():
    """y (x + x^2) is 4 at x = 1, y = 2: the centre gives 1 + 1/2, the slope's range 1, the rest 1/2 + 1."""
    function = MatrixFunction([[[y * (x + x**2)]]], fixed=frozenset({"y"}))
    e = function.expand(np.array([[-1.0, 0.0]]), np.array([[1.0, 2.0]]))
    assert 4 <= top(e) <= 4 + 1e-9


UNBOUNDED = {
    "a pole inside": (1 / x, [(-1, 1)]),
    "a pole at the end": (1 / x, [(0, 1)]),
    "a root at its end": (sqrt(x), [(0, 1)]),
    "a power of a root": (x**3 * sqrt(x), [(0, 1)]),
    "beyond all floats": (exp(x**2), [(0, 30)]),
    "products beyond all floats": ((x * 10**200) ** 2 * y**2, [(-1, 1), (-1, 1)]),
}


@pytest.mark.parametrize("name", UNBOUNDED)
def test_what_is_not_bounded_is_said_to_be_infinite(name):
    """Never NaN, and never a finite bound: curvature that is unknown adds nothing to the mid part."""
    e, box = UNBOUNDED[name]
    lo, hi = np.array([[a for a, _ in box]], dtype=float), np.array([[b for _, b in box]], dtype=float)
    for objective in (SumOfNorms([[[e]]]), scalar(e), MetricNorm([[e]], [[constant(1)]])):
        for target in (0.0, 1e300, -np.inf):
            estimate = objective.upper(lo, hi, Target(target, target))
            assert not np.isnan(estimate.upper).any()
            assert estimate.upper[0] == np.inf or name.startswith("a power")


# -- everyone who uses it: sampled values inside the box never exceed the bound

ONE = constant(1)
W = (
    (2 + x**2, x / 2 + x * y / 3, ZERO),
    (x / 2 + x * y / 3, constant(Fraction(5, 2)) - y**2 / 3, z / 5),
    (ZERO, z / 5, 1 + (x - y) ** 2),
)
F = (
    (sin(2 * x) * y - 1, x * z, y**2),
    (x * z, -2 + x**2 - y**2, x * y + z),
    (y**2, x * y + z, exp(x) - 3),
)
V = ((x**2 - y,), (x * y + z**2,), (1 - x * z,))
B = ((1 + x**2 / 4, y), (x * y, constant(2)), (ZERO, z**2))


def at(rows, points):
    """A matrix of expressions at points (N, 3), in floats."""
    return values(rows, "xyz", points)


def pencil_values(N, D):
    root = np.linalg.inv(np.linalg.cholesky(D))
    return np.linalg.eigvalsh(root @ N @ np.swapaxes(root, -1, -2))


def sums_of_pencils(points):
    parts = [pencil_values(at(N, points), at(multiply(W, W), points)) for N in (F, W)]
    return sum(np.abs(part).max(axis=-1) for part in parts)


def projected(points):
    basis = np.linalg.svd(at(B, points), full_matrices=True)[0][:, :, 2:]
    turned = np.swapaxes(basis, -1, -2)
    return pencil_values(turned @ at(F, points) @ basis, turned @ at(W, points) @ basis)[:, -1]


def lengths(points):
    v = at(V, points)
    return np.sqrt((np.swapaxes(v, -1, -2) @ np.linalg.solve(at(W, points), v))[:, 0, 0])


def projector():
    gram = multiply(transpose(B), B)
    (a, b), (_, d) = gram
    inverse = tuple(tuple(entry / (a * d - b * b) for entry in row) for row in ((d, -b), (-b, a)))
    return combine(1, identity(3), -1, multiply(multiply(B, inverse), transpose(B)))


def norms(points):
    return sum(np.linalg.norm(at(G, points), 2, axis=(-2, -1)) for G in (F, V))


USERS = {
    "norms": (SumOfNorms([F, V]), norms),
    "pencil": (Pencil(F, W), lambda p: pencil_values(at(F, p), at(W, p))[:, -1]),
    "inverse": (Pencil(identity(3), W), lambda p: 1 / np.linalg.eigvalsh(at(W, p))[:, 0]),
    "pencils": (SumOfPencils([F, W], multiply(W, W)), sums_of_pencils),
    "length": (MetricNorm(V, W), lengths),
    "projected": (ProjectedPencil(F, W, multiply(B, transpose(B)), projector(), inputs=2), projected),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", USERS)
def test_values_inside_are_below_the_bounds_of_boxes(name):
    """Also against targets: one that is exceeded inside is never said to hold; in small boxes little is lost."""
    objective, values = USERS[name]
    own = ["xyz".index(v) for v in objective.variables]
    rng = np.random.default_rng(8)
    count = 18
    width = np.where(np.arange(count) % 3 == 0, 0.5, np.where(np.arange(count) % 3 == 1, 0.1, 0.01))[:, None]
    lo = rng.uniform(-0.7, 0.7 - width, (count, 3))
    hi = lo + width * rng.uniform(0, 1, (count, 3))
    corners = [np.where(np.array(signs) > 0, hi, lo) for signs in product((-1, 1), repeat=3)]
    inside = [lo + rng.uniform(0, 1, lo.shape) * (hi - lo) for _ in range(30)]
    found = np.array([values(points) for points in (*corners, 0.5 * (lo + hi), *inside)])
    most, least = found.max(axis=0), found.min(axis=0)
    assert objective.lower(lo[:, own], lo[:, own]) == pytest.approx(values(lo), rel=1e-9, abs=1e-9)
    size = 1e-9 * (1 + np.abs(most))
    for target in (-np.inf, np.inf):
        assert (objective.upper(lo[:, own], hi[:, own], Target(target)).upper >= most - size).all()
    for k in range(count):
        for share in (0.0, 0.5, 0.95):
            target = float(least[k] + share * (most[k] - least[k])) - float(size[k])
            assert (
                objective.upper(lo[k : k + 1, own], hi[k : k + 1, own], Target(target, target)).upper[0]
                >= most[k] - size[k]
            )
    near = lo + 1e-3
    goal = float(values(lo).max()) + 0.05
    assert (objective.upper(lo[:, own], near[:, own], Target(goal)).upper <= goal + 0.05).all()


@pytest.mark.slow
def test_weights_that_vary_with_a_further_variable():
    """N <= tau (D_1/mu + mu D_2) for mu in a range: the value is that of sampled mu, or 0."""
    D = [multiply(B, transpose(B)), W]

    def simple(lo, hi):
        return np.ones_like(lo), 1 / hi * (1 - 1e-15), lo

    rng = np.random.default_rng(3)
    for ends, width in product((simple, tangents), (0.3, 0.05)):
        weights = Weights(variables=("mu",), ends=ends, loss=lambda lo, hi: hi - lo)
        objective = WeightedPencil([F], D, weights)
        lo = rng.uniform(-0.6, 0.6, (20, 4))
        lo[:, 3] = rng.uniform(0.5, 3, 20)
        hi = lo + width
        for _ in range(15):
            p = lo + rng.uniform(0, 1, lo.shape) * (hi - lo)
            m = p[:, 3, None, None]
            true = pencil_values(at(F, p[:, :3]), at(D[0], p[:, :3]) / m + m * at(D[1], p[:, :3]))[:, -1]
            for target in (np.inf, float(np.median(true)), -0.3):
                found = objective.upper(lo, hi, Target(target, target)).upper
                assert (found >= np.maximum(true, 0.0) - 1e-9).all()


def test_first_order_and_natural_enclosures_keep_no_curvature():
    """A norm has no second derivative: nothing may be shifted by one."""
    for e in (norm([x, y]) + x * y, x * norm([x - y]) ** 2):
        function = MatrixFunction([[[e]]])
        assert function._order == 1
        box = np.array([[-0.5, -0.25]]), np.array([[1.0, 0.75]])
        found = function.expand(*box)
        grid = np.stack(
            [
                g.ravel()
                for g in np.meshgrid(
                    *(np.linspace(a, b, 31) for a, b in zip(box[0][0], box[1][0], strict=True))
                )
            ],
            axis=1,
        )
        values = function.floats(grid)[0]
        assert bottom(found) <= values.min()
        assert values.max() <= top(found)


def diagonal(a, b):
    return ((a, ZERO), (ZERO, b))


def weighted(N, D):
    weights = Weights(
        variables=("mu",), ends=lambda lo, hi: (np.ones_like(lo), lo), loss=lambda lo, hi: hi - lo
    )
    return WeightedPencil([N], [D], weights)


def beside(N, D):
    return ProjectedPencil(
        diagonal(N, ZERO), diagonal(D, ONE), diagonal(ZERO, ONE), diagonal(ONE, ZERO), inputs=1
    )


BOWL, HILL = 1 + x**2, 2 - x**2
TIGHT_USERS = {
    "norm": (SumOfNorms([[[x**2]]]), 1.0),
    "norms": (SumOfNorms([[[x**2]], [[-(x**2)]]]), 2.0),
    "numerator": (Pencil([[x**2]], [[ONE]]), 1.0),
    "negative numerator": (Pencil([[-BOWL]], [[ONE]]), -1.0),
    "denominator at its ends": (Pencil([[ONE]], [[HILL]]), 1.0),
    "denominator at its centre": (Pencil([[ONE]], [[BOWL]]), 1.0),
    "denominator of a negative value": (Pencil([[-ONE]], [[BOWL]]), -0.5),
    "weighted numerator": (weighted([[x**2]], [[ONE]]), 1.0),
    "weighted denominator": (weighted([[ONE]], [[HILL]]), 1.0),
    "sum": (SumOfPencils([[[x**2]], [[-(x**2)]]], [[ONE]]), 2.0),
    "sum's denominator": (SumOfPencils([[[ONE]], [[-ONE]]], [[HILL]]), 2.0),
    "length": (MetricNorm([[x**2]], [[ONE]]), 1.0),
    "length in a metric": (MetricNorm([[ONE]], [[4 - 3 * x**2]]), 1.0),
    "projected numerator": (beside(x**2, ONE), 1.0),
    "projected denominator": (beside(ONE, HILL), 1.0),
    "projected denominator of a negative value": (beside(-ONE, BOWL), -0.5),
}


@pytest.mark.parametrize("name", TIGHT_USERS)
def test_no_user_forgets_the_rest(name):
    """Values at the ends or the centre of the box that its vertices alone do not show."""
    objective, most = TIGHT_USERS[name]
    free = len(objective.variables) - 1
    lo, hi = np.array([[-1.0] + [1.0] * free]), np.array([[1.0] + [2.0] * free])
    for target in (np.inf, -np.inf, most - 0.3, most - 1e-3, most - 1e-9):
        assert objective.upper(lo, hi, Target(target, target)).upper[0] >= most - 1e-12
    for half in (1e-3, 1e-4):
        for at in (-1.0, 0.0, 1.0):
            near, far = lo.copy(), hi.copy()
            near[0, 0], far[0, 0] = at - half, at + half
            goal = most + 0.05 + 4 * half
            assert objective.upper(near, far, Target(goal)).upper[0] <= goal
