"""Families of plans: what is proven for all is at least what holds for any one, and recheck proves it again."""

import copy
import json
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from proven import proven
from proven import result as proven_result
from rechecked import examine, failing, sealed
from strategies import fractions
from systems import FAMILY_TWO as FAMILY
from systems import values

from tubecert.bounds.suprema import Suprema
from tubecert.certificate import dump, seal
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError
from tubecert.model import build
from tubecert.spec import canonical, load_text
from tubecert.trajectory.make import plan_of
from tubecert.tube import Tube, containment
from tubecert.verdict import Verdict

# a metric that moves, and two inputs: nothing is exact by luck
BENT = """
tubecert: 1
name: bent
system:
  states: [x, y]
  inputs: [u]
  f: ["-x + 0.2*y**2", "-y + 0.3*sin(x)"]
  B: [["0"], ["1"]]
safe_set: {x: [-2, 2], y: [-2, 2]}
uncertainty: {h: ["0.1*sin(t)*x"]}
trajectory: {kind: any, x: {x: [-0.5, 0.7], y: [-0.4, 1/3]}, u: {u: [-0.5, 0.2]}, defect: 0.02}
initial_state: {within: 0.02}
metric: {rate: 0.3, dual_metric: [["1 + 0.1*x**2", "0.1"], ["0.1", "1.2"]]}
tube: {epsilon: 0.2, rho_a: 0.1}
"""
RATIOS = fractions(-2, 2, 10_000)
OWN = "trajectory: {kind: any, x: {x1: [-1, 1], x2: [-0.5, 0.5]}, u: {u: [-1, 1]}, defect: 0.01}"


@pytest.fixture(scope="module")
def document():
    return proven(FAMILY, bare=True, conditions="distance")


def result_of(text, **options):
    return proven_result(text, bare=True, **{"conditions": "distance"} | options)


@pytest.mark.slow
def test_a_family_is_certified_for_all_time_and_says_which_plans(document):
    result = document["result"]
    assert result["verdict"] == "certified"
    assert result["claim"]["plans"] == {
        "x": {"x1": ["-1", "1"], "x2": ["-0.5", "0.5"]},
        "u": {"u": ["-1", "1"]},
        "defect": "0.01",
    }
    assert (result["claim"]["horizon"], result["claim"]["for_all_time"]) == (None, "periodic")
    assert result["plan"] == {"kind": "any", "interpolation": "exact"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "text", [FAMILY, BENT, BENT.replace("1/3]", "-0.4]")], ids=["two-state", "bent", "flat box"]
)
def test_recheck_confirms_it(text):
    made = proven(text, bare=True, conditions="distance")
    assert made["result"]["verdict"] == "certified"
    assert failing(examine(made)) == []


@pytest.mark.slow
@pytest.mark.parametrize("text", [FAMILY, BENT], ids=["two-state", "bent"])
def test_no_sampled_value_is_above_a_constant_and_corners_come_near(text):
    """Independent sampling over (x* in P, |z| <= rho, u* in U), in floats, from the definitions."""
    spec = load_text(text)
    result = result_of(text)
    model, c, rho = build(spec), result.constants, float(result.tube.rho)
    rng = np.random.default_rng(7)
    low, high = (np.array([float(ends[k]) for ends in spec.trajectory.bundle.x]) for k in (0, 1))
    N = 40_000
    plan = np.where(rng.random((N, 2)) < 0.5, rng.choice([0.0, 1.0], (N, 2)), rng.random((N, 2)))
    plan = low + plan * (high - low)
    angle, reach = rng.uniform(0, 2 * np.pi, N), rho * rng.choice([1.0, 0.7], N)
    x = plan + reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    u_low, u_high = (float(end) for end in spec.trajectory.bundle.u[0])
    u = rng.choice([u_low, u_high], N)
    f, B = values([(e,) for e in model.f], model.states, x)[..., 0], values(model.B, model.states, x)
    W_plan, B_plan = values(model.W, model.states, plan), values(model.B, model.states, plan)
    M_plan = np.linalg.inv(W_plan)
    sampled = {
        "drift_on_plan": np.linalg.norm(f + B[..., 0] * u[:, None], axis=1).max(),
        "f": np.linalg.norm(f, axis=1).max(),
        "u_star": np.abs(u).max(),
        "metric_input_gain": np.sqrt(
            np.linalg.eigvalsh(np.swapaxes(B_plan, 1, 2) @ M_plan @ B_plan)[:, -1].max()
        ),
        "plan_defect_metric": float(spec.trajectory.bundle.defect)
        * np.sqrt(np.linalg.eigvalsh(M_plan)[:, -1].max()),
        "upper": np.linalg.eigvalsh(np.linalg.inv(values(model.W, model.states, x)))[:, -1].max(),
    }
    for name, value in sampled.items():
        assert value <= c[name].above, name
        assert c[name].below <= c[name].above <= value * 1.03, name
    limit = float(spec.trajectory.bundle.defect)
    assert limit <= c["plan_defect"].above <= limit * (1 + 1e-11)


