"""Tubes measured by the metric, end to end: gains depend on no units, only half-widths must fit into the safe set."""

import re
from fractions import Fraction

import numpy as np
import pytest
from texts import CONFIGS

from tubecert.certificate.result import Result
from tubecert.claims.statements import PlanInSafeSet, StartInTube, TubeInSafeSet
from tubecert.errors import SpecError
from tubecert.pipeline import Options, certify
from tubecert.simulation.adaptive.campaign import cases
from tubecert.simulation.adaptive.engine import integrate
from tubecert.simulation.adaptive.flows import Fast
from tubecert.simulation.adaptive.judge import compare
from tubecert.simulation.adaptive.setting import Choice, loop_of, setting_of
from tubecert.spec import load, load_text
from tubecert.verdict import Verdict

COARSE = Options(gap=Fraction(1, 5))
pytestmark = pytest.mark.usefixtures("barely")
# a link and a motor behind a spring; W for speeds in rad/s
JOINT = np.array(
    [
        [2.3016, -3.1262, 1.0781, 5.0602],
        [-3.1262, 29.5904, -7.9889, -11.166],
        [1.0781, -7.9889, 4.443, -5.0177],
        [5.0602, -11.166, -5.0177, 89.4433],
    ]
)


def joint(s: int, tube: str = "half_widths: {q: 0.15}") -> str:
    """A flexible joint with speeds in s rad/s."""
    scale = np.diag([1, 1 / s, 1, 1 / s])
    W = [[repr(float(value)) for value in row] for row in scale @ JOINT @ scale]
    return f"""tubecert: 1
name: joint
system:
  states: [q, w, th, om]
  inputs: [tau]
  parameters: {{s: {s}}}
  f: [s*w, (-10*(q - th) - 5*sin(q))/s, s*om, 20*(q - th)/s]
  B: [[0], [0], [0], [2/s]]
safe_set: {{q: [-1, 1], w: [-8/s, 8/s], th: [-2, 2], om: [-20/s, 20/s]}}
uncertainty: {{h: ["0.05*sin(t) + 0.02*norm(q)"]}}
trajectory: {{kind: equilibrium, at: [0, 0, 0, 0]}}
metric: {{dual_metric: {W}, rate: 1}}
tube: {{{tube}}}
"""


def gains(result: Result) -> dict[str, float]:
    """The numbers of every kind's recipe that a controller takes."""
    taken = ("bandwidth", "adaptation_rate")
    recipes = result.to_json()["proof"]
    return {
        f"{key} {name}": recipe[name] for key, recipe in recipes.items() for name in taken if name in recipe
    }


@pytest.fixture(scope="module")
def plain() -> Result:
    result = certify(load_text(joint(1)), COARSE)
    assert result.verdict is Verdict.CERTIFIED
    assert len(gains(result)) == 4
    return result


@pytest.mark.slow
@pytest.mark.parametrize("s", [4, 12])
def test_units_change_no_gain(plain, s):
    """Issue of the flexible joint: omega was 1017 for s = 1, 93 for s = 4 and 11 for s = 12."""
    other = certify(load_text(joint(s)), COARSE)
    assert gains(other) == pytest.approx(gains(plain), rel=5e-3)
    for name, width in plain.tube.half_widths.items():
        expected = width / s if name in ("w", "om") else width
        assert other.tube.half_widths[name] == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_the_same_half_widths_need_less_of_the_filter_than_a_ball():
    """A row of the table in docs/tubes.md: speeds in 4 rad/s, which was the best that scaling by hand could do."""
    ball = certify(load_text(joint(4, tube="epsilon: 0.05, rho_a: 0.03, coordinates: identity")), COARSE)
    scale = {"q": 1, "w": 4, "th": 1, "om": 4}
    widths = {name: width * scale[name] for name, width in ball.tube.half_widths.items()}
    asked = ", ".join(f"{name}: {width:.3g}" for name, width in widths.items())
    free = certify(load_text(joint(1, tube=f"half_widths: {{{asked}}}")), COARSE)
    assert free.verdict is Verdict.CERTIFIED
    assert all(free.tube.half_widths[name] <= 1.006 * width for name, width in widths.items())
    assert 5 * gains(free)["conditions_26 bandwidth"] < gains(ball)["conditions_26 bandwidth"]


