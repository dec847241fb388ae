"""An f that depends on t: C2 and every constant hold at all times of the horizon, for the producer and for recheck."""

import copy
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from rechecked import certified, doubted, examine, failing, respecified, sealed, written
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError, TubecertError
from tubecert.findings import Severity
from tubecert.metric.verify import verify_metric
from tubecert.model import build
from tubecert.pipeline import Options, certify, synthesise
from tubecert.pipeline.membership import membership
from tubecert.spec import Synthesis, load_text

SPEC = (Path(__file__).parents[1] / "specs/ok/moving.yaml").read_text(encoding="utf-8")


def made():
    return copy.deepcopy(certified(SPEC, conditions="distance", gap=Fraction(1, 5)))


def value(document, name):
    found = document["result"]["constants"][name]
    return found["below"], found["above"]


def test_the_rate_is_that_of_the_worst_time():
    """On B'v = 0, v = (1, 0): the rate is 1 - 0.1 sin(2t) + 0.3, least at 2t = pi/2; over [0, 1/10] at its end."""
    spec = load_text(SPEC)
    model = build(spec)
    for horizon, least in ((3, 1.2), (Fraction(1, 10), 1.3 - 0.1 * np.sin(0.2))):
        proof = verify_metric(replace(model, time=(Fraction(0), horizon)), spec.safe_set, Effort())
        assert proof.largest_rate.below <= least <= proof.largest_rate.above
        assert proof.largest_rate.above - proof.largest_rate.below < 0.01
    assert not proof.is_about(model, spec.safe_set)  # a proof for another horizon


@pytest.mark.slow
def test_constants_hold_at_all_times():
    document = made()
    rho = float(document["result"]["tube"]["rho"])
    generator = np.random.default_rng(1)
    t = generator.uniform(0, 3, 200_000)
    v = generator.normal(size=(2, len(t)))
    x, y = rho * v / np.linalg.norm(v, axis=0)
    f = np.array([-x + y + 0.1 * np.sin(2 * t) * x, -0.5 * y + 0.3 * np.cos(t) * np.sin(x) + 0.2 * t * x])
    below, above = value(document, "f")
    assert 0.99 * below <= np.linalg.norm(f, axis=0).max() <= above
    assert value(document, "drift_on_plan")[1] >= np.linalg.norm(f, axis=0).max()
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_what_the_plan_misses_is_bounded_at_all_times():
    """Rest where f(t, 0) = (0, 0.1 sin(t)) is no equilibrium: |p| is 0.1 at its largest."""
    text = SPEC.replace("+ 0.2*t*x", "+ 0.2*t*x + 0.1*sin(t)")
    document = copy.deepcopy(certified(text, conditions="distance"))
    below, above = value(document, "plan_defect")
    assert below <= 0.1 <= above < 0.101
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_a_plan_that_moves_is_compared_with_f_at_its_time():
    """x* = 0.1 sin(t), y* and u* as f(t, x) demands: nothing is missing, and shifted by a moment something is."""
    y = "0.1*cos(t) + 0.1*sin(t) - 0.01*sin(2*t)*sin(t)"
    slope = "-0.1*sin(t) + 0.1*cos(t) - 0.02*cos(2*t)*sin(t) - 0.01*sin(2*t)*cos(t)"
    u = f"{slope} + 0.5*({y}) - 0.3*cos(t)*sin(0.1*sin(t)) - 0.02*t*sin(t)"
    resting = "{kind: equilibrium, at: [0, 0], input: [0], horizon: 3}"
    moving = f'{{kind: expressions, x: ["0.1*sin(t)", "{y}"], u: ["{u}"], horizon: 1}}'
    document = copy.deepcopy(certified(SPEC.replace(resting, moving), conditions="distance"))
    assert document["result"]["verdict"] == "certified"
    assert value(document, "plan_defect") == (0, 0)
    assert failing(examine(document)) == []

    def shifted(effective):
        f = effective["system"]["f"]
        effective["system"]["f"] = [e.replace("cos(t)", "cos(t + 0.01)") for e in f]

    assert doubted(respecified(document, shifted))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new"), [("0.2*t*x", "0.3*t*x"), ("0.3*cos(t)", "2.9*cos(t)"), ("0.1*sin(2*t)", "t")]
)
def test_another_f_is_not_confirmed(old, new):
    def changed(effective):
        f = effective["system"]["f"]
        assert any(old in e for e in f)
        effective["system"]["f"] = [e.replace(old, new) for e in f]

    assert doubted(respecified(made(), changed))


