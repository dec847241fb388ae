"""Recheck's statements on boxes with one false constant each, just beyond the truth; and constants without a bound.

The value on every box is known exactly: what is said to hold a little beyond it is wrong.
"""

import json
import math
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import proven
import pytest
import rechecked
from flint import arb
from hypothesis import given, settings
from hypothesis import strategies as st
from rechecked import terms, written
from systems import SMALL

from tubecert import pipeline, spec
from tubecert.bounds.suprema import Suprema
from tubecert.errors import ExitCode
from tubecert.recheck import boxes, pencils
from tubecert.recheck.boxes import Field
from tubecert.recheck.claims import of_certified
from tubecert.recheck.constants import _left_inverse_slopes, largest_push
from tubecert.recheck.coordinates import Fields
from tubecert.recheck.cover import Boxed, prove
from tubecert.recheck.lipschitz import LipschitzBelow, norms_below
from tubecert.recheck.pencils import GainBelow
from tubecert.recheck.run import recheck
from tubecert.recheck.statements import NormsBelow, NotNegative, PositiveDefinite
from tubecert.recheck.terms import all_zero, number, slopes

NAMES = ["a", "b", "c", "d", "e", "f", "g", "x", "y"]
LITTLE = Fraction(1, 10**6)
SQUARES = "a**2 + b**2 + c**2 + d**2 + e**2 + f**2 + g**2"


def term(text):
    return rechecked.terms([text], NAMES)[0]


def rows(matrix):
    return [[term(e) for e in row] for row in matrix]


# text, box (one for all variables), the exact supremum
SUPREMA = {
    "far from the ends of a parabola": ("1.8*x - x**2", (-1.0, 1.0), Fraction(81, 100)),
    "its other side": ("-1.8*x - x**2", (-1.0, 1.0), Fraction(81, 100)),
    "more squares than vertices": (SQUARES, (-1.0, 1.0), Fraction(7)),
    "more variables than corners": (
        f"a + b + c + d + e + f + g - 1e-9*({SQUARES})",
        (-1.0, 1.0),
        7 - 7 * Fraction(1, 10**9),
    ),
    "products of what has no corners": (f"f*g + 1e-9*({SQUARES})", (-1.0, 1.0), 1 + 7 * Fraction(1, 10**9)),
    "a product of a corner and what has none": (
        f"a*g + 1e-9*({SQUARES})",
        (-1.0, 1.0),
        1 + 7 * Fraction(1, 10**9),
    ),
    "a cube": ("x**3 - 0.75*x", (-1.0, 1.0), Fraction(1, 4)),
    "cubes that are mixed": ("x**2*y + x*y**2", (-1.0, 1.0), Fraction(2)),
    "an affine variable": ("x*a**2", (-1.0, 1.0), Fraction(1)),
    "one unit in the last place": ("1e10*(x - 1) + (x - 1)**2", (1.0, 1 + 2.0**-52), Fraction(10**10, 2**52)),
    "the unit below": ("1e10*(1 - x) + (x - 1)**2", (1 - 2.0**-53, 1.0), Fraction(10**10, 2**53)),
}


@pytest.mark.parametrize("turning", [4, -1])
@pytest.mark.parametrize("name", SUPREMA)
def test_a_supremum_is_not_said_to_be_smaller(name, turning, monkeypatch):
    """With third derivatives, and where second ones must do."""
    monkeypatch.setattr(boxes, "_TURNING", turning)
    text, ends, most = SUPREMA[name]
    e = term(text)
    below = most - most * LITTLE
    box = [ends] * len(NotNegative(e).variables)
    assert not NotNegative(number(below) - e).over(box).proven
    assert not NotNegative(number(most) - e, strict=True).over(box).proven
    assert Field([e]).hull(box)[0].upper() >= arb(float(below))
    assert not NormsBelow([[[e]]], below).over(box).proven
    assert NormsBelow([[[e]]], below).bound(box) >= arb(float(below))
    assert not PositiveDefinite([[number(below) - e, number(0)], [number(0), number(1)]]).over(box).proven
    generous = 40 * (1 + most)
    assert NotNegative(number(generous) - e).over(box).proven
    assert NormsBelow([[[e]]], generous).over(box).proven


def test_a_remainder_of_second_order_counts_in_full(monkeypatch):
    """x - sin x about 0 bends by nothing at the centre: half of what its curvature can be would not hold its end."""
    monkeypatch.setattr(boxes, "_TURNING", -1)
    e = term("x - sin(x)")
    most = Fraction(3) - Fraction(math.sin(3)) - LITTLE
    assert not NotNegative(number(most) - e).over([(-3.0, 3.0)]).proven
    assert Field([e]).hull([(-3.0, 3.0)])[0].upper() > arb(2.858)


