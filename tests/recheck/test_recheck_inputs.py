"""What is stated of inputs with limits is proven again; planted faults are refused."""

import copy

import pytest
import tampers
from rechecked import certified, examine, failing, respecified, sealed, unconfirmed
from systems import BLOWN, SMALL

from tubecert.errors import TubecertError

# sup u* and inf u* have closed forms, and the feedback has something to do
ONE = """
tubecert: 1
name: one
system: {states: [x], inputs: [u], units: {u: N}, f: ["-x + 0.4*x**3"], B: [[1]]}
safe_set: {x: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)*cos(x)"]}
trajectory:
  kind: expressions
  x: ["0.2*sin(t)"]
  u: ["0.2*cos(t) + 0.2*sin(t) - 0.0032*sin(t)**3"]
  horizon: 3
tube: {epsilon: 0.1, rho_a: 0.1}
metric: {dual_metric: [[1]], rate: 0.9}
"""
LIMITS = "limits: {u: [-2, 2.5]}\n"
KINDS = ("no_adaptation", "conditions_26", "distance")


@pytest.fixture(scope="module")
def made():
    return certified(ONE + LIMITS)


@pytest.mark.slow
def test_every_kind_is_confirmed_with_its_bounds(made):
    result = made["result"]
    assert result["verdict"] == "certified"
    (own,) = result["inputs"]
    assert (own["input"], own["limits"], own["verdict"]) == ("u", [-2.0, 2.5], "certified")
    assert set(own["bounds"]) == set(KINDS)
    assert not failing(examine(made))
    for key, bound in own["bounds"].items():
        added = bound["feedback"] + bound["adaptation"]
        assert bound["least"] == pytest.approx(own["plan"]["least"][0] - added, abs=1e-8)
        assert bound["greatest"] == pytest.approx(own["plan"]["greatest"][1] + added, abs=1e-8)
        assert bound["adaptation"] == (0 if key == "no_adaptation" else pytest.approx(0.1, rel=1e-2))
        assert 0 < bound["feedback"] <= result["constants"]["feedback_gain"]["above"] * 0.2 * (1 + 1e-8)


def first(result):
    return result["inputs"][0]


def bound(result, key="distance"):
    return first(result)["bounds"][key]


def smaller(result, part, key="distance", by=1e-6):
    """A share that is a little less than it is, with a bound that is what it consists of."""
    own = bound(result, key)
    own[part] *= 1 - by
    own["least"] = first(result)["plan"]["least"][0] - own["feedback"] - own["adaptation"] - 1e-9
    own["greatest"] = first(result)["plan"]["greatest"][1] + own["feedback"] + own["adaptation"] + 1e-9


def narrow(result, end, by):
    """A plan whose range is a little less than it is, with bounds that are what they consist of."""
    first(result)["plan"][end] = [value * by for value in first(result)["plan"][end]]
    for own in first(result)["bounds"].values():
        own["least"] = first(result)["plan"]["least"][0] - own["feedback"] - own["adaptation"] - 1e-9
        own["greatest"] = first(result)["plan"]["greatest"][1] + own["feedback"] + own["adaptation"] + 1e-9