@pytest.mark.slow
def test_the_constants_of_members_are_at_most_those_of_the_family(document):
    """Twenty plans of the family, by the methods for single plans."""
    family, rho = document["result"]["constants"], Fraction(repr(document["result"]["tube"]["rho"]))
    rng = np.random.default_rng(3)
    for k in range(20):
        w = Fraction(int(rng.integers(1, 4)))
        a, b = (Fraction(int(rng.integers(0, 51)), 100) for _ in range(2))
        moving = f'expressions, x: ["{a}*sin({w}*t)", "{b}*cos({w}*t)"], u: ["{2 * a}*sin({w}*t)**2"]'
        held = f"equilibrium, at: [{2 * a}, -{b}], input: [{1 - 2 * b}]"
        plan = f"trajectory: {{kind: {moving if k % 4 else held}, horizon: 2}}"
        spec = load_text(FAMILY.replace(OWN, plan))
        model = build(spec)
        own = Suprema(model, plan_of(spec, model), 0.0, (0, 2), Effort(gap=0.05)).with_radius(rho)
        for name, found in (
            ("u_star", own.input_on_plan()),
            ("metric_input_gain", own.metric_input_gain()),
            ("drift_on_plan", own.drift_on_plan()),
            ("h", own.uncertainty()[0]),
        ):
            assert 0 <= found.below <= family[name]["above"] * (1 + 1e-12), (plan, name)


def test_the_tube_of_a_family_is_what_lies_within_rho_of_its_box():
    spec = load_text(FAMILY)
    plan, rho = plan_of(spec, build(spec)), 0.5
    tube = Tube(plan, rho, states=spec.states, inputs=(), time=None)
    rng = np.random.default_rng(0)
    points = rng.uniform(-2, 2, (4000, 2))
    gap = np.maximum(0.0, np.maximum(np.array([-1, -0.5]) - points, points - np.array([1, 0.5])))
    distance = np.linalg.norm(gap, axis=1)
    _, _, alive = tube.contract(spec.states, points, points)
    assert alive[distance <= rho].all()
    assert not alive[distance > rho * (1 + 1e-9)].any()
    lo, hi = tube.inside(spec.states, points)
    assert len(lo) > 0.99 * len(points)
    assert (lo == hi).all()
    moved = np.maximum(0.0, np.maximum(np.array([-1, -0.5]) - lo, lo - np.array([1, 0.5])))
    assert (np.linalg.norm(moved, axis=1) <= rho).all()


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(low=RATIOS, width=RATIOS.map(abs), rho=RATIOS.map(lambda q: abs(q) + Fraction(1, 100)))
def test_containment_is_exact_but_for_roundings(low, width, rho):
    """P + rho in the safe set, in rational arithmetic."""
    text = FAMILY.replace("x1: [-1, 1], x2", f"x1: [{low}, {low + width}], x2")
    spec = load_text(text)
    found = containment(plan_of(spec, build(spec)), rho, spec.states, spec.safe_set, Effort())
    room = min(6 - (low + width) - rho, low - rho + 6, Fraction(11, 2) - rho)
    if abs(room) > Fraction(1, 10**6):
        assert found.verdict is (Verdict.CERTIFIED if room > 0 else Verdict.REFUTED)
    else:
        assert found.verdict is not Verdict.REFUTED or room < 0


def test_where_the_box_of_a_family_leaves_the_safe_set_is_told_and_refutes_nothing():
    result = result_of(FAMILY.replace("x2: [-0.5, 0.5]", "x2: [-0.5, 5.5]"))
    assert result.verdict is Verdict.UNDECIDED
    assert result.reason.claim.state == "x2"
    assert result.reason.at.x[1] > 6
    assert failing(examine(json.loads(dump(seal(result.to_json(), {}))))) == []