PENDULUM = """tubecert: 1
name: pendulum
system: {states: [q, w], inputs: [tau], f: [w, "9.81*sin(q) - 0.1*w"], B: [[0], [1]]}
safe_set: {q: [-0.4, 0.4], w: [-2, 2]}
uncertainty: {h: ["0.2*sin(t) + 0.05*norm(w)"]}
trajectory: {kind: equilibrium, at: [0, 0]}
metric: {rate: 1, dual_metric: [[0.3, -0.6], [-0.6, 2.4]]}
tube: {TUBE}
"""


@pytest.mark.slow
def test_a_tube_whose_half_widths_fit_is_not_refused():
    """The ball of w's size leaves the safe set through q, which never moves so far."""
    refused = certify(load_text(PENDULUM.replace("TUBE", "epsilon: 0.4, rho_a: 0.4")), COARSE)
    assert refused.verdict is Verdict.REFUTED
    assert isinstance(refused.reason.claim, TubeInSafeSet)
    found = certify(load_text(PENDULUM.replace("TUBE", "half_widths: {q: 0.3}")), COARSE)
    assert found.verdict is Verdict.CERTIFIED
    widths = found.tube.half_widths
    assert widths["q"] == pytest.approx(0.3, rel=1e-6)
    assert widths["w"] == pytest.approx(0.3 * np.sqrt(2.4 / 0.3), rel=1e-6)
    assert float(found.tube.rho) > 0.4  # a ball of that radius would leave


@pytest.mark.slow
def test_a_radius_is_how_far_the_state_is_off_that_moves_farthest_whatever_the_scale_of_the_metric():
    text = PENDULUM.replace("TUBE", "epsilon: 0.4, rho_a: 0.4, coordinates: auto")
    own = certify(load_text(text), COARSE)
    quarter = certify(
        load_text(text.replace("[[0.3, -0.6], [-0.6, 2.4]]", "[[1.2, -2.4], [-2.4, 9.6]]")), COARSE
    )
    for found in (own, quarter):
        assert found.verdict is Verdict.CERTIFIED
        assert float(found.tube.rho) == pytest.approx(0.8)
        assert found.tube.half_widths["w"] == pytest.approx(0.8, rel=1e-5)
        assert found.tube.half_widths["q"] == pytest.approx(0.8 * np.sqrt(0.3 / 2.4), rel=1e-5)
    assert gains(own) == pytest.approx(gains(quarter), rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "asked",
    [
        "q: 0.4",  # what there is to the last digit
        "q: 0.5",  # a half-width is a bound: what there is does as well
        "q: 0.5, w: 1.2",  # w alone is certified; a bound that is no tighter takes nothing away
        "w: 2.5",  # q leaves less: the tube is narrower, and w never goes so far
        "q: 0.5, w: 0.2",  # nor does q
    ],
)
def test_what_the_tube_does_not_reach_need_not_fit(asked):
    text = load_text(PENDULUM.replace("TUBE", f"half_widths: {{{asked}}}"))
    found = certify(text, COARSE, brief=True)
    assert found.verdict is Verdict.CERTIFIED
    assert found.tube.half_widths["q"] <= 0.4


def test_what_a_tube_by_radii_reaches_in_coordinates_of_its_own_refutes_nothing():
    tube = "epsilon: 0.6, rho_a: 0.6, coordinates: auto"
    found = certify(load_text(PENDULUM.replace("TUBE", tube)), COARSE)
    # bounds of what it reaches, in coordinates that were searched for
    assert found.verdict is Verdict.UNDECIDED
    assert isinstance(found.reason.claim, TubeInSafeSet)
    assert found.reason.relax[0].most == pytest.approx(0.4 * np.sqrt(2.4 / 0.3), rel=1e-6)