FAULTS = {
    "a bound too low": lambda r: bound(r).update(greatest=bound(r)["greatest"] - 1e-6),
    "a bound too high": lambda r: bound(r).update(least=bound(r)["least"] + 1e-6),
    "signs exchanged": lambda r: bound(r).update(least=-bound(r)["least"], greatest=-bound(r)["greatest"]),
    "ends exchanged": lambda r: bound(r).update(least=bound(r)["greatest"], greatest=bound(r)["least"]),
    "no adaptation": lambda r: smaller(r, "adaptation", by=1),
    "less adaptation": lambda r: smaller(r, "adaptation"),
    "a negative share": lambda r: smaller(r, "adaptation", by=3),
    "limits changed": lambda r: first(r).update(limits=[-3.0, 3.0]),
    "limits as texts": lambda r: first(r).update(limits=["-3", "5/2"]),
    "the input dropped": lambda r: r["inputs"].pop(),
    "all dropped": lambda r: r.pop("inputs"),
    "an input twice": lambda r: r["inputs"].append(first(r)),
    "another name": lambda r: first(r).update(input="v"),
    "another verdict": lambda r: first(r).update(verdict="undecided"),
    "refuted": lambda r: first(r).update(verdict="refuted"),
    "a kind that decides dropped": lambda r: first(r)["bounds"].pop("distance"),
    "no bounds": lambda r: first(r).update(bounds={}),
    "an unknown kind": lambda r: first(r)["bounds"].update(hardware=bound(r)),
    "an unknown member": lambda r: first(r).update(decides=True),
    "no plan": lambda r: first(r).update(plan={"least": [None, None], "greatest": [None, None]}),
    "a plan without a lower end": lambda r: first(r)["plan"].update(least=[None, 0.0]),
    "an empty plan": lambda r: first(r)["plan"].update(least=[0.5, -0.5]),
    "a plan that does less": lambda r: narrow(r, "greatest", 0.98),
    "a plan that does less below": lambda r: narrow(r, "least", 0.98),
    **{f"less feedback, {key}": lambda r, key=key: smaller(r, "feedback", key) for key in KINDS},
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_unconfirmed(made, fault):
    forged = copy.deepcopy(made)
    FAULTS[fault](forged["result"])
    assert unconfirmed(forged)


@pytest.mark.slow
def test_a_name_that_no_input_has_names_no_claim(made):
    forged = copy.deepcopy(made)
    first(forged["result"]).update(input="u\n  confirmed   everything")
    with pytest.raises(TubecertError, match="not u"):
        examine(sealed(forged))


@pytest.mark.slow
def test_a_weaker_bound_is_confirmed(made):
    """What shows that the faults are refused for what they are, and not for being touched."""
    weaker = copy.deepcopy(made)
    own = bound(weaker["result"])
    own["feedback"] *= 1.01
    own["least"] -= 0.1
    own["greatest"] += 0.1
    assert not unconfirmed(weaker)
    narrow(weaker["result"], "greatest", 1.001)
    assert not unconfirmed(weaker)


CHANGES = {
    "narrower limits": lambda s: s["limits"].update(u=["-2", "0.3"]),
    "other limits": lambda s: s["limits"].update(u=["-2", "5"]),
    "no limits": lambda s: s.pop("limits"),
    "empty limits": lambda s: s.update(limits={}),
    "limits of a state": lambda s: s.update(limits={"x": ["-2", "5/2"]}),
    "limits of nobody": lambda s: s["limits"].update(w=["-1", "1"]),
    "limits that are one point": lambda s: s["limits"].update(u=["1", "1"]),
    "another plan": lambda s: s["trajectory"].update(u=["0.21*cos(t) + 0.2*sin(t) - 0.0032*sin(t)**3"]),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
def test_another_specification_is_noticed(made, change):
    assert unconfirmed(respecified(made, CHANGES[change]))


@pytest.mark.slow
def test_narrower_limits_need_an_entry_that_is_theirs_and_within(made):
    """Specification and entry agree, and the bound does not lie within."""
    forged = respecified(made, lambda s: s["limits"].update(u=["-2", "0.3"]))
    first(forged["result"]).update(limits=[-2.0, 0.3])
    assert unconfirmed(forged)
    fair = respecified(made, lambda s: s["limits"].update(u=["-2", "2"]))
    first(fair["result"]).update(limits=[-2.0, 2.0])
    assert not unconfirmed(fair)


@pytest.mark.slow
def test_a_kind_that_does_not_decide_may_miss_the_limits(made):
    """The feedback alone decides; B, whose adaptation adds something, is told of all the same."""
    text = f"{ONE}limits: {{u: [-2, 0.35]}}\n"
    alone = certified(text, conditions="0")
    bounds = alone["result"]["inputs"][0]["bounds"]
    assert bounds["no_adaptation"]["greatest"] < 0.35 < bounds["distance"]["greatest"]
    assert alone["result"]["verdict"] == "certified"
    assert not failing(examine(alone))
    result = certified(text, conditions="distance")["result"]
    assert result["verdict"] == "undecided"
    (reason,) = (r for r in result["reasons"] if r["claim"] == "input_within_limits")
    assert (reason["section"], reason["side"], reason["verdict"]) == ("distance", "upper", "undecided")
    forged = copy.deepcopy(alone)
    forged["result"]["decided_by"] = ["distance"]
    assert unconfirmed(forged)


@pytest.mark.slow
def test_a_plan_beyond_its_limits_refutes_and_recheck_sees_it():
    made = certified(ONE + "limits: {u: [-2, 0.28]}\n")
    result = made["result"]
    assert result["verdict"] == "refuted"
    assert result["distance"]["verdict"] == "certified"
    (reason,) = (r for r in result["reasons"] if r["verdict"] == "refuted")
    assert reason["claim"] == "input_within_limits"
    assert reason["plan"] > reason["limit"] == 0.28
    assert reason["at"]["t"] == pytest.approx(0.78, abs=0.1)  # about pi/4
    assert not failing(examine(made))
    elsewhere = copy.deepcopy(made)
    next(r for r in elsewhere["result"]["reasons"] if r["verdict"] == "refuted")["at"]["t"] = 2.5
    assert unconfirmed(elsewhere)
    forged = respecified(made, lambda s: s["limits"].update(u=["-2", "2"]))
    assert unconfirmed(forged)


@pytest.mark.slow
def test_a_family_whose_box_exceeds_the_limits_is_undecided():
    family = ONE.replace(
        ONE[ONE.index("trajectory:") : ONE.index("tube:")],
        "trajectory: {kind: any, x: {x: [-0.1, 0.1]}, u: {u: [-0.5, 0.5]}, horizon: 3}\n"
        "initial_state: {within: 0.01}\n",
    )
    inside = certified(family + LIMITS)
    assert inside["result"]["verdict"] == "certified"
    assert inside["result"]["inputs"][0]["plan"]["greatest"][1] == pytest.approx(0.5)
    assert not failing(examine(inside))
    narrowed = copy.deepcopy(inside)
    narrow(narrowed["result"], "greatest", 0.999)
    assert unconfirmed(narrowed)
    beyond = certified(family + "limits: {u: [-2, 0.4]}\n")["result"]
    assert beyond["inputs"][0]["verdict"] == beyond["verdict"] == "undecided"


@pytest.mark.slow
def test_without_limits_nothing_is_said():
    result = certified(ONE)["result"]
    assert "inputs" not in result
    with_limits = certified(ONE + LIMITS)["result"]
    same = {key for key in result if result[key] == with_limits[key]}
    assert set(result) - same == {"spec"}


@pytest.mark.slow
def test_wind_is_a_part_of_the_distance_that_the_feedback_answers():
    calm, windy = (certified(text + "limits: {u: [-4, 4]}\n", conditions="0") for text in (SMALL, BLOWN))
    assert not failing(examine(windy))
    own, other = (bound(made["result"], "no_adaptation")["feedback"] for made in (calm, windy))
    assert other > own * 1.01
    forged = copy.deepcopy(windy)
    bound(forged["result"], "no_adaptation")["feedback"] = own
    assert unconfirmed(forged)


@pytest.mark.slow
def test_no_random_change_of_what_is_stated_of_inputs_is_confirmed(monkeypatch):
    made, fields = certified(ONE + LIMITS, conditions="distance"), tampers.fields
    monkeypatch.setattr(
        tampers,
        "fields",
        lambda r: {name: paths for name, paths in fields(r).items() if name.startswith("inputs")},
    )
    refusals, _, wrong = tampers.campaign(made, 300, seed=7)
    assert wrong == []
    assert refusals > 200
