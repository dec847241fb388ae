"""An uncertain gain over a tube: Delta, what joins h, and the identity that theorem H rests on."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from systems import SMALL
from tubecert.bounds.gains import Gain, gain_constants

from tubecert import pipeline
from tubecert.bounds.wind import Beside, uncertainty_constants
from tubecert.coordinates import Coordinates, Fields
from tubecert.enclosure.tape import Tape
from tubecert.model import build
from tubecert.spec import load_text

MACHINE = "hardware: {rate: 500}\n"
TWO = """
tubecert: 1
name: two
system:
  states: [x, y, z]
  inputs: [u, v]
  parameters: {m: [0.8, 1.3], k: [0.1, 0.4]}
  f: ["-x + m*y", "-y + k*sin(x)", "-z + k*x/m"]
  B: [["0", "0"], ["1/m", "k*x/2"], ["-k/m", "1 + k*y"]]
safe_set: {x: [-1, 1], y: [-1, 1], z: [-1, 1]}
uncertainty: {h: ["0.1*sin(t) + 0.05*x", "0.1*z"]}
trajectory: {kind: expressions, x: ["0.1*sin(t)", "0", "0"], u: ["cos(t)", "0.2 + 0.1*t"], horizon: 3}
metric: {rate: 0.5, dual_metric: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
tube: {epsilon: 0.2, rho_a: 0.1}
"""


def gained(text=SMALL, low="0.9", high="1.1", B='["1/m"]'):
    return text.replace("  f: [", f"  parameters: {{m: [{low}, {high}]}}\n  f: [", 1).replace(
        "[1]]", f"{B}]", 1
    )


def values_of(rows, names, at):
    tape = Tape([e for row in rows for e in row], names)
    return tape.run_floats([np.float64(v) for v in at], ()).reshape(len(rows), -1)


@pytest.mark.slow
@pytest.mark.parametrize("S", [None, [["1", "0.2", "0"], ["0", "2", "-0.3"], ["0", "0", "0.5"]]])
def test_the_plant_is_f_and_B_with_an_h_behind_a_gain(S):
    """(H.32): f(x, theta) + B(x, theta)(u + h0) = f + B u* + B (I + Delta)(u - u* + h) + r, at any input."""
    model = build(load_text(TWO + MACHINE, "s.yaml"))
    plan = load_text(TWO + MACHINE, "s.yaml").trajectory
    rows = None if S is None else Coordinates(tuple(tuple(Fraction(q) for q in row) for row in S))
    fields = Fields(model, rows)
    own = Beside(fields, tuple(term.expression for term in plan.u))
    gain = Gain(fields)
    assert gain.is_matched
    names = ("t", *model.states, *dict(model.parameters))
    T = np.eye(3) if S is None else np.array(S, dtype=float)
    random = np.random.default_rng(3)
    for _ in range(20):
        t, x = random.uniform(0, 3), random.uniform(-1, 1, 3)
        theta, u = (
            [random.uniform(float(a), float(b)) for _, (a, b) in model.parameters],
            random.normal(size=2),
        )
        at = (t, *x, *theta)

        def of(rows, at=at):
            return values_of(rows, names, at)

        h0 = of([model.h])[0]
        h = h0 + of([own.known])[0]
        u_star = of([tuple(term.expression for term in plan.u)])[0]
        true = of([model.drift])[0] + of(model.gained) @ (u + h0)
        B, f, r = of(model.B), of([model.f])[0], np.linalg.solve(T, of(own.residual)[:, 0])
        np.testing.assert_allclose(
            true, f + B @ u_star + B @ of(gain.whole) @ (u - u_star + h) + r, atol=1e-12
        )
        np.testing.assert_allclose(of(gain.whole) - np.eye(2), of(gain.error), atol=1e-14)
        np.testing.assert_allclose(of(gain.inverse) @ of(gain.whole), np.eye(2), atol=1e-12)


def test_a_wind_with_a_rate_joins_h_by_the_plant():
    text = gained() + MACHINE + "disturbance: {E: [[0], [2]], bound: 0.1, rate: 3}\n"
    own = Beside(Fields(build(load_text(text, "s.yaml")), None), ())
    assert values_of(own.blown, ("m",), [0.9])[0, 0] == pytest.approx(2 * 0.1 * 0.9)
    assert values_of(own.reached, (), [])[0, 0] == pytest.approx(2)


def suprema_of(text):
    question = pipeline.question_of(load_text(text, "s.yaml"), pipeline.Options(conditions="hardware"))
    return question, question.suprema(pipeline_plan(question)).with_radius(Fraction(3, 10))


def pipeline_plan(question):
    from tubecert.trajectory.make import plan_of

    return plan_of(question.spec, question.model)


def test_constants_enclose_what_sampling_finds():
    """Inputs that hold a weight: an uncertain mass has h = (1 - m)(u* + 0.5 - ...), all of it known in closed form."""
    text = gained(SMALL.replace("input: [0]", "input: [0.4]"), "0.9", "1.1") + MACHINE
    question, suprema = suprema_of(text)
    found = gain_constants(suprema)
    assert found.matched
    assert 1 / 0.9 - 1 <= found.error.above <= (1 / 0.9 - 1) * 1.002
    known = uncertainty_constants(suprema, question.start, {})
    # h = 0.1 sin t + 0.05 x + (1 - m) 0.4
    assert 0.155 - 1e-12 <= known["h"].above <= 0.155 * 1.002
    assert known["h_x"].above == pytest.approx(0.05, rel=2e-3)
    assert known["h_t"].above == pytest.approx(0.1, rel=2e-3)
    assert 0.0425 <= known["h_initial"].above <= 0.0426
    declared = {name: suprema_constant(value) for name, value in (("h", 0.2), ("h_x", 0.1), ("h_t", 0.3))}
    known = uncertainty_constants(suprema, question.start, declared)
    assert 0.24 - 1e-12 <= known["h"].above <= 0.2402


def suprema_constant(value):
    from tubecert.enclosure.constant import Constant

    return Constant(below=value, above=value)


def test_inputs_that_act_elsewhere_are_seen():
    text = gained(B='["1/m"]').replace("B: [[0]", 'B: [["0.01*(m - 1)"]') + MACHINE
    assert not Gain(Fields(build(load_text(text, "s.yaml")), None)).is_matched


def test_without_parameters_in_B_there_is_nothing():
    assert gain_constants(suprema_of(SMALL + MACHINE)[1]) is None
