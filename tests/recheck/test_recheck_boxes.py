"""Recheck's boxes: monomials, expansions and definiteness enclose what sympy and numpy find at points of them.

Every check is run on broken versions of the code as well, and must fail there.
"""

import sys
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import rechecked
import sympy
from flint import arb, arb_mat
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import texts

from tubecert.recheck import boxes, monomials, pencils, statements
from tubecert.recheck.balls import is_positive
from tubecert.recheck.boxes import Field, Found
from tubecert.recheck.cover import Boxed, prove, telling
from tubecert.recheck.monomials import Combinations
from tubecert.recheck.pencils import SlopesBelow
from tubecert.recheck.statements import NormsBelow, PositiveDefinite
from tubecert.recheck.terms import number, slopes

NAMES = "xyz"
FEW = [
    "x**3*y - 0.37*x*z + 2", "sin(x)**2*cos(x)**3 + sin(x)**4*y",
    "(1 + x*y)/(2 + sin(x)**2)**3 - y/(2 + sin(x)**2)", "(3 + cos(y))**-2*x + exp(x*y)*z",
    "sqrt(4 + x)*sin(y)*cos(y)**2 - z*tan(x/2)/sqrt(4 + x)", "(x + 0.1*y - z)**5",
    "tanh(3*x)*y + atan(x*y) - log(3 + z)", "asin(x/3)*sinh(y) + acos(z/4)*cosh(x*y)",
]  # fmt: skip
BENDING = ["exp(x) - x*y**3", "sin(2*x)*cos(3*y) + z*x**2", "(x + y)**4*z", "sqrt(3 + x*y) + z"]
SYMMETRIC = [
    ["2 + exp(x)", "0.3*sin(y)*x", "z*cos(x)"],
    ["0.3*sin(y)*x", "1.5 + cos(y)*x**3", "0.2*x*y**2"],
    ["z*cos(x)", "0.2*x*y**2", "3 + z*x"],
]


def terms(expressions):
    return rechecked.terms(expressions, NAMES)


def matrix(rows, shift=0):
    flat = iter(terms([e for row in rows for e in row]))
    return [
        [next(flat) + number(Fraction(shift) if i == j else 0) for j, _ in enumerate(row)]
        for i, row in enumerate(rows)
    ]


def at_points(expressions, points):
    """What the texts are at points (N, 3): (N, K), by sympy and numpy."""
    function = sympy.lambdify(sympy.symbols("x y z"), [sympy.sympify(text) for text in expressions], "numpy")
    columns = function(*np.transpose(points))
    return np.stack([np.broadcast_to(column, len(points)) for column in columns], axis=-1)


def samples(box, count=200, seed=0):
    """Points of a box, its corners among them."""
    lo, hi = np.transpose(box)
    shares = np.random.default_rng(seed).random((count, len(box)))
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * len(box))).reshape(len(box), -1).T
    return lo + np.vstack([shares, corners, [[0.5] * len(box)]]) * (hi - lo)


def check_monomials():
    points = samples([(-1.0, 1.0)] * 3, 30)
    for expressions in ([text] for text in FEW):
        (e,) = terms(expressions)
        outputs = [e, *(d for name in NAMES for d in slopes([e], name))]
        combined = Combinations(outputs, list(NAMES))
        combined._monomials = _product_of(outputs, combined)
        own = combined.run([[arb(x) for x in point] for point in points])
        truth = at_points([str(sympy.sympify(expressions[0]).diff(v)) for v in NAMES], points)
        truth = np.hstack([at_points(expressions, points), truth])
        for found, expected in zip(own, truth, strict=True):
            for ball, value in zip(found, expected, strict=True):
                assert ball.overlaps(arb(value, 1e-9 * (1 + abs(value)))), expressions
                assert float(ball.rad()) < 1e-9 * (1 + abs(value))


def _product_of(outputs, combined):
    """The product even where straight lines of steps are cheaper."""
    with patched(monomials, _CHEAPER=10**9):
        again = Combinations(outputs, list(NAMES))
    assert again._monomials is not None
    combined._row, combined._table = again._row, again._table
    return again._monomials