def test_it_is_written_and_read_again():
    spec = load_text(BENT)
    again = load_text(json.dumps(canonical(spec)))
    assert again.trajectory == spec.trajectory
    assert canonical(again) == canonical(spec)
    wide = load_text(BENT.replace("x: [-0.5, 0.7]", "x: [-pi/6, pi/5]")).trajectory.bundle
    assert wide.x[0][0] < -Fraction("0.523598775598298")  # outward: all that is asked for is covered
    assert wide.x[0][1] > Fraction("0.628318530717958")


def changed(document, change):
    made = copy.deepcopy(document)
    change(made["result"])
    return sealed(made)


def less(result, name, share):
    constant = result["constants"][name]
    constant.update(above=constant["above"] * share, below=0.0)


WIDE = BENT.replace("tube: {epsilon: 0.2, rho_a: 0.1}", "tube: {half_widths: {x: 0.3, y: 0.35}}")


@pytest.mark.slow
def test_a_tube_in_coordinates_of_its_own():
    """The ellipsoid of the metric, cut to half-widths, around the box: sampled, confirmed, and what is less is not."""
    spec, made = load_text(WIDE), proven(WIDE, bare=True, conditions="distance")
    assert failing(examine(made)) == []
    tube, c, model = made["result"]["tube"], made["result"]["constants"], build(spec)
    S = np.array([[float(Fraction(value)) for value in row] for row in tube["coordinates"]])
    rng, N = np.random.default_rng(5), 40_000
    low, high = (np.array([float(ends[k]) for ends in spec.trajectory.bundle.x]) for k in (0, 1))
    plan = np.where(rng.random((N, 2)) < 0.5, low, high)
    angle = rng.uniform(0, 2 * np.pi, N)
    offset = tube["rho"] * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ np.linalg.inv(S).T
    keep = np.all(np.abs(offset) <= [tube["half_widths"][name] for name in spec.states], axis=1)
    plan, x = plan[keep], (plan + offset)[keep]
    u = rng.choice([float(end) for end in spec.trajectory.bundle.u[0]], len(x))
    f, B = values([(e,) for e in model.f], model.states, x)[..., 0], values(model.B, model.states, x)
    M = np.linalg.inv(values(model.W, model.states, plan))
    limit = float(spec.trajectory.bundle.defect)
    sampled = {
        "drift_on_plan": np.linalg.norm((f + B[..., 0] * u[:, None]) @ S.T, axis=1).max(),
        "plan_defect": limit * np.linalg.norm(S, 2),
        "plan_defect_metric": limit * np.sqrt(np.linalg.eigvalsh(M)[:, -1].max()),
    }
    for name, value in sampled.items():
        assert value * 0.97 <= c[name]["below"] <= c[name]["above"], name
        assert value <= c[name]["above"] <= value * 1.03, name
        assert failing(examine(changed(made, lambda result, name=name: less(result, name, 0.96)))) != [], name


@pytest.mark.slow
def test_every_plan_of_a_family_keeps_away_from_an_obstacle():
    """A disc beside a corner of the box: sampled over the box, and a hair more is not confirmed."""
    disc = "obstacles: [{states: [x1, x2], disc: {center: [3, 3], radius: 0.5}}]\n"
    made = proven(FAMILY + disc, bare=True, conditions="distance")
    assert failing(examine(made)) == []
    below, above = made["result"]["clearance"][0]["clearance"]
    W = np.array([[4.25828, -0.93423], [-0.93423, 3.76692]])
    reach = np.sqrt(made["result"]["constants"]["lower"]["below"]) * made["result"]["tube"]["rho"]
    angle = np.linspace(0, 2 * np.pi, 2001)
    edge = reach * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ np.linalg.cholesky(W).T
    true = min(
        np.linalg.norm(np.array([3, 3]) - (np.array([x, y]) + edge), axis=1).min()
        for x in (-1, 1)
        for y in (-0.5, 0.5)
    )
    assert below <= true - 0.5 <= above
    assert below > (true - 0.5) * 0.98

    def more(result):
        result["clearance"][0]["clearance"] = [below * 1.02, above]

    assert failing(examine(changed(made, more))) != []
    inside = proven(FAMILY + disc.replace("[3, 3]", "[0.9, 0.4]"), conditions="distance")["result"]
    assert inside["verdict"] != "certified"


SMALLER = [
    "u_star",
    "drift_on_plan",
    "metric_input_gain",
    "plan_defect_metric",
    "plan_defect",
    "h_initial",
    "h",
]
WHERE_IT_MOVES = ["metric_input_gain", "plan_defect_metric", "drift_on_plan", "initial_distance"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "name"), [(FAMILY, name) for name in SMALLER] + [(BENT, name) for name in WHERE_IT_MOVES]
)
def test_two_percent_less_is_not_confirmed(text, name):
    made = proven(text, bare=True, conditions="distance")
    assert failing(examine(changed(made, lambda result: less(result, name, 0.98)))) != []