def test_every_corner_of_an_affine_variable_counts():
    """Positive at one end of y and not at the other."""
    for first, second in (("2 + y", "2 - y"), ("2 - y", "2 + y")):
        S = rows([[f"{first} - x**2", "0"], ["0", f"3*({second}) + x**2"]])
        assert PositiveDefinite(S).over([(-0.5, 0.5), (-1.0, 1.0)]).proven
        assert not PositiveDefinite(S).over([(-0.5, 0.5), (-1.9, 1.9)]).proven


@pytest.mark.parametrize(
    "S",
    [
        [["0"]],
        [["0", "0"], ["0", "0"]],
        [["1", "1"], ["1", "1"]],
        [["x**2", "x"], ["x", "1"]],
        [["1 + x", "0"], ["0", "x"]],
        [["1", "x", "y"], ["x", "x**2", "x*y"], ["y", "x*y", "y**2"]],
        [["2", "-1", "-1"], ["-1", "2", "-1"], ["-1", "-1", "2"]],
        [["-1", "0"], ["0", "-1"]],
        [["-1", "0", "0"], ["0", "-1", "0"], ["0", "0", "1"]],
        [["1/x", "0"], ["0", "1"]],
    ],
)
def test_what_is_not_definite_is_never_said_to_be(S):
    """Singular, zero, twice negative, undefined: on points and on boxes about them."""
    S = rows(S)
    for half in (0.0, 1e-300, 1e-9, 0.5):
        for unit in (None, rows([["1" if i == j else "0" for j in range(len(S))] for i in range(len(S))])):
            test = PositiveDefinite(S, unit)
            assert not test.over([(-half, half)] * len(test.variables)).proven
            assert not PositiveDefinite(S, unit).broken([arb(0)] * len(test.variables)) or len(S) > 1


def gain(limit, ends, F="2", W="1", BBt="1"):
    """t (BBt/mu + mu W) > F for mu in a range."""
    (f,), (w,), (b,) = ([term(text)] for text in (F, W, BBt))
    test = GainBelow(
        SimpleNamespace(
            states=["x"],
            inputs=["u"],
            F=[[f]],
            W=[[w]],
            BBt=[[b]],
            safe_set={"x": (Fraction(-1), Fraction(1))},
        ),
        Fraction(limit),
        Fraction(ends[1]),
    )
    test._whole = ends
    return test


def test_what_is_left_down_to_mu_0_is_one_range_again():
    """On a part of a box a tangent that is further off serves; what is left elsewhere stays what is left."""
    test = gain(1, (0.0, 4.0))
    box = [(0.0, 1.0)]
    test._left = [(box, [(1.0, 2.0), (2.0, 4.0)])]
    assert test._waiting([(0.25, 0.5)]) == [(1.0, 2.0), (2.0, 4.0)]
    test._left = [(box, [(3.0, 4.0), (1.0, 2.0), (1e-9, 1e-8), (0.0, 1e-9)])]
    assert test._waiting([(0.25, 0.5)]) == [(1.0, 2.0), (3.0, 4.0), (0.0, 1e-8)]
    test._left = [(box, [(2.0, 4.0), (0.0, 2.0)])]
    assert test._waiting([(0.25, 0.5)]) == [(0.0, 4.0)]


@given(st.permutations(range(8)), st.integers(0, 8))
def test_no_mu_that_is_left_is_lost(order, count):
    """Neighbours, ranges apart, one in another: each of them lies in a range that is looked at again."""
    ends = [0.0, 5e-324, 1e-9, 0.5, 0.75, 2.0, 3.0, 4.0]
    left = [(min(p, q), max(p, q)) for p, q in pairwise(ends[k] for k in order)][:count]
    found = pencils._together(left)
    assert all(any(a <= lo and hi <= b for a, b in found) for lo, hi in left)
    assert bool(found) == bool(left)


def turning(limit, largest, of_input="(2*x)**2, 2*x, 2*x, 1", size="1/1000"):
    """An input whose direction turns with x, or whose size varies: F > 0 along it, and < 0 where it does not reach."""
    entries = [f"({size})**2*({e})" for e in of_input.split(", ")]
    system = SimpleNamespace(
        states=["x", "y"],
        inputs=["u"],
        F=rows([["-1", "0"], ["0", "1"]]) if "2*x" in of_input else rows([["-1", "2 + x"], ["2 + x", "1"]]),
        W=rows([["1", "0"], ["0", "1"]]),
        BBt=rows([entries[:2], entries[2:]]),
    )
    return GainBelow(system, Fraction(limit), Fraction(largest))


