"""What a predicted state is off by: the bound against solutions in 40 digits, its parts, and its power series."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from flint import arb, ctx
from followed import predicting, texts
from tubecert.export import prediction
from tubecert.export.assembly import controller_of
from tubecert.export.followed import UncoveredError
from tubecert.export.program import FUNCTIONS, Writer
from tubecert.export.reference import Reference, execute
from tubecert.export.rounding import rounding_of
from tubecert.export.series import ORDER, moving, run
from tubecert.recheck.code.examination import about
from tubecert.recheck.code.losses import lost_by
from tubecert.recheck.code.reader import read_code
from tubecert.recheck.controller import machine_of

import tubecert as tc
from tubecert.enclosure.interval import Interval


def solution(c, t, y, kappa):
    """Theorem H-P's yp after the delay, by many steps of the same rule in 40 digits."""
    steps, h = 60, mpmath.mpf(c.delay.numerator) / c.delay.denominator / 60

    def speed(x, s):
        u = kappa if c.adds_plan else kappa + 2 * mpmath.cos(2 * s)
        return mpmath.matrix(_field(x, u))

    x = mpmath.matrix(y)
    for k in range(steps):
        s = t + k * h
        k1 = speed(x, s)
        k2 = speed(x + h / 2 * k1, s + h / 2)
        k3 = speed(x + h / 2 * k2, s + h / 2)
        k4 = speed(x + h * k3, s + h)
        x += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def _field(x, u):
    """hardware_orbit."""
    f = -x[0] + 2 * x[1], -mpmath.mpf(1) / 4 * x[1] ** 3 - 3 * x[0] + 4 * x[1]
    return f[0] + u / 2, f[1] - 2 * u


