"""The constants of certificate H where metric and B depend on the state, against sampling and between each other."""

from __future__ import annotations

from dataclasses import fields, replace
from fractions import Fraction

import numpy as np
import pytest
from systems import matrix_of
from tubecert.bounds.covariant import CovariantSuprema
from tubecert.bounds.hardware import HardwareSuprema

from tubecert.bounds.constants import Constant
from tubecert.bounds.suprema import Suprema
from tubecert.coordinates import Coordinates
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import constant, parse, symbol
from tubecert.model import ControlAffineModel
from tubecert.spec import Knots
from tubecert.trajectory import Plan
from tubecert.trajectory.family import family
from tubecert.trajectory.pieces import piecewise_plan

NAMES = ("x1", "x2")
RHO, RATE = 0.25, 1.5
SKEWED = Coordinates(((Fraction(2), Fraction(0)), (Fraction(1, 2), Fraction(1))))
HORIZON = Fraction(6)


def model_of(scale: int = 1) -> ControlAffineModel:
    """A metric that is constant in coordinates of its own, and an input that acts by 2 + sin(x2)."""
    W = [["1", "-0.5*(2 + sin(x2))"], ["-0.5*(2 + sin(x2))", "(2 + sin(x2))**2"]]
    return ControlAffineModel(
        states=NAMES,
        inputs=("u",),
        f=matrix_of([["-x1 + x2", "0.5*x1 - x2 + 0.1*x1*x2"]], NAMES)[0],
        B=matrix_of([["0"], ["2 + sin(x2)"]], NAMES),
        W=matrix_of([[f"{scale}*({e})" for e in row] for row in W], NAMES),
        rate=Fraction(3, 2),
        h=None,
    )


def f(x):
    return np.stack(
        [-x[..., 0] + x[..., 1], 0.5 * x[..., 0] - x[..., 1] + 0.1 * x[..., 0] * x[..., 1]], axis=-1
    )


def B(x):
    return np.stack([0 * x[..., 1], 2 + np.sin(x[..., 1])], axis=-1)


def W(x):
    b = 2 + np.sin(x[..., 1])
    return np.stack([np.stack([1 + 0 * b, -0.5 * b], axis=-1), np.stack([-0.5 * b, b**2], axis=-1)], axis=-2)


def slopes(g, x, h=1e-3):
    """d g/dx_i, the last axis, to fourth order."""
    rows = np.eye(2) * h
    return np.stack(
        [(8 * (g(x + e) - g(x - e)) - g(x + 2 * e) + g(x - 2 * e)) / (12 * h) for e in rows], axis=-1
    )


def F(x):
    f_x = slopes(f, x)
    return (
        f_x @ W(x)
        + W(x) @ np.swapaxes(f_x, -1, -2)
        - np.einsum("...abi,...i->...ab", slopes(W, x), f(x))
        + 2 * RATE * W(x)
    )


def lowered(x):
    M = np.linalg.inv(W(x))
    return M @ F(x) @ M


CURVE = ("0.15*sin(t)", "0.15*(sin(t) + cos(t))")
PLAYED = "0.3*cos(2*t)"


def plan_of_t() -> Plan:
    t = {"t": symbol("t")}
    x = tuple(parse(e, symbols=t).expression for e in CURVE)
    return Plan(x, (parse(PLAYED, symbols=t).expression,), HORIZON)


def on_plan():
    t = np.linspace(0, 6, 61)
    return np.stack([0.15 * np.sin(t), 0.15 * (np.sin(t) + np.cos(t))], axis=-1), 0.3 * np.cos(2 * t)