SIDES = Boxed({"x": (Fraction(-2, 5), Fraction(2, 5))})


@pytest.mark.slow
@pytest.mark.parametrize("largest", [1, 100, 10_000])
def test_a_gain_is_confirmed_however_far_the_mu_that_counts_lies_below_the_largest(largest):
    """Sampled on 41 x and 151 mu, the least gains are 575.1 and 1413, at mu = 7e-4."""
    assert prove(turning(633, largest), SIDES, 50).holds
    assert not prove(turning(569, largest), SIDES, 50).holds
    small = "0, 0, 0, 1", "1/1000 + x**2"
    assert prove(turning(1424, largest, *small), SIDES, 50).holds
    assert prove(turning(1400, largest, *small), SIDES, 50).verdict == "contradicted"


@pytest.mark.slow
@pytest.mark.parametrize(
    "ends", [(0.0, 1.0), (0.5, 2.0), (0.9, 1.1), (1.0, 1.0), (1.0, 4.0), (0.25, 1.0), (0.1, 10.0)]
)
def test_a_gain_is_not_said_to_be_smaller(ends):
    """2 <= t (1/mu + mu) holds for t >= 1, and fails below at mu = 1."""
    test = gain(1 - LITTLE, ends)
    assert not test.over([]).proven
    assert test.broken([])
    assert not gain(1, ends).broken([])
    assert gain(1 + Fraction(1, 100), ends).over([]).proven


def test_where_nothing_varies_ranges_are_halved_as_often_as_it_takes():
    """A linear system has no boxes to halve: of 1/mu + mu >= 2 all but a millionth is proven by ranges alone."""
    assert gain(1 + Fraction(1, 10**6), (0.0, 10.0)).over([]).proven


@pytest.mark.slow
def test_a_gain_at_the_ends_of_a_range():
    """Towards mu = 0 a gain that B does not reach has no bound; elsewhere the least of 1/mu + mu is at an end."""
    lost = gain(100, (0.0, 1.0), BBt="0*x")
    assert not lost.over([(0.0, 1.0)] * len(lost.variables)).proven
    for ends, least in (((2.0, 3.0), Fraction(5, 2)), ((0.25, 0.5), Fraction(5, 2))):
        assert not gain(2 / least - LITTLE, ends).over([]).proven
        assert gain(2 / least + Fraction(1, 100), ends).over([]).proven


@pytest.mark.slow
def test_what_is_proven_of_a_box_is_not_proven_again_on_its_parts_and_on_no_other():
    """Of F = 2 + x: at x = 1 and mu = 1 the gain has to be 3/2."""
    test = gain(Fraction(14, 10), (0.0, 10.0), F="2 + x")
    assert not test.over([(-1.0, 1.0)]).proven
    assert test._left[-1][1] not in ([], [(0.0, 10.0)])
    ((least, most),) = test._waiting([(0.0, 1.0)])
    assert (least, most) == (0.0, max(hi for _, hi in test._left[-1][1]))
    assert most < 2
    assert test._waiting([(0.0, 1.5)]) == [(0.0, 10.0)]  # it is not part of what was looked at
    assert not test._left
    assert prove(test, Boxed({"x": (Fraction(-1), Fraction(3, 5))}), 1000).holds
    assert prove(test, Boxed({"x": (Fraction(-1), Fraction(1))}), 1000).verdict == "contradicted"


@pytest.mark.slow
def test_a_gain_needs_the_rest_of_the_expansion_and_both_ends(monkeypatch):
    """2 + x^5 is 3 at 1, of which nothing is seen at 0; 1/mu + mu is 5.2 at .2 and 2 at 1."""
    wide, long = gain(Fraction(12, 10), (0.99, 1.01), F="2 + x**5"), gain(Fraction(9, 10), (0.2, 1.0))
    assert not wide.over([(-1.0, 1.0)]).proven
    assert not long.over([]).proven
    true_test, true_holds = pencils.definite_on, GainBelow._holds
    monkeypatch.setattr(
        pencils, "definite_on", lambda e, T: true_test(replace(e, rest=[arb(0)] * len(e.rest)), T)
    )
    wide._left.clear()
    assert wide.over([(-1.0, 1.0)]).proven
    monkeypatch.setattr(GainBelow, "_holds", lambda self, e, ends: true_holds(self, e, (ends[0], ends[0])))
    long._left.clear()
    assert long.over([]).proven