def test_where_monomials_cancel_steps_take_over():
    """Over boxes (x + y/10 - z)^5 of small bases is the sum of 21 products that nearly cancel."""
    outputs = terms([FEW[5]])
    combined = Combinations(outputs, list(NAMES))
    combined._monomials = _product_of(outputs, combined)
    near = [arb(1, 1e-3), arb(1, 1e-3), arb(1.1, 1e-3)]
    assert float(combined.run([near])[0][0].rad()) > 1e-3
    for _ in range(3):
        ((found,),) = combined.over([near])
        assert found.contains(arb(0))
        assert float(found.rad()) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("text", FEW)
def test_over_boxes_either_way_encloses(text):
    """Wide boxes, narrow ones and points, two at once, before and after steps have taken over."""
    outputs = terms([text])
    combined = Combinations(outputs, list(NAMES))
    combined._monomials = _product_of(outputs, combined)
    random = np.random.default_rng(5)
    for radius in (0.9, 0.0, 1e-3, 1e-9, 0.3, 1e-6):
        centres = random.uniform(-1, 1, (2, len(NAMES)))
        around = [[(c - radius, c + radius) for c in centre] for centre in centres]
        found = combined.over([[arb(lo).union(arb(hi)) for lo, hi in box] for box in around])
        for (ball,), box in zip(found, around, strict=True):
            for value in at_points([text], samples(box, 9))[:, 0]:
                assert ball.overlaps(arb(value, 1e-9 * (1 + abs(value))))


def test_where_monomials_do_not_cancel_they_stay():
    outputs = terms([FEW[0]])
    combined = Combinations(outputs, list(NAMES))
    combined._monomials = _product_of(outputs, combined)
    box = [arb(0.5, 0.1), arb(1, 0.1), arb(0)]
    for _ in range(5):
        assert str(combined.over([box])) == str(combined.run([box]))


def check_expansion():
    box = [(-0.9, 0.7), (0.1, 1.2), (-0.5, 1.0)]
    for text in BENDING:
        field = Field(terms([text]))
        own = [box[NAMES.index(v)] for v in field.variables]
        (ball,) = field.hull(own)
        points = samples(box)
        values = at_points([text], points)[:, 0]
        assert float(ball.lower()) <= values.min() + 1e-12, text
        assert float(ball.upper()) >= values.max() - 1e-12, text
        at_corners = [e for part in field.expand(own)[0] for e in _range(part)]
        assert min(at_corners) <= values.min() + 1e-12, text
        assert max(at_corners) >= values.max() - 1e-12, text


def _range(part):
    """The least and the largest corner, with the rest."""
    found = [float(corner[0, 0].mid()) for corner in part.corners()]
    rest = float(part.rest[0].upper())
    return min(found) - rest, max(found) + rest


SMALL = [(-0.04, 0.04)] * 3  # of the second order is what counts: the rest is far smaller
ENTRIES = ["sin(x)*sin(y) + 1", "cos(x)*cos(y)", "exp(0.2*x - 0.1*y) + x*z", "cos(x - y)/(1 + x**2)"]


def check_norms():
    for text in ENTRIES:
        largest = np.abs(at_points([text], samples(SMALL))).max()
        for more, proven in ((-1e-5, False), (2e-3, True)):
            test = NormsBelow([matrix([[text]])], Fraction(largest * (1 + more)))
            assert test.over([SMALL[0]] * len(test.variables)).proven == proven, (text, more)
    box = [(0.1, 0.9), (-0.6, 0.8), (-0.3, 0.4)]
    G = [BENDING[:2], BENDING[2:]]
    values = at_points([e for row in G for e in row], samples(box, 2_000)).reshape(-1, 2, 2)
    largest = np.linalg.norm(values, 2, axis=(1, 2)).max()
    for share, proven in ((0.9999, False), (3, True)):
        test = NormsBelow([matrix(G)], Fraction(largest * share))
        assert test.over([box[NAMES.index(v)] for v in test.variables]).proven == proven


def check_definiteness():
    for centre in ((0.2, 0.5, -0.1), (-0.3, 0.9, 0.6)):
        for half in (0.2, 0.02):
            box = [(c - half, c + half) for c in centre]
            values = at_points([e for row in SYMMETRIC for e in row], samples(box, 2_000)).reshape(-1, 3, 3)
            least = np.linalg.eigvalsh(values).min()
            for more, proven in ((-1e-4, False), (0.5 * half, True)):
                test = PositiveDefinite(matrix(SYMMETRIC, Fraction(more - least)))
                own = [box[NAMES.index(v)] for v in test.variables]
                assert test.over(own).proven == proven, (centre, half, more)
    twice = [["x - 1", "0", "0"], ["0", "y - 1", "0"], ["0", "0", "3"]]
    assert not PositiveDefinite(matrix(twice)).over(SMALL[:2]).proven