def sampled(S: np.ndarray) -> dict[str, float]:
    """Every constant by its definition in z = S x, at points of the tube and at many directions."""
    curve, u = on_plan()
    angle = np.linspace(0, 2 * np.pi, 41)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    disc = RHO * np.concatenate([circle, 0.6 * circle, 0.2 * circle]) @ np.linalg.inv(S).T
    x = curve[:, None] + disc
    v = circle[:21] @ np.linalg.inv(S).T  # in x, of length 1 in z: -v is as good as v
    L = np.linalg.cholesky(W(x))
    theta = np.linalg.inv(L)

    def drift(p):
        return f(p) + B(p) * u[:, None, None]

    turns = np.einsum("...abi,ni->...nab", slopes(lowered, x), v)
    turns = np.einsum("...ap,...nab,...bq->...npq", L, turns, L)
    own = curve[:, None]
    tilt = slopes(lambda p: np.einsum("...a,...ab->...b", B(p), np.linalg.inv(W(p))), own)
    tilt = np.einsum("...bi,ni,...bp->...np", tilt, v, np.linalg.cholesky(W(own)))
    t, b = np.linspace(0, 6, 601), B(x) @ S.T
    speed = 0.15 * np.stack([np.cos(t), np.cos(t) - np.sin(t)], axis=-1) @ S.T
    rest = f(own) + B(own) * u[:, None, None]
    return {
        "feedback_slope": np.linalg.norm(theta @ F(x) @ np.swapaxes(theta, -1, -2), 2, axis=(-2, -1)).max(),
        "feedback_curvature": np.linalg.norm(turns, 2, axis=(-2, -1)).max(),
        "plan_tilt": np.linalg.norm(tilt, axis=-1).max(),
        "plan_speed": np.linalg.norm(speed, axis=-1).max(),
        "drift_difference": np.linalg.norm((drift(x) - rest) @ S.T, axis=-1).max(),
        "input_rate": 0.6,
        "noise_size": np.linalg.norm(S, 2),
        "noise_metric": np.sqrt(1 / np.linalg.eigvalsh(W(x))[..., 0]).max(),
        "noise_explained": (np.linalg.norm(b @ S, axis=-1) / np.linalg.norm(b, axis=-1) ** 2).max(),
        "drift_slope": np.linalg.norm(theta @ covariant(drift, x) @ L, 2, axis=(-2, -1)).max(),
        "form_slope": covariant_form(x, L, circle[:21]),
        "input_slope": 0.0,
        "input_gain": np.linalg.norm((theta @ B(x)[..., None])[..., 0], axis=-1).max(),
        "drift_metric": np.linalg.norm((theta @ drift(x)[..., None])[..., 0], axis=-1).max(),
        "curvature": 0.0,
    }


def symbols(x):
    M_x = slopes(lambda p: np.linalg.inv(W(p)), x)
    low = np.einsum("...lji->...lij", M_x) + M_x - np.einsum("...ijl->...lij", M_x)
    return np.einsum("...kl,...lij->...kij", W(x), low) / 2


def covariant(g, x):
    """The covariant derivative of a vector field."""
    return slopes(g, x) + np.einsum("...kij,...j->...ki", symbols(x), g(x))


def covariant_form(x, L, directions):
    turn = np.einsum("...kia,...kb->...abi", symbols(x), lowered(x))
    nabla = slopes(lowered, x) - turn - np.swapaxes(turn, -3, -2)
    nabla = np.einsum("...abi,...ap,...bq,...ir->...pqr", nabla, L, L, L)
    return np.linalg.norm(np.einsum("...pqr,nr->...npq", nabla, directions), 2, axis=(-2, -1)).max()


def suprema_of(
    own: ControlAffineModel, plan: Plan, coordinates: Coordinates | None = None
) -> CovariantSuprema:
    return CovariantSuprema(own, plan, RHO, None, Effort(), coordinates=coordinates)


def found(s: CovariantSuprema) -> dict[str, Constant]:
    """Everything that can be asked for."""
    least, beta = s.metric_bounds()[0], s.metric_input_gain()
    return {
        "feedback_slope": s.feedback_slope(),
        "feedback_curvature": s.feedback_curvature(),
        "plan_tilt": s.plan_tilt(beta),
        "plan_speed": s.plan_speed(Constant.exactly(0.0)),
        "drift_difference": s.drift_difference(),
        "input_rate": s.input_rate(),
        "noise_size": s.noise_size(None),
        "noise_metric": s.noise_metric(None),
        "noise_explained": s.noise_explained(None),
        "drift_slope": s.drift_slope(),
        "form_slope": s.form_slope(least),
        "input_slope": s.input_slope(least, beta),
        "input_gain": s.input_gain(),
        "drift_metric": s.drift_metric(least),
        "curvature": s.curvature(least),
    }


@pytest.fixture(scope="module")
def plain():
    return found(suprema_of(model_of(), plan_of_t()))


# what is 0 is known up to a share of what it is added to, in units of the distance, about 0.08
SMALL = {"curvature": 1e-3 / 0.08**2, "input_slope": 1e-2}