def test_a_start_outside_of_the_half_widths_is_refuted_in_the_units_of_the_state():
    text = PENDULUM.replace("TUBE", "half_widths: {q: 0.15}") + "initial_state: {box: {q: [-0.3, 0.1]}}\n"
    found = certify(load_text(text), COARSE)
    assert found.verdict is Verdict.REFUTED
    assert found.reason.claim == StartInTube(state="q", off=0.3, half_width=Fraction(3, 20))
    assert found.reason.at.x == (-0.3, 0.0)
    assert "q starts 0.3 from the plan, 0.15 outside of the tube" in found.reason.message


@pytest.mark.parametrize("tube", ["half_widths: {q: 0.1}", "epsilon: 0.1, rho_a: 0.1, coordinates: identity"])
def test_a_plan_outside_of_the_safe_set_is_refuted_whatever_the_tube(tube):
    text = PENDULUM.replace("TUBE", tube).replace("at: [0, 0]", "at: [0.5, 0]")
    found = certify(load_text(text + "initial_state: {at: [0.5, 0]}\n"), COARSE)
    assert found.verdict is Verdict.REFUTED
    assert isinstance(found.reason.claim, PlanInSafeSet)
    assert (found.reason.claim.state, found.reason.at.x) == ("q", (0.5, 0.0))
    assert found.reason.claim.excess == pytest.approx(0.1)


@pytest.mark.slow
def test_a_tube_fits_into_the_safe_set_through_states_that_were_not_asked_for():
    """As wide in w as was asked for, q would leave the safe set: the tube is narrower, and not refused."""
    found = certify(load_text(PENDULUM.replace("TUBE", "half_widths: {w: 1.9}")), COARSE)
    widths = found.tube.half_widths
    assert 0.95 * 0.4 < widths["q"] < 0.4
    assert widths["w"] == pytest.approx(widths["q"] * np.sqrt(2.4 / 0.3), rel=1e-6)


@pytest.mark.slow
def test_a_radius_of_the_command_line_splits_the_tube():
    spec = load_text(PENDULUM.replace("TUBE", "half_widths: {q: 0.3}"))
    half = certify(spec, COARSE).tube
    less = certify(spec, Options(gap=Fraction(1, 5), rho_a=Fraction(1, 20))).tube
    assert float(half.rho_a) == pytest.approx(float(half.rho) / 2)
    assert (less.rho, less.rho_a) == (half.rho, Fraction(1, 20))
    with pytest.raises(SpecError, match="beside tube"):
        certify(spec, Options(epsilon=Fraction(1, 20)))


@pytest.mark.slow
def test_the_scale_of_the_metric_changes_no_gain():
    """W and 64 W are one metric: the same tube, the same gains."""
    base = PENDULUM.replace("TUBE", "half_widths: {q: 0.3}")
    larger = base.replace("[0.3, -0.6], [-0.6, 2.4]", "[19.2, -38.4], [-38.4, 153.6]")
    assert larger != base
    one, other = certify(load_text(base), COARSE), certify(load_text(larger), COARSE)
    assert one.tube.half_widths == pytest.approx(other.tube.half_widths, rel=1e-6)
    own = gains(one)
    assert own
    assert gains(other) == pytest.approx(own, rel=2e-3)


@pytest.mark.slow
def test_a_start_takes_its_part_of_the_tube():
    at_rest = certify(load_text(PENDULUM.replace("TUBE", "half_widths: {q: 0.3}")), COARSE)
    moved = PENDULUM.replace("TUBE", "half_widths: {q: 0.3}") + "initial_state: {at: [0.1, 0]}\n"
    found = certify(load_text(moved), COARSE)
    assert found.tube.rho == at_rest.tube.rho
    assert found.verdict is Verdict.CERTIFIED
    M = np.linalg.inv(np.array([[0.3, -0.6], [-0.6, 2.4]]))
    assert found.constants["initial_distance"].above == pytest.approx(0.1 * np.sqrt(M[0, 0]), rel=1e-6)
    taken = 0.1 * np.sqrt(M[0, 0]) / np.sqrt(found.metric.lower.below)  # d0/sqrt(a)
    assert float(found.tube.epsilon + found.tube.rho_a) == pytest.approx(
        float(found.tube.rho) - taken, rel=1e-5
    )
    beyond = certify(load_text(moved.replace("[0.1, 0]", "[0.35, 0]")), COARSE)
    assert beyond.verdict is not Verdict.CERTIFIED
    assert not beyond.proof.of