def check_signs():
    generator = np.random.default_rng(5)
    for k in range(300):
        n = 1 + k % 7
        Q, _ = np.linalg.qr(generator.normal(size=(n, n)))
        eigenvalues = generator.uniform(0.1, 2, size=n)
        eigenvalues[: generator.integers(0, n + 1)] *= -1
        a = (Q * eigenvalues) @ Q.T
        a = 0.5 * (a + a.T)
        assert is_positive(a.tolist()) == bool(np.all(eigenvalues > 0)), eigenvalues
    assert not is_positive([[1, 1], [1, 1]])
    assert not is_positive([[arb(1, 0.1), 1], [1, arb(1, 0.1)]])
    assert not is_positive([[arb("nan")]])


def check_slopes():
    W = [["2 + x**2", "0.3*x"], ["0.3*x", "1.5 + sin(y)"]]
    W_x, W_y = [["2*x", "0.3"], ["0.3", "0"]], [["0", "0"], ["0", "cos(y)"]]
    box = [(0.2, 0.3), (-0.4, -0.3), (0.0, 0.0)]
    W_s, *slopes_s = (
        at_points([e for row in m for e in row], samples(box)).reshape(-1, 2, 2) for m in (W, W_x, W_y)
    )
    M = np.linalg.inv(W_s)
    largest = sum(np.linalg.norm(M @ N @ M, 2, axis=(1, 2)) for N in slopes_s).max()
    square = [[f"({W[i][0]})*({W[0][j]}) + ({W[i][1]})*({W[1][j]})" for j in range(2)] for i in range(2)]
    for share, proven in ((0.999, False), (1.1, True)):
        test = SlopesBelow([matrix(W_x), matrix(W_y)], matrix(square), Fraction(largest * share))
        assert test.over([box[NAMES.index(v)] for v in test.variables]).proven == proven