@pytest.mark.slow
def test_a_constant_without_a_bound_is_not_examined(monkeypatch):
    """B does not rest on it: its certificate is confirmed."""
    honest = Suprema.metric_slope
    monkeypatch.setattr(Suprema, "metric_slope", lambda self: replace(honest(self), above=math.inf))
    options = pipeline.Options(conditions="distance")
    with proven.barely():
        document = written(pipeline.certify(spec.load_text(SMALL, "small.yaml"), options).to_json())
    assert document["result"]["verdict"] == "certified"
    found = rechecked.examine(document)
    assert [(item.name, item.outcome.why) for item in found.claims if not item.outcome.holds] == []
    assert found.exit_code == ExitCode.CERTIFIED


@pytest.mark.slow
def test_a_pole_in_the_safe_set_is_found():
    """What an expression owes is read with it, and the curve between the poles proves nothing."""
    document = rechecked.certified(SMALL)
    for pole, found in (("1e-9/(x - 0.9)", True), ("1e-9/(x - 1.1)", False), ("1e-9*sqrt(x + 0.9)", True)):
        result = json.loads(json.dumps(document["result"]))
        result["spec"]["effective"]["system"]["f"][0] = f"-x + y + {pole}"
        case = rechecked.case_of({**document, "result": result}, 2_000)
        claim = next(item for item in of_certified(case) if item.name == "f, B, W, h and the plan are smooth")
        assert claim.outcome(None).holds is not found


@pytest.mark.slow
def test_nothing_rests_on_a_constant_without_a_bound():
    """Whichever bound is struck out of a certificate, every section that rests on it is no longer confirmed."""
    document = rechecked.certified(SMALL)
    assert document["result"]["verdict"] == "certified"
    rests = (
        "f_x", "M_x", "feedback_gain", "h_initial", "metric_input_gain", "drift_on_plan",
        "plan_defect_metric", "B_pinv",
    )  # fmt: skip
    for name in rests:
        result = json.loads(json.dumps(document["result"]))
        result["constants"][name]["above"] = None
        found = recheck(json.dumps(written(result)), "certificate", 2_000, to_first_failure=True)
        assert found.verdict != "confirmed", name


# -- terms with kinks