def worst(c, real, count):
    """How far the code's own programs are from solutions."""
    generator = np.random.default_rng(3)
    found = 0.0
    for k in generator.integers(0, 600, size=count):
        own = Reference(controller=c, real=real, sample=int(k))
        x = own.plan(own.time())[0][0]
        y = (x + generator.uniform(-0.1, 0.1, size=2)).astype(real)[None]
        own.feedback = np.array([[generator.uniform(-1, 1)]]).astype(real)
        end = own.predicted(y)[0]
        with mpmath.workdps(40):
            t = mpmath.mpf(int(k)) * c.sample_time.numerator / c.sample_time.denominator
            exact = solution(c, t, [float(q) for q in y[0]], mpmath.mpf(float(own.feedback[0, 0])))
            found = max(found, float(mpmath.norm(mpmath.matrix([float(q) for q in end]) - exact)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("delay", ["0.0005", "0.01"])
@pytest.mark.parametrize(("precision", "real"), [("single", np.float32), ("double", np.float64)])
def test_a_prediction_is_within_its_bound(precision, real, delay):
    c, _ = predicting(delay, held=True)
    bound = float(rounding_of(c, precision).prediction)
    found = worst(c, real, 12)
    assert 1e-5 * bound < found <= bound


@pytest.mark.slow
def test_without_what_the_rule_is_off_the_bound_is_false(monkeypatch):
    """At a long delay the integration is what counts."""
    c, _ = predicting("0.01", held=True)
    whole = rounding_of(c, "double").prediction
    monkeypatch.setattr(prediction, "_cut", lambda c, x, *_: [0 * own for own in x])
    assert rounding_of(c, "double").prediction < worst(c, float, 4) < whole


def test_a_long_delay_has_no_bound():
    c, _ = predicting("0.2", held=True)
    with pytest.raises(UncoveredError, match="so long a delay") as caught:
        rounding_of(c, "double")
    assert caught.value.help.endswith("or leave hardware.predict out")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_series_hold_every_derivative(name):
    """Of g(x + s) + (x + s) g(x + s)/(2 + x + s), at every x of a range."""
    writer = Writer()
    (x,) = writer.input("x", 1)
    value = writer.call(name, x)
    share = writer.div(writer.mul(x, value), writer.add(writer.constant(2), x))
    writer.output("y", [writer.add(value, share)])
    program = writer.finished("program", "g")
    low, high = Fraction(3, 10), Fraction(7, 20)
    own = run(program, {"x": [moving(Interval.of(low).hull(Interval.of(high)), Interval.of(1))]})["y"][0]
    function = getattr(mpmath, name)
    with mpmath.workdps(30):
        for q in (0.3, 0.325, 0.35):
            exact = mpmath.taylor(lambda s: function(s) * (1 + s / (2 + s)), mpmath.mpf(q), ORDER)
            for k in range(ORDER + 1):
                assert float(own[k].lo) - 1e-12 <= exact[k] <= float(own[k].hi) + 1e-12
                assert float(own[k].hi - own[k].lo) < 3 + 3 * abs(exact[k])


def test_slopes_of_the_model_are_those_of_its_speed():
    c, _ = predicting("0.0005", held=True)
    x, u, h = np.array([[0.3, -0.2]]), np.array([[0.4]]), 1e-6
    J, B = execute(c.steep, x, u)
    for j in range(2):
        aside = np.eye(2)[j] * h
        slope = (execute(c.flow, x + aside, u)[0] - execute(c.flow, x - aside, u)[0]) / (2 * h)
        assert slope[0] == pytest.approx(J[0].reshape(2, 2)[:, j], abs=1e-8)
    assert B[0].tolist() == [0.5, -2.0]


STRETCHED = """
tubecert: 1
name: stretched
system:
  states: [x, y]
  inputs: [u]
  parameters: {s: 20}
  f: ["-x + 2*y", "-0.25*s**2*y**3 - 3*x + 4*y"]
  B: [["0.5/s"], ["-2/s"]]
safe_set: {x: ["-6/s", "6/s"], y: ["-6/s", "6/s"]}
uncertainty: {h: ["0.1*sin(2*t)"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
metric:
  rate: 1.74
  dual_metric: [["4.25828/s**2", "-0.93423/s**2"], ["-0.93423/s**2", "3.76692/s**2"]]
tube: {epsilon: 0.3, rho_a: 0.05, coordinates: auto}
hardware: {rate: 500, delay: 0.002, noise: "0.00001/s", predict: true, arithmetic: double}
conditions: {decides: H}
"""


@pytest.mark.slow
@pytest.mark.usefixtures("barely")
def test_what_a_prediction_is_off_is_a_length_in_the_coordinates_of_the_tube(tmp_path):
    """r_p stands beside np in (H.17): |S| times what it is in x; and recheck looks as far as n_P = sqrt(A) np says."""
    path = tmp_path / "stretched.yaml"
    path.write_text(STRETCHED)
    result = tc.certify(path)
    assert result.certified
    machine = machine_of(result.text, "certificate")
    S = np.array([[float(q) for q in row] for row in machine.case.tube.coordinates])
    size = np.linalg.norm(S, 2)
    assert size > 10
    c = controller_of(result.certificate)
    assert float(c.stretch) >= size * (1 - 1e-12)
    found, plain = (rounding_of(own, "double").prediction for own in (c, replace(c, stretch=Fraction(1))))
    assert found == pytest.approx(float(c.stretch) * float(plain), rel=1e-9)
    with ctx.workprec(200):
        own = about(machine)
        assert float(own.stretch) == pytest.approx(size, rel=1e-9)
        far = float(machine.recipe.level) + np.sqrt(float(machine.case.bound("upper"))) * float(
            machine.recipe.prediction
        )
        assert float(own.reach) == pytest.approx(far, rel=1e-9)
        code = read_code(*texts(c, "double"))
        lost, short = (lost_by(code, each).prediction for each in (own, replace(own, stretch=arb(1))))
        assert float(lost) == pytest.approx(size * float(short), rel=1e-6)