@pytest.mark.slow
def test_a_longer_horizon_is_not_confirmed():
    """t x grows: what holds for 3 s does not for 9."""
    document = respecified(made(), lambda effective: effective["trajectory"].update(horizon="9"))
    document["result"]["claim"]["horizon"] = "9"
    try:
        assert doubted(sealed(document))
    except TubecertError as error:  # the claim is another one
        assert "horizon" in str(error)  # noqa: PT017


@pytest.mark.slow
def test_what_no_theorem_covers_is_refused():
    with pytest.raises(TubecertError, match="no expression"):
        examine(respecified(made(), lambda e: e["system"].update(B=[["0.001*t"], ["1"]])))


@pytest.mark.slow
def test_a_plan_is_found():
    """iLQR integrates f at its times, so little is missing."""
    rest = "{kind: equilibrium, at: [0, 0], input: [0], horizon: 3}"
    task = "{kind: ilqr, target: [0.1, 0.1], goal: false, horizon: 1, knots: 6}"
    text = SPEC.replace(rest, task).replace("-0.5*y + 0.3*cos(t)*sin(x)", "-y")
    document = copy.deepcopy(certified(text, conditions="distance"))
    assert value(document, "plan_defect")[1] < 1e-3
    assert failing(examine(document)) == []
    slower = respecified(document, lambda e: e["system"]["f"].__setitem__(1, "-y + 0.3*t*x"))
    assert doubted(slower)


def test_no_metric_is_searched_for():
    spec = load_text(SPEC)
    wanted = load_text(
        SPEC.replace("0.1*sin(2*t)", "0.1")
        .replace("cos(t)", "1")
        .replace("t*x", "x")
        .replace("metric: {rate: 0.5, dual_metric: [[1, -0.3], [-0.3, 2]]}", "metric: {synthesise: {}}")
    ).synthesis
    assert isinstance(wanted, Synthesis)
    with pytest.raises(SpecError, match="metrics are not found"):
        synthesise(spec, wanted, Options())


PERIODIC = """\
tubecert: 1
name: swinging
system:
  states: [x, y]
  inputs: [u]
  f: ["-x + y + 0.1*sin(2*t)*x", "-y + 0.2*cos(3*t)"]
  B: [[0], [1]]
safe_set: {x: [-1, 1], y: [-1.5, 1.5]}
uncertainty: {h: ["0.1*sin(3/2*t)"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
metric: {rate: 0.5, dual_metric: [[1, -0.3], [-0.3, 2]]}
tube: {epsilon: 0.3, rho_a: 0.1, gap: auto}
initial_state: {within: 0.05}
"""
FAMILY = PERIODIC.replace(
    "{kind: equilibrium, at: [0, 0], input: [0]}",
    "{kind: any, x: {x: [-0.2, 0.2], y: [-0.3, 0.3]}, u: {u: [-0.5, 0.5]}, defect: 0.02}",
)