# h in x and y on [-1, 1], the exact supremum of |h|, and its Lipschitz constant
ROOT_TWO = Fraction(1414213562373095, 10**15)
KINKED = {
    "one": ("abs(x)", Fraction(1), Fraction(1)),
    "two": ("3*abs(x) + 4*abs(y)", Fraction(7), Fraction(5)),
    "a product": ("abs(x)*abs(y)", Fraction(1), Fraction(1414213562373096, 10**15)),
    "nested": ("abs(3*x - 4*abs(y))", Fraction(7), Fraction(5)),
    "a difference": ("abs(x) - x", Fraction(2), Fraction(2)),
    "a curve": ("abs(x**2 - 0.25)", Fraction(3, 4), Fraction(2)),
    "in a norm": ("norm(x, abs(y))", ROOT_TWO, Fraction(1)),
    "beside a norm": ("norm(x, abs(y)) + abs(x - y)", 2 + ROOT_TWO, 1 + ROOT_TWO),
    "of a norm": ("abs(norm(x, y) - 0.5)", ROOT_TWO - Fraction(1, 2), Fraction(1)),
    "a norm squared": ("norm(x, y)**2", Fraction(2), 2 * ROOT_TWO),
    "a norm times": ("norm(x, y)*abs(x)", ROOT_TWO, Fraction(2236067977499790, 10**15)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", KINKED)
def test_every_branch_of_a_kink_counts(name):
    """Just above the truth it is proven, also over boxes that hold the kink; just below it never is."""
    text, top, slope = KINKED[name]
    h = [[term(text)]]
    domain = Boxed({"x": (Fraction(-1), Fraction(1)), "y": (Fraction(-1), Fraction(1))})
    for more, holds in ((LITTLE, True), (-LITTLE, False)):
        assert prove(norms_below([h], top * (1 + more)), domain, 3_000).holds is holds
        lipschitz = LipschitzBelow(
            [h[0][0]], Fields(SimpleNamespace(states=("x", "y")), None), slope * (1 + more)
        )
        assert prove(lipschitz, domain, 3_000).holds is holds


NORMS = [
    "norm(x, y)",
    "norm(x, abs(y))",
    "x*norm(x - y, 2*y)",
    "abs(norm(x, y) - 0.3)*y",
    "sin(norm(x, y, x*y))",
]


@pytest.mark.parametrize("text", NORMS)
def test_a_norm_is_smooth_where_it_is_not_zero(text):
    """On boxes that hold a kink, touch one or lie apart, every sampled value and slope is enclosed."""
    generator = np.random.default_rng(5)
    e = term(text)
    field = Field([e, *slopes([e], "x"), *slopes([e], "y")])
    for corner in [*generator.uniform(-1, 1, (30, 2)), (0.0, 0.0), (0.0, -0.2), (-0.1, 0.0), (-0.05, -0.1)]:
        box = [(float(lo), float(lo) + 0.2) for lo in corner]
        found = field.hull(box)
        for at in generator.uniform(*zip(*box, strict=True), (20, 2)):
            exact = field.at([arb(float(v)) for v in at])
            assert all(value.overlaps(ball) for value, ball in zip(exact, found, strict=True)), (box, at)


def test_apart_from_its_kink_a_norm_is_expanded_to_second_order():
    """The largest vertex is off by the third power of the width; by slopes alone it is off by the second."""
    for width in (0.1, 0.05, 0.025):
        (e,), _, _ = Field([term("norm(x, y)")]).expand([(0.3, 0.3 + width), (0.4, 0.4 + width)])
        top = max(float(corner[0, 0].upper()) for corner in e.corners()) + float(e.rest[0].upper())
        assert 0 <= top - math.hypot(0.3 + width, 0.4 + width) < 2 * width**3


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(st.floats(-1, 1), st.floats(-1, 1))
def test_slopes_of_the_left_inverse_of_two_columns(x, y):
    """The identity against differences of numpy's pseudo-inverse; its enclosures on boxes are what is new."""

    def B(x, y):
        return np.array([[2 + np.sin(x), 0.3 * y], [x * y, 1.5], [0.2, np.cos(y)], [1.0, 0.5]])

    rows = [["2 + sin(x)", "0.3*y"], ["x*y", "1.5"], ["0.2", "cos(y)"], ["1", "0.5"]]
    written = SimpleNamespace(B=[list(terms(row, "xy")) for row in rows])
    fields = Fields(SimpleNamespace(states=("x", "y"), B=written.B), None)
    step = 1e-6
    found = _left_inverse_slopes(fields)
    for k, slope in enumerate(found):
        e = step * np.eye(2)[k]
        expected = (np.linalg.pinv(B(x + e[0], y + e[1])) - np.linalg.pinv(B(x - e[0], y - e[1]))) / (
            2 * step
        )
        size = float(norms_below([slope], Fraction(1)).bound([(v, v) for v in (x, y)]))
        assert size == pytest.approx(np.linalg.norm(expected, 2), rel=1e-6, abs=1e-8)


def test_a_constant_b_has_a_left_inverse_without_slopes():
    B = [list(terms(row, "xy")) for row in (["1", "2"], ["0", "3"], ["1", "1"])]
    fields = Fields(SimpleNamespace(states=("x", "y"), B=B), None)
    assert all(all_zero(slope) for slope in _left_inverse_slopes(fields))


def test_the_left_inverse_of_a_crane_is_known_on_wide_boxes():
    """The derivative of the quotient needed boxes of 4e-7 rad: 200 000 were not enough for a tube of .24 rad."""
    rows = ["1/(50 + 20*sin(x)**2)", "-cos(x)/(100 + 40*sin(x)**2)"]
    B = [[e] for e in terms(["0.014*(" + rows[0] + ")", rows[1]], "xy")]
    fields = Fields(SimpleNamespace(states=("x", "y"), B=B), None)
    test = norms_below(_left_inverse_slopes(fields), Fraction(1))
    wide, narrow = (float(test.bound([(0.1, 0.1 + size)])) for size in (1e-3, 1e-9))
    assert wide < 1.1 * narrow


@pytest.mark.parametrize(("B", "upper"), [(3, 2), (Fraction(6, 10**175), Fraction(1, 10**299))])
def test_the_largest_push_is_one_of_numbers_of_every_size(B, upper):
    """Floats lose digits near the smallest of them, and with them a part of the range of mu."""
    push = largest_push(Fraction(B), Fraction(upper))
    assert push is not None
    assert push**2 >= B**2 * upper