@pytest.mark.slow
@pytest.mark.parametrize("coordinates", [None, SKEWED], ids=["ball", "coordinates"])
def test_constants_are_above_what_is_sampled_and_near_it(coordinates, plain):
    S = np.eye(2) if coordinates is None else np.array(coordinates.rows, dtype=float)
    own = plain if coordinates is None else found(suprema_of(model_of(), plan_of_t(), coordinates))
    for name, value in sampled(S).items():
        assert own[name].above >= value * (1 - 1e-6) - 1e-9, name
        assert own[name].above <= value * 1.03 + SMALL.get(name, 0.0), name
        assert own[name].below <= own[name].above, name


# by what the numbers are multiplied where W is multiplied by 4
SCALES = {
    "plan_tilt": 0.5,
    "noise_metric": 0.5,
    "form_slope": 2.0,
    "input_gain": 0.5,
    "drift_metric": 0.5,
}


@pytest.mark.slow
def test_what_changes_with_the_size_of_the_metric(plain):
    scaled = found(suprema_of(model_of(4), plan_of_t()))
    for name, value in plain.items():
        if name not in SMALL:
            factor = SCALES.get(name, 1.0)
            assert scaled[name].above == pytest.approx(factor * value.above, rel=0.015, abs=1e-8), name


def knots(interpolation, x=((0, 0), ("1/10", "-1/20"), (0, "1/10")), u=(0, "1/5", "-1/10")) -> Knots:
    return Knots(
        t=(Fraction(0), Fraction(1, 2), Fraction(3, 2)),
        x=tuple(tuple(map(Fraction, row)) for row in x),
        u=tuple((Fraction(value),) for value in u),
        interpolation=interpolation,
    )


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["linear", "hold"])
def test_a_plan_through_knots(interpolation):
    own = model_of()
    s = suprema_of(own, piecewise_plan(own, knots(interpolation)))
    rate = s.input_rate()
    if interpolation == "hold":
        assert rate.above == np.inf
    else:
        assert rate.below <= 0.4 <= rate.above <= 0.4 * (1 + 1e-12)
    # the slope of the first piece at its first knot is f + B u there, that is 0; the curve reaches (.1, -.05)
    speed = s.plan_speed(Constant.exactly(0.0))
    assert speed.above >= np.hypot(0.1, 0.05) / 0.5
    assert speed.above <= 1.01 * speed.below
    assert s.plan_tilt(Constant.exactly(0.5)).above > 0.5
    # nothing but the slope of f + B u is known of the difference: rho times it
    assert 0.3 < s.drift_difference().above < 0.6
    still = suprema_of(own, piecewise_plan(own, knots(interpolation, u=("1/5",) * 3)))
    assert still.input_rate() == Constant.exactly(0.0)


@pytest.mark.slow
def test_every_plan_of_a_family():
    own = model_of()
    P = ((Fraction(-1, 10), Fraction(1, 10)), (Fraction(0), Fraction(1, 5)))
    plans = family(NAMES, ("u",), (P, ((Fraction(-1, 10), Fraction(1, 5)),)), Fraction(1, 50), None)
    s = suprema_of(own, plans)
    corner = np.array([-0.1, 0.2])
    fastest = np.linalg.norm(f(corner) + B(corner) * -0.1) + 0.02
    speed = s.plan_speed(Constant(below=0.02, above=0.02))
    assert fastest <= speed.above <= fastest * 1.02
    assert s.input_rate().above == np.inf
    held = family(NAMES, ("u",), (P, ((Fraction(1, 5), Fraction(1, 5)),)), Fraction(1, 50), None)
    assert suprema_of(own, held).input_rate() == Constant.exactly(0.0)
    moving, resting = (
        s.plan_tilt(Constant.exactly(0.5)),
        suprema_of(own, Plan((constant(Fraction(0)),) * 2, (constant(Fraction(0)),), None)),
    )
    # |B'M| L is b^-1 times a constant: its slope is largest where b = 2 + sin(x2) is least
    assert moving.above >= 2 / 3 * (1 - 1e-9)
    assert resting.plan_tilt(Constant.exactly(0.5)) == Constant.exactly(0.0)
    assert s.feedback_slope().above > resting.feedback_slope().above


@pytest.mark.slow
def test_hardware_suprema_are_those_of_the_same_tube():
    s = suprema_of(model_of(), plan_of_t())
    assert {item.name for item in fields(HardwareSuprema)} == {item.name for item in fields(Suprema)}
    wider = replace(s, rho=0.3)
    assert wider.feedback_slope().above > s.feedback_slope().above
