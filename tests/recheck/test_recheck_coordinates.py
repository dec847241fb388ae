"""Tubes in coordinates z = S x of their own: what recheck confirms, and each planted fault that it finds.

The certificate is not the producer's: the system is written in z by hand, certified there with its ball, and what is
found is told of the system in x. Every statement about z must then be confirmed from S alone.
"""

import copy
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from flint import arb
from hypothesis import given
from hypothesis import strategies as st
from rechecked import certified, examine, failing, sealed
from systems import SMALL

from tubecert.errors import TubecertError
from tubecert.expression import number_text
from tubecert.recheck.coordinates import Coordinates, inverted
from tubecert.recheck.tube import Ellipsoid, Round

# W = [[1, -0.3], [-0.3, 1.3]] and S W S' = I: a = A = 1, so that no entry of S may move; x = z1, y = 1.1 z2 - 0.3 z1
S = [["1", "0"], ["3/11", "10/11"]]
IN_X = SMALL.replace('["-0.3", 2]', '["-0.3", "1.3"]')
IN_Z = (
    SMALL.replace('["-x + y", "-y + 0.3*sin(x)"]', '["1.1*y - 1.3*x", "-0.9/11*x - 0.7*y + 3/11*sin(x)"]')
    .replace("B: [[0], [1]]", 'B: [[0], ["10/11"]]')
    .replace('[[1, "-0.3"], ["-0.3", 2]]', "[[1, 0], [0, 1]]")
    .replace("initial_state: {at: [0.05, 0]}", 'initial_state: {at: [0.05, "3/220"]}')
)
FROM_Z = ("constants", "conditions_26", "distance", "no_adaptation", "proof", "decided_by", "reasons")


def in_coordinates():
    """What was proven in z, told of the system in x; half-widths a little more than needed."""
    document, found = copy.deepcopy(certified(IN_X)), certified(IN_Z)["result"]
    result = document["result"]
    result |= copy.deepcopy({key: found[key] for key in FROM_Z})
    for key in ("lower", "upper", "unique_geodesics"):
        result["metric"][key] = found["metric"][key]
    reach = found["tube"]["rho"] * found["constants"]["lower"]["below"] ** 0.5 * (1 + 1e-9)
    widths = {"x": reach, "y": reach * 1.3**0.5}  # dbar sqrt(W_ii)
    result["tube"] = {**found["tube"], "half_widths": widths, "coordinates": S}
    result["spec"]["effective"]["tube"]["coordinates"] = "auto"
    return sealed(document)


@pytest.fixture(scope="module")
def document():
    return in_coordinates()


@pytest.mark.slow
def test_what_holds_in_z_is_confirmed_of_x(document):
    memory = {}
    found = examine(document, memory=memory)
    assert found.verdict == "confirmed", failing(found)


def faulty(document, change):
    document = copy.deepcopy(document)
    change(document["result"])
    return sealed(document)


def first_refusal(document):
    """The claim that fails, or the error."""
    try:
        found = examine(document, 3_000, to_first_failure=True)
    except TubecertError as error:
        return error.findings[0].message
    return None if found.failing is None else found.failing.name


def entry(i, j, factor):
    def change(result):
        rows = [list(row) for row in result["tube"]["coordinates"]]
        rows[i][j] = number_text(Fraction(rows[i][j]) * factor)
        result["tube"]["coordinates"] = rows

    return change


def transposed(result):
    result["tube"]["coordinates"] = [list(row) for row in zip(*result["tube"]["coordinates"], strict=True)]


def swapped(result):  # those of another certificate
    result["tube"]["coordinates"] = [["0.4846", "0"], ["0.1162", "0.5299"]]


def set_to(value):
    return lambda result: result["tube"].update(coordinates=value)


def narrower(name):
    def change(result):
        result["tube"]["half_widths"][name] *= 0.99

    return change


def constant(name, factor):
    side = "below" if name == "lower" else "above"

    def change(result):
        own = result["constants"][name]
        own[side] *= factor
        other = "above" if side == "below" else "below"
        own[other] = (max if side == "below" else min)(own[other], own[side])  # it stays an interval
        if name in ("lower", "upper"):
            result["metric"][name] = [own["below"], own["above"]]

    return change