CHECKS = {
    "monomials": check_monomials, "expansion": check_expansion, "norms": check_norms,
    "definiteness": check_definiteness, "signs": check_signs, "slopes": check_slopes,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", CHECKS)
def test_what_is_proven_on_a_box_is_true(name):
    CHECKS[name]()


@contextmanager
def patched(place, **changes):
    with pytest.MonkeyPatch.context() as patch:
        for name, value in changes.items():
            patch.setattr(place, name, value)
        yield


def without_cosines(p, relations):
    return true_written(p, [relation + 1 for relation in relations])


def one_divisor(term):
    return true_divisor(term)[0], 1


def no_radius(self, key, radius):
    return arb(0) if len(key) == 3 else true_weight(self, key, radius)


def one_side(self):
    return list(true_vertices(self))[:1]


def unmixed(self):
    return true_vertices(replace(self, mixed={}))


def by_trace(a):
    return true_positive(a) or bool(arb_mat(a).det() > 0 and arb_mat(a).trace() > 0)


true_written, true_divisor = monomials._written, monomials._divisor
true_weight, true_vertices, true_positive = Field._weight, boxes.Expansion.vertices, is_positive

BROKEN = {
    "sin^2 = 2 - cos^2": ("monomials", monomials, "_written", without_cosines),
    "powers of divisors": ("monomials", monomials, "_divisor", one_divisor),
    "no third derivatives": ("expansion", Field, "_weight", no_radius),
    "nothing is left": ("expansion", Field, "_variation", lambda *_: iter(())),
    "no mixed derivatives": ("norms", boxes.Expansion, "vertices", unmixed),
    "a parabola between its ends": ("norms", boxes, "CURVED", ((-1.0, 1.0), (1.0, 1.0))),
    "one corner": ("norms", boxes.Expansion, "vertices", one_side),
    "one corner of a symmetric matrix": ("definiteness", boxes.Expansion, "vertices", one_side),
    "trace and determinant": ("signs", sys.modules[__name__], "is_positive", by_trace),
    "trace and determinant on a box": ("definiteness", statements, "is_positive", by_trace),
}


@pytest.mark.parametrize("bug", BROKEN)
def test_a_broken_version_is_caught(bug):
    name, place, attribute, broken = BROKEN[bug]
    with pytest.raises(AssertionError), patched(place, **{attribute: broken}):
        CHECKS[name]()


@pytest.mark.parametrize("name", ["expansion", "norms", "definiteness"])
def test_second_derivatives_do_where_third_ones_are_too_many(name, monkeypatch):
    monkeypatch.setattr(boxes, "_TURNING", -1)
    CHECKS[name]()
    monkeypatch.setattr(Field, "_variation", lambda *_: iter(()))
    with pytest.raises(AssertionError):
        check_expansion()


@pytest.mark.parametrize("proposal", [0.0, 1e-3, 10.0, float("nan")])
def test_shares_are_proposals_only(proposal):
    """Whatever the shares are, a sum that is too large is never proven."""
    slope = [["x", "0"], ["0", "0"]]
    test = SlopesBelow([matrix(slope)], matrix([["4", "0"], ["0", "1"]]), Fraction(1, 5))
    with patched(SlopesBelow, _least=lambda self, entries: [proposal]):
        assert not test.over([(0.9, 1.0)]).proven  # it is 1/4 at 1
    for share in ([proposal, 0.0], [0.2, proposal], [0.2 - proposal, proposal + 0.001]):
        with patched(SlopesBelow, _proposed=lambda self, box, share=share: [share]):
            assert not test.over([(0.9, 1.0)]).proven


def test_shares_that_are_large_enough_must_stay_within_the_limit():
    test = SlopesBelow(
        [matrix([["x", "0"], ["0", "0"]]), matrix([["1", "0"], ["0", "0"]])],
        matrix([["4", "0"], ["0", "1"]]),
        Fraction(51, 100),
    )
    assert test.over([(0.9, 1.0)]).proven
    for first, second, proven in (([0.001, 0.25], [0.258, 0.0], True), ([0.01, 0.25], [0.26, 0.0], False)):
        with patched(SlopesBelow, _proposed=lambda self, box, both=(first, second): both):
            assert test.over([(0.9, 1.0)]).proven is proven


@pytest.mark.slow
def test_a_slope_that_vanishes_somewhere_has_its_part_of_what_is_left(monkeypatch):
    """|x - y/3| + |2 + y| <= 5.2: at the kink, which no halving meets, its least share is 0 and grows on both sides."""
    first, second = ([[e, "0"], ["0", "0"]] for e in ("x - y/3", "2 + y"))
    test = SlopesBelow([matrix(first), matrix(second)], matrix([["1", "0"], ["0", "1"]]), Fraction(52, 10))
    domain = Boxed({name: (Fraction(-1), Fraction(1)) for name in "xy"})
    assert prove(test, domain, 200).holds
    monkeypatch.setattr(pencils, "_APART", 1.0)
    monkeypatch.setattr(pencils, "_BENT", 0.0)
    monkeypatch.setattr(pencils, "_EVEN", 0.0)
    assert not prove(test, domain, 200).holds


@settings(max_examples=40, deadline=None)
@given(texts(leaves=6), st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_random_expressions_are_enclosed(text, ends):
    box = dict(zip("xyt", [tuple(sorted(ends[2 * k : 2 * k + 2])) for k in range(3)], strict=True))
    e = rechecked.terms([text], list(box))
    field = Field(e)
    (found,) = field.hull([box[v] for v in field.variables])
    for share in (0.0, 0.3, 1.0):
        point = [arb(box[v][0]) + arb(share) * (arb(box[v][1]) - arb(box[v][0])) for v in field.variables]
        (value,) = field.at(point)
        assert not found.is_finite() or found.overlaps(value)


def test_proposals_come_from_the_pencil():
    assert pencils.proposed_largest([[4.0, 0.0], [0.0, 1.0]]) == pytest.approx(4)


def test_a_long_claim_tells_how_much_of_it_is_proven():
    """A claim of a minute stood still."""

    class Narrow:
        variables = ("x", "y")

        def over(self, box):
            return Found(all(hi - lo < 0.1 for lo, hi in box), [0.0, 0.0], [0.0, 0.0])

        def broken(self, at):
            return False

    told = []
    domain = Boxed({"x": (Fraction(-1), Fraction(1)), "y": (Fraction(0), Fraction(1))})
    with telling(lambda *each: told.append(each)):
        assert prove(Narrow(), domain, 10_000).verdict == "confirmed"
    assert [count for count, _ in told] == [64 * k for k in range(1, len(told) + 1)]
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert 0 < shares[0] < 0.2
    assert 0.8 < shares[-1] <= 1
    told.clear()
    prove(Narrow(), domain, 10_000)
    assert told == []