@pytest.mark.slow
def test_without_coordinates_certificates_are_as_they_were():
    result = certify(load_text(PENDULUM.replace("TUBE", "epsilon: 0.1, rho_a: 0.1")), COARSE).to_json()
    assert set(result["tube"]) == {"epsilon", "rho_a", "rho_r", "rho", "half_widths"}
    assert set(result["spec"]["effective"]["tube"]) == {"epsilon", "rho_a"}
    text = PENDULUM.replace("TUBE", "epsilon: 0.1, rho_a: 0.1, coordinates: identity")
    assert certify(load_text(text), COARSE).to_json()["tube"] == result["tube"]


@pytest.mark.slow
@pytest.mark.parametrize("tube", ["half_widths: {x1: 0.04}", "epsilon: 0.02, rho_a: 0.02, coordinates: auto"])
def test_simulations_stay_within_what_is_certified(tube):
    """A metric that is not constant: the loop written in z, random uncertainties of the class in z."""
    text = (CONFIGS / "three_state.yaml").read_text("utf-8").replace("duration: 10 ", "duration: 3 ")
    spec = load_text(re.sub(r"^tube: .*$", f"tube: {{{tube}}}", text, flags=re.M))
    result = certify(spec, COARSE)
    assert result.verdict is Verdict.CERTIFIED
    setting = setting_of(spec, result)
    for source in ("26", "distance"):
        loop = loop_of(setting, "l1", Choice(source=source))
        (runs,) = integrate([(setting, loop, cases(setting, 0, range(6)))], tolerance=setting.tolerance)
        found = compare(setting, runs, loop.promise)
        assert not found.violations
        assert not found.left_the_tube
        assert found.worst["xtilde"].value > 0


@pytest.mark.slow
def test_the_loop_is_the_one_in_the_coordinates_of_the_tube():
    """Its field is that of the same system written in z, where P = I: one step of it, mapped back, is a step here."""
    result = certify(load_text(joint(12)), COARSE)
    setting = setting_of(load_text(joint(12)), result)
    loop = loop_of(setting, "l1", Choice(source="distance"))
    S = setting.S
    assert not np.allclose(setting.P, np.eye(4))
    own, its = (Fast(loop.adapts, loop.gains, P, 1, 1) for P in (setting.P, np.eye(4)))
    B = np.array([[0.0], [0.0], [0.0], [2 / 12]])
    flow, flow_z = own.flow(B, 0.01, 0), its.flow(S @ B, 0.01, 0)
    T = np.eye(flow.powers[1].shape[0])
    T[own.at.xi, own.at.xi] = S
    assert T @ flow.powers[1] @ np.linalg.inv(T) == pytest.approx(flow_z.powers[1])


@pytest.mark.slow
@pytest.mark.parametrize("between", ["hold", "linear"])
def test_a_plan_through_knots_has_a_tube_in_coordinates(tmp_path, between):
    """x* is a polynomial in the time since a knot, not in t: what is affine in some states is searched all the same."""
    rows = "t,x1,x2,u\n0,0,0,0\n1,0.05,0.05,0.1\n2,0.1,0.1,0.2\n"
    (tmp_path / "plan.csv").write_text(rows, encoding="utf-8")
    (tmp_path / "spec.yaml").write_text(
        f"""tubecert: 1
name: knots
system: {{states: [x1, x2], inputs: [u], f: [-x1 + x2, "-2*x2 + 0.1*sin(x1)"], B: [[0], [1]]}}
safe_set: {{x1: [-5, 5], x2: [-5, 5]}}
uncertainty: {{h: ["0.1*sin(t) + 0.01*x1"]}}
trajectory: {{kind: csv, file: plan.csv, interpolation: {between}}}
metric: {{rate: 0.5, dual_metric: [[1, 0], [0, 1]]}}
tube: {{half_widths: {{x1: 1, x2: 1}}}}
conditions: {{decides: B}}
""",
        encoding="utf-8",
    )
    found = certify(load(str(tmp_path / "spec.yaml")), COARSE)
    assert found.verdict is Verdict.CERTIFIED