MORE, LESS = Fraction(101, 100), Fraction(99, 100)
FAULTS = {
    "the first entry larger": entry(0, 0, MORE),
    "the first entry smaller": entry(0, 0, LESS),
    "another entry larger": entry(1, 0, MORE),
    "another entry smaller": entry(1, 0, LESS),
    "the last entry larger": entry(1, 1, MORE),
    "the last entry smaller": entry(1, 1, LESS),
    "transposed": transposed,
    "of another certificate": swapped,
    "singular": set_to([["1", "2"], ["2", "4"]]),
    "the identity": set_to([["1", "0"], ["0", "1"]]),
    "not square": set_to([["1", "0"]]),
    "absent": lambda result: result["tube"].pop("coordinates"),
    "numbers, no texts": set_to([[1, 0], [0.25, 1]]),
    "narrower in x": narrower("x"),
    "narrower in y": narrower("y"),
    "no half-widths": lambda result: result["tube"].pop("half_widths"),
    "a smaller rho": lambda result: result["tube"].update(
        rho=result["tube"]["rho"] * 0.9, rho_r=result["tube"]["rho_r"] - 0.1 * result["tube"]["rho"]
    ),
    "a larger a": constant("lower", 1.01),
    "a smaller A": constant("upper", 0.99),
    **{
        f"a smaller {name}": constant(name, 0.98)
        for name in (
            "f",
            "f_x",
            "B",
            "B_pinv",
            "h",
            "h_x",
            "drift_on_plan",
            "metric_input_gain",
            "feedback_gain",
        )
    },
    "a smaller d0": constant("initial_distance", 0.98),
    "in a specification without": lambda result: result["spec"]["effective"]["tube"].pop("coordinates"),
    "with another A_m": lambda result: result["spec"]["effective"]["adaptation"].update(A_m="-11"),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_found(document, fault):
    assert first_refusal(faulty(document, FAULTS[fault])) is not None


def test_half_widths_must_fit_the_safe_set(document):
    def change(result):
        narrow = {**result["safe_set"], "y": [-0.4, 0.4]}
        result["safe_set"] = narrow
        texts = {name: [str(lo), str(hi)] for name, (lo, hi) in {**narrow, "x": (-1, 1)}.items()}
        result["spec"]["effective"]["safe_set"] = result["claim"]["domain"] = texts

    widths = document["result"]["tube"]["half_widths"]
    assert widths["x"] < 0.4 < widths["y"]
    assert first_refusal(faulty(document, change)) == "the tube lies in the safe set"


@pytest.mark.slow
def test_half_widths_that_were_asked_for_are_kept(document):
    def asked(width):
        def change(result):
            own = result["tube"]
            result["spec"]["effective"]["tube"] = {"coordinates": "auto", "half_widths": {"x": width}}
            result["tube"] = {**own, "epsilon": own["rho_r"] / 2}

        return change

    width = document["result"]["tube"]["half_widths"]["x"]
    wide, narrow = f"{width * 1.01:.6f}".rstrip("0"), f"{width * 0.99:.6f}".rstrip("0")
    assert first_refusal(faulty(document, asked(wide))) is None
    assert first_refusal(faulty(document, asked(narrow))) == "the specification and what repeats it"


# -- the ellipsoid

NUMBERS = st.integers(-30, 30).map(lambda k: Fraction(k, 7))
MATRICES = st.lists(st.lists(NUMBERS, min_size=3, max_size=3), min_size=3, max_size=3)


@given(MATRICES)
def test_an_inverse_is_exact(rows):
    try:
        T = inverted(rows)
    except ValueError:
        assert round(np.linalg.det(np.array(rows, dtype=float)), 6) == 0
        return
    for i, j in product(range(3), repeat=2):
        assert sum(rows[i][k] * T[k][j] for k in range(3)) == (i == j)


@pytest.mark.slow
@given(
    MATRICES,
    st.lists(st.floats(-1, 1), min_size=6, max_size=6),
    st.sampled_from([(0,), (1, 2), (2, 0), (0, 1, 2)]),
)
def test_nothing_that_lies_in_the_ellipsoid_is_cut_off(rows, numbers, which):
    """Points of the set, seen by some of their states, stay in the boxes that contain them; others move into it."""
    try:
        coordinates = Coordinates(tuple(map(tuple, rows)))
    except ValueError:
        return
    rho, sides = Fraction(1, 2), (Fraction(1, 3), Fraction(1, 2), Fraction(2))
    tube = Ellipsoid(coordinates, rho, sides)
    T = np.array(coordinates.inverse, dtype=float)
    z = np.array(numbers[:3])
    point = T @ z * (0.4999 / max(1.0, np.linalg.norm(z)))
    point /= max(1.0, *(np.abs(point) / (np.array(sides, dtype=float) * 0.9999)))
    widths = np.abs(numbers[3:])
    box = [(point[i] - widths[k], point[i] + 0.5 * widths[k]) for k, i in enumerate(which)]
    cut = tube.near(which, box)
    assert cut is not None
    assert all(lo <= point[i] <= hi for i, (lo, hi) in zip(which, cut, strict=True))
    moved = tube.inside(which, [arb(float(3 * point[i])) for i in which])
    if moved is not None:
        Q = np.array(tube.form(which), dtype=float)
        y = np.array([float(x.mid()) for x in moved])
        assert y @ Q @ y <= 0.25 * (1 + 1e-9)
        assert all(abs(x) <= float(sides[i]) for i, x in zip(which, y, strict=True))


def test_a_box_beside_the_ellipsoid_is_cut_off():
    coordinates = Coordinates(((Fraction(1), Fraction(0)), (Fraction(1), Fraction(1))))
    tube = Ellipsoid(coordinates, Fraction(1), (Fraction(2), Fraction(2)))
    assert tube.near([0, 1], [(0.9, 1.0), (0.9, 1.0)]) is None  # (x + y)^2 alone is more than 1
    assert tube.near([0, 1], [(0.6, 0.7), (-0.7, -0.6)]) is not None
    assert tube.near([1], [(1.5, 1.6)]) is None  # y reaches the square root of 2
    assert tube.near([1], [(1.35, 1.6)]) is not None


@pytest.mark.parametrize("size", [Fraction(1, 10**100), Fraction(10**100)])
def test_a_tube_of_which_floats_may_lose_points_is_refused(size):
    own = Coordinates(((Fraction(1),),))
    for make in (
        lambda: Round(size),
        lambda: Ellipsoid(own, size, (Fraction(1),)),
        lambda: Ellipsoid(own, Fraction(1), (size,)),
    ):
        with pytest.raises(ValueError, match="for floats"):
            make()
    with pytest.raises(ValueError, match="for floats"):
        Ellipsoid(Coordinates(((size,),)), Fraction(1), (Fraction(1),)).near([0], [(0.0, 1.0)])