def wider(trajectory):
    trajectory["x"]["x1"] = ["-3", "3"]


FORGED = {
    "wider boxes in the specification alone": lambda r: wider(r["spec"]["effective"]["trajectory"]),
    "wider inputs": lambda r: r["spec"]["effective"]["trajectory"]["u"].update(u=["-2", "2"]),
    "more defect": lambda r: r["spec"]["effective"]["trajectory"].update(defect="0.1"),
    "wider boxes in the claim": lambda r: r["claim"]["plans"]["x"].update(x1=["-3", "3"]),
    "more defect in the claim": lambda r: r["claim"]["plans"].update(defect="0.1"),
    "no family in the claim": lambda r: r["claim"].pop("plans"),
    "both wider": lambda r: (
        wider(r["spec"]["effective"]["trajectory"]),
        r["claim"]["plans"]["x"].update(x1=["-3", "3"]),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FORGED)
def test_a_family_that_was_not_proven_is_not_confirmed(document, name):
    forged = changed(document, FORGED[name])
    effective = forged["result"]["spec"]["effective"]
    from tubecert.certificate import digest

    forged["result"]["spec"]["effective_hash"] = digest(effective)
    assert failing(examine(sealed(forged))) != []


REFUSED = {
    "a start at a point": lambda e: e.update(initial_state={"at": ["0", "0"]}),
    "an unknown key": lambda e: e["trajectory"].update(speed="1"),
    "a state that is missing": lambda e: e["trajectory"]["x"].pop("x2"),
    "an empty range": lambda e: e["trajectory"]["u"].update(u=["1", "-1"]),
    "a negative defect": lambda e: e["trajectory"].update(defect="-1"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_recheck_refuses_what_is_no_family(document, name):
    from tubecert.errors import TubecertError

    forged = changed(document, lambda result: REFUSED[name](result["spec"]["effective"]))
    with pytest.raises(TubecertError) as caught:
        examine(forged)
    assert {item.code for item in caught.value.findings} <= {"TC601", "TC603"}


def test_samples_in_a_result_are_refused(document):
    from tubecert.errors import TubecertError

    forged = changed(document, lambda r: r["plan"].update(samples={"t": [0.0], "x": [[0.0, 0.0]]}))
    with pytest.raises(TubecertError):
        examine(forged)


@pytest.mark.slow
def test_a_plan_of_ones_own_is_followed_if_it_is_of_the_family(tmp_path, monkeypatch, document):
    from commands import run

    monkeypatch.chdir(tmp_path)
    (tmp_path / "any.yaml").write_text(FAMILY)
    (tmp_path / "any.json").write_text(json.dumps(document))
    rest = "trajectory: {kind: equilibrium, at: [0, 0], input: [0], horizon: 1}"
    (tmp_path / "rest.yaml").write_text(FAMILY.replace(OWN, rest))
    (tmp_path / "far.yaml").write_text(FAMILY.replace(OWN, rest.replace("input: [0]", "input: [2]")))
    arguments = ["simulate", "any.yaml", "--certificate", "any.json", "--runs", "2", "--plan"]
    done = run(*arguments, "rest.yaml")
    assert done.exit_code == 0, done.output
    assert "not falsified" in done.output
    done = run(*arguments, "far.yaml")
    assert done.exit_code == 2
    assert "TC411" in done.output
    assert "u* goes 1 beyond its range" in done.output


def test_the_report_names_the_family(document):
    from tubecert.certificate.result import Certificate
    from tubecert.report.claimed import plan_words
    from tubecert.words.sampled_loop import family

    result = Certificate.from_json(document).result
    assert plan_words(result) == "every plan of the family"
    assert family(result.spec.effective) == (
        "x1* in [-1, 1], x2* in [-0.5, 0.5], u* in [-1, 1]; |x*' - f(x*) - B(x*) u*| <= 0.01"
    )


@pytest.mark.slow
def test_h_without_a_period_needs_a_horizon():
    text = FAMILY.replace("sin(2*t)", "exp(-t)")
    with pytest.raises(SpecError, match="TC204"):
        result_of(text)
    assert result_of(text.replace("defect: 0.01}", "defect: 0.01, horizon: 3}")).claim.horizon == "3"