@pytest.mark.slow
@pytest.mark.parametrize("text", [PERIODIC, FAMILY], ids=["rest", "family"])
def test_one_period_is_all_time(text):
    """2, 3 and 3/2 rad/s have the period 4 pi; suprema are reached at times that no shorter range has."""
    document = copy.deepcopy(certified(text, conditions="distance"))
    result = document["result"]
    assert (result["claim"]["for_all_time"], result["claim"]["period"]) == ("periodic", "4*pi")
    rho = float(result["tube"]["rho"])
    generator = np.random.default_rng(2)
    t = generator.uniform(0, 100, 200_000)
    v = generator.normal(size=(2, len(t)))
    centre, u = np.zeros((2, len(t))), 0.0
    if text is FAMILY:
        centre = generator.choice([-1, 1], size=centre.shape) * np.array([[0.2], [0.3]])
        u = generator.choice([-0.5, 0.5], size=len(t))
    x, y = centre + rho * v / np.linalg.norm(v, axis=0)
    f = np.array([-x + y + 0.1 * np.sin(2 * t) * x, -y + 0.2 * np.cos(3 * t) + u])
    below, above = value(document, "drift_on_plan")
    assert 0.97 * below <= np.linalg.norm(f, axis=0).max() <= above
    assert failing(examine(document)) == []
    slower = respecified(
        document, lambda e: e["system"].update(f=["-x + y + 0.1*sin(2*t)*x", "-y + 0.2*cos(9/4*t)"])
    )
    assert ("the claim is that of the specification", "claim.period is not that of the specification") in (
        failing(examine(slower, to_first_failure=True))
    )
    longer = respecified(document, lambda e: e["system"].update(f=["-x + y + 0.1*sin(2*t)*x", "-y + 0.2*t"]))
    with pytest.raises(TubecertError, match="period"):
        examine(longer)


@pytest.mark.slow
def test_a_family_has_members_by_their_own_time():
    family = load_text(FAMILY)
    u = "0.057*cos(3*t) + 0.019*sin(3*t) - 0.2*cos(3*t)"

    def member(u):
        plan = f'{{kind: expressions, x: ["0", "0.019*sin(3*t)"], u: ["{u}"], horizon: 3}}'
        return load_text(PERIODIC.replace("{kind: equilibrium, at: [0, 0], input: [0]}", plan))

    (found,) = membership(member(u), family, "plan")
    assert found.severity is Severity.NOTE  # x* = 0 misses y* by 0.019
    (found,) = membership(member(u.replace("0.2*cos(3*t)", "0.2*cos(3*t + 0.2)")), family, "plan")
    assert "misses" in found.message
    (found,) = membership(load_text(PERIODIC), family, "rest")
    assert "0.2 at t = " in found.message  # |f(t, 0)|, which is no equilibrium


@pytest.mark.slow
def test_knots_know_their_time(tmp_path):
    """Slopes f(t, x) + B u at the knots: what the plan misses, against a spline by scipy."""
    t = np.linspace(0, 2, 21)
    u = 0.1 * t

    def f(t, z):
        return np.array([-z[0] + z[1] + 0.1 * np.sin(2 * t) * z[0], -z[1] + 0.2 * np.cos(3 * t) + 0.1 * t])

    x = solve_ivp(f, (0, 2), [0.05, 0], t_eval=t, rtol=1e-10, atol=1e-12).y
    rows = [f"{a:.9f},{b:.9f},{c:.9f},{d:.9f}" for a, b, c, d in zip(t, *x, u, strict=True)]
    (tmp_path / "plan.csv").write_text("\n".join(["t,x,y,u", *rows]) + "\n", encoding="utf-8")
    text = PERIODIC.replace(
        "{kind: equilibrium, at: [0, 0], input: [0]}", "{kind: csv, file: plan.csv}"
    ).replace("{within: 0.05}", "{at: [0.05, 0]}")
    spec = load_text(text, str(tmp_path / "spec.yaml"))
    document = written(certify(spec, Options(conditions="distance")).to_json())
    spline = CubicHermiteSpline(t, x.T, np.array([f(a, z) for a, z in zip(t, x.T, strict=True)]))
    s = np.linspace(0, 2, 5001)
    missed = np.array([spline(a, 1) - f(a, spline(a)) for a in s])
    below, above = value(document, "plan_defect")
    assert above < 2e-4
    assert below * (1 - 1e-6) <= np.linalg.norm(missed, axis=1).max() * 1.01
    assert np.linalg.norm(missed, axis=1).max() <= above
    assert failing(examine(document)) == []
    document["result"]["constants"]["plan_defect"] |= {"above": 0.5 * above, "below": 0.4 * below}
    assert doubted(sealed(document))


