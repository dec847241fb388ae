"""Every number of a promise and of a class, written a second time from the theory; each test kills a planted bug."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from simulated import Failure, certified, runs, setting

from tubecert.simulate.certified import Section, Values, read_numbers
from tubecert.simulate.compare import compare
from tubecert.simulate.inputs import InputRange
from tubecert.simulate.promise import KINDS, promise
from tubecert.simulate.uncertainty import class_of
from tubecert.spec.types import Output

T = np.linspace(0, 4, 81)


@pytest.fixture
def numbers():
    """A certificate by hand, whose constants are all different."""
    own = read_numbers(certified("flat")[1])
    names = (
        "feedback_gain u_star h h_t h_x h_initial prediction_error initial_distance metric_input_gain B B_x B_pinv "
        "B_pinv_x plan_defect plan_defect_metric drift_on_plan M_x"
    )
    constants = Values({name: 0.3 + 0.11 * i for i, name in enumerate(names.split())})
    alone = Section(
        certified=True, recipe=Values(), ultimate=None
    )  # its class is too large to be certified there
    sections = {**own.sections, "no_adaptation": alone}
    return replace(own, rho=0.7, reach=0.4, upper=1.9, constants=constants, sections=sections)


@pytest.mark.parametrize("key", list(KINDS))
def test_bounds_are_those_of_the_theory(numbers, key):
    c, recipe = numbers.constants, numbers.sections[KINDS[key].name.key].recipe
    kmax = c["feedback_gain"] * 0.4
    R_H = recipe["projection_radius"] if KINDS[key].name.adapts else 0.0
    expected = {
        "distance": 0.4,
        "deviation": 0.7,
        "k": kmax,
        "u": c["u_star"] + kmax + R_H,
        "sigma_error": c["h"] + R_H,
    }
    if key == "none":
        del expected["sigma_error"]
    if key == "26":
        expected["xtilde"] = c["prediction_error"] / recipe["adaptation_rate"] ** 0.5
    if key == "distance":
        s1, q = c["h_t"] + c["h_x"] * recipe["speed"], 2 * recipe["predictor_gain"]
        V = (2 * (c["h"] + R_H) * s1 / q + (c["h"] + R_H) ** 2) / recipe["adaptation_rate"]  # (2.11)
        expected["xtilde"] = V**0.5
    assert promise(numbers, KINDS[key]).bounds == pytest.approx(expected, rel=1e-12)


def test_the_decay_without_adaptation(numbers):
    c, t = numbers.constants, np.linspace(0, 5, 50)
    pushed = (c["metric_input_gain"] * c["h"] + c["plan_defect_metric"]) / numbers.rate
    expected = pushed + (c["initial_distance"] - pushed) * np.exp(-numbers.rate * t)
    assert promise(numbers, KINDS["none"]).decay(t) == pytest.approx(expected, rel=1e-12)


def test_pushes_are_bounded_where_metric_and_inputs_are_constant(numbers):
    """B'M gamma_s changes with x by |B| A, with t by |B| A |x*'|, and |x*'| <= |f + B u*| + |p|."""
    assert class_of(numbers, 2, 1).push is None
    c = numbers.constants
    c["M_x"] = c["B_x"] = 0.0
    slope = c["B"] * 1.9
    assert class_of(numbers, 2, 1).push == pytest.approx(
        (slope, slope * (c["drift_on_plan"] + c["plan_defect"]))
    )
    assert class_of(replace(numbers, upper=None), 2, 1).push is None


def around(share, *, of_distance=None, sign=1):
    where = setting("flat")
    pulse = np.exp(-((T - 2) ** 2))
    x = np.zeros((1, len(T), 2))
    x[:, :, 1] = sign * where.rho * share * pulse
    return where, runs(T, x, (where.reach * (of_distance or share) * pulse)[None])


def test_the_distance_alone_may_leave_the_tube():
    where, found = around(0.5, of_distance=1.02)
    assert compare(where, found, None).outside == (0,)


@pytest.mark.parametrize("sign", [-1, 1])
def test_half_widths_count_to_both_sides(sign):
    where, found = around(0.5, sign=sign)
    promised = promise(where.certified, KINDS["distance"])
    narrow = replace(promised, half_widths=(1.0, 0.4 * where.rho), decay=None)
    assert [item.name for item in compare(where, found, narrow).violations] == ["half-width of v"]


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(("width", "broken"), [(1.01, []), (0.99, ["half-width of both"])])
def test_outputs_keep_to_their_half_widths(sign, width, broken):
    """2 v goes to rho and back."""
    where, found = around(0.5, sign=sign)
    where = replace(
        where, spec=replace(where.spec, outputs=(Output(name="both", row=(Fraction(1), Fraction(2))),))
    )
    promised = replace(
        promise(replace(where.certified, output_widths=(width * where.rho,)), KINDS["distance"]),
        half_widths=(1.0, where.rho),
        decay=None,
    )
    assert [item.name for item in compare(where, found, promised).violations] == broken


@pytest.mark.parametrize(("share", "left"), [(1.9, False), (2.1, True)])
def test_a_run_that_is_stopped_has_left_the_tube_beyond_two_radii(share, left):
    where, found = around(share)
    stopped = replace(found, error=np.array([np.inf]), failures=(Failure(lane=0, t=2.5, reason="stopped"),))
    assert compare(where, stopped, None).outside == ((0,) if left else ())


@pytest.mark.parametrize(("least", "broken"), [(-0.9, []), (-1.1, ["input -u"])])
def test_inputs_stay_in_their_ranges(least, broken):
    where, found = around(0.5)
    ranges = (InputRange(name="u", column=0, least=-1.0, greatest=2.0),)
    promised = replace(promise(where.certified, KINDS["distance"]), ranges=ranges, decay=None)
    found = replace(found, least=np.array([[least]]), greatest=np.array([[1.0]]))
    compared = compare(where, found, promised)
    assert [item.name for item in compared.violations] == broken
    assert (compared.inputs[0].least, compared.inputs[0].proven) == (least, (-1.0, 2.0))