@pytest.mark.parametrize("h", ["sin(pi*t)", "t", "sin(t**2)"])
def test_what_has_no_common_period_needs_a_horizon(h):
    with pytest.raises(SpecError, match="so a trajectory with a horizon is needed"):
        load_text(PERIODIC.replace("0.1*sin(3/2*t)", h))


# -- a wind and parameters known by ranges, beside an f that depends on t (theory 4e.4)

UNKNOWN = (
    PERIODIC.replace("inputs: [u]", "inputs: [u]\n  parameters: {c: [0.8, 1.2]}")
    .replace('"-x + y + 0.1*sin(2*t)*x", "-y + 0.2*cos(3*t)"', '"-x + y + 0.1*c*sin(2*t)", "-y + c*cos(t)*x"')
    .replace("sin(3/2*t)", "sin(3*t)")
    + 'disturbance: {E: [["0.1"], ["1"]], bound: 0.02, rate: 0.5}\nconditions: {decides: B}\n'
)
DECLARED = UNKNOWN.replace('h: ["0.1*sin(3*t)"]', "bounds: {h: 0.1, h_x: 0, h_t: 0.3}")


def unknown(text=UNKNOWN):
    return copy.deepcopy(certified(text, conditions="distance", gap=Fraction(1, 5)))


@pytest.mark.slow
def test_what_is_not_known_of_f_moves_in_time():
    """With c = 1 in the middle, h is 0.1 sin 3t + (c - 1) cos(t) x + w and r = (0.1 (c - 1) sin 2t, 0)."""
    document = unknown()
    result = document["result"]
    assert result["claim"]["period"] == "2*pi"
    rho = float(result["tube"]["rho"])
    t, x = np.meshgrid(np.linspace(0, 2 * np.pi, 2001), np.linspace(-rho, rho, 41))
    for name, most in (
        ("h", 0.02 + max(np.abs(0.1 * np.sin(3 * t) + s * 0.2 * np.cos(t) * x).max() for s in (1, -1))),
        ("h_t", 0.5 + max(np.abs(0.3 * np.cos(3 * t) - s * 0.2 * np.sin(t) * x).max() for s in (1, -1))),
        ("h_x", 0.2),
        ("residual_size", 0.02),
    ):
        below, above = value(document, name)
        assert 0.98 * below <= most <= above * (1 + 1e-9) <= most * 1.02
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_a_declared_rate_of_h_does_not_hide_that_of_f():
    document = unknown(DECLARED)
    rho = float(document["result"]["tube"]["rho"])
    most = 0.3 + 0.5 + 0.2 * rho
    assert most <= value(document, "h_t")[1] <= 1.01 * most
    assert failing(examine(document)) == []
    document["result"]["constants"]["h_t"] |= {"above": 0.8 + 0.19 * rho, "below": 0.0}
    assert any(name.startswith("h_t") for name, _ in failing(examine(sealed(document))))


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        lambda e: e["system"].update(f=["-x + y + 0.1*c*sin(2*t)", "-y + c*cos(4*t)*x"]),
        lambda e: e["system"].update(f=["-x + y + 0.11*c*sin(2*t)", "-y + c*cos(t)*x"]),
        lambda e: e["system"].update(f=["-x + y + 0.1*c*sin(2*t)", "-y + cos(c*t)*x"]),
    ],
    ids=["frequency", "residual", "an unknown frequency"],
)
def test_another_unknown_part_is_not_confirmed(change):
    document = respecified(unknown(), change)
    try:
        assert doubted(document)
    except TubecertError as error:  # no period is to be seen
        assert "period" in str(error)  # noqa: PT017


def test_a_part_of_f_that_is_unknown_alone_depends_on_time():
    """At c = 1, the middle, nothing moves: C2 has no t, h has."""
    text = UNKNOWN.replace("c*sin(2*t)", "(c - 1)*sin(2*t)").replace("c*cos(t)", "(c - 1)*cos(t)")
    spec = load_text(text)
    assert build(spec).time is not None
    assert returned(text.replace("cos(t)", "cos(c*t)")) == "no period"


def returned(text):
    try:
        load_text(text)
    except SpecError as error:
        return "no period" if "without a period" in str(error) else str(error)
    return ""
