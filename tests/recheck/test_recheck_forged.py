"""Every number that a certificate of 0, A and B states, made a little better than it is: the claim about it fails."""

import copy
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest
from rechecked import certified, confirmed, examine, failing, respecified, sealed
from systems import BLOWN, SMALL

from tubecert.errors import TubecertError
from tubecert.recheck.kinds import rates

pytestmark = pytest.mark.slow

# a plan that is off a little, a start beside it, an h that is not at its largest at the start
TEXT = (
    SMALL.replace("A_m: -10", "A_m: auto")
    .replace("0.1*sin(t) + 0.05*x", "0.1*cos(t) + 0.05*x")
    .replace("at: [0, 0], input: [0]}", 'at: ["0.004", 0], input: [0], horizon: 9}')
    .replace("at: [0.05, 0]", "at: [0.05, 0.03]")
) + "limits: {u: [-3, 3]}\n"
Result = dict[str, Any]
Change = Callable[[Result], object]


@pytest.fixture(scope="module")
def honest():
    return confirmed(TEXT, bare=False)


def failed(honest: Any, change: Change) -> list[str]:
    """The claims that fail after a change; what is of no form at all fails before any of them."""
    document = copy.deepcopy(honest[0])
    change(document["result"])
    try:
        return [name for name, _ in failing(examine(sealed(document), memory=dict(honest[1])))]
    except TubecertError as error:
        return [str(error)]


def times(place: Any, key: Any, factor: float) -> None:
    place[key] *= factor


def more(place: list[float | None], k: int = 0, by: float = 1e-6) -> None:
    """A margin or a limit, larger by more than it was rounded by."""
    value = place[k]
    assert value is not None
    place[k] = value + by


def ends_early(margin: list[float]) -> None:
    """No interval: its upper end below what is proven."""
    margin[1] = margin[0] / 2


A, B, ALONE = "conditions_26", "distance", "no_adaptation"
CLAIMS_A = ("26a", "26b", "26c")
MARGINS_A, SUP_B = "A: (26a)-(26c)", "B: sup D < dbar"
SHORTFALL = {"condition": "x", "margin": [0, 1], "allowed": 1, "needed": 1, "missing": 0}
OF_0: dict[str, tuple[Change, str]] = {
    "margin": (lambda r: more(r[ALONE]["margin"]), "0: sup D < dbar"),
    "margin that is none": (lambda r: r[ALONE].update(margin=[-0.1, 0.9]), "0: sup D < dbar"),
    "margin without an end": (lambda r: r[ALONE].update(margin=[None, 0.9]), "0: sup D < dbar"),
    "margin that ends before it begins": (lambda r: ends_early(r[ALONE]["margin"]), "0: sup D < dbar"),
    "distance": (lambda r: times(r[ALONE]["distance"], 1, 1 - 1e-3), "0: sup D <= "),
    "distance below the start": (lambda r: r[ALONE].update(distance=[0.01, 0.05]), "0: sup D <= "),
    "ultimate radius": (lambda r: times(r[ALONE], "ultimate_radius", 1 - 1e-6), "0: sup D < dbar"),
    "largest h": (lambda r: times(r[ALONE], "uncertainty_limit", 1 + 1e-6), "0: without adaptation"),
    "no recipe": (lambda r: r["proof"].pop(ALONE), ""),
    "a recipe that is not empty": (lambda r: r["proof"][ALONE].update(speed="1"), ""),
    "no margin": (lambda r: r[ALONE].update(margin=None), ""),
    "a key that is not known": (lambda r: r[ALONE].update(bandwidth=10), ""),
    "a shortfall": (lambda r: r[ALONE]["shortfalls"].append(SHORTFALL), ""),
}


def pair(r: Result, key: str, **factors: float) -> None:
    """Gains of the pair that decides and of its recipe alike."""
    own = r[key] if key == A else r[key]["least_adaptation"]
    for name, factor in factors.items():
        own[name] *= factor
        r["proof"][key][name] = own[name]


OF_A: dict[str, tuple[Change, str]] = {
    **{f"margin of {c}": (lambda r, c=c: more(r[A]["margins"][c]), MARGINS_A) for c in CLAIMS_A},
    **{
        f"margin of {c} at the least rate": (
            lambda r, c=c: more(r[A]["least_adaptation"]["margins"][c]),
            MARGINS_A,
        )
        for c in CLAIMS_A
    },
    "margin that ends before it begins": (lambda r: ends_early(r[A]["margins"]["26b"]), MARGINS_A),
    "bandwidth": (lambda r: pair(r, A, bandwidth=0.99), MARGINS_A),
    "rate": (lambda r: pair(r, A, adaptation_rate=0.999), MARGINS_A),
    "projection": (lambda r: pair(r, A, projection_radius=0.999), MARGINS_A),
    "least rate": (lambda r: times(r[A]["least_adaptation"], "adaptation_rate", 0.999), MARGINS_A),
    "predictor": (lambda r: pair(r, A, predictor_gain=0.5), MARGINS_A),
    "predictor that is not damped": (lambda r: pair(r, A, predictor_gain=-1), MARGINS_A),
    "predictor of the recipe": (lambda r: times(r["proof"][A], "predictor_gain", 2), "A: its recipe"),
    "recipe": (lambda r: r["proof"][A].update(bandwidth=4.0), "A: its recipe"),
    "ultimate radius": (lambda r: times(r[A], "ultimate_radius", 1 - 1e-6), "A: ultimate radius"),
}
DERIVED = (
    *("speed", "uncertainty_rate", "prediction_error", "filter_error", "theta", "geodesic_rate", "Psi_rate"),
    *("zeta_1", "zeta_3"),
)
OF_B: dict[str, tuple[Change, str]] = {
    "margin": (lambda r: more(r[B]["least_adaptation"]["margin"]), SUP_B),
    "margin of the split": (lambda r: more(r[B]["split"]["margin"]), SUP_B),
    "margin that ends before it begins": (lambda r: ends_early(r[B]["split"]["margin"]), SUP_B),
    "bandwidth": (lambda r: pair(r, B, bandwidth=0.99), SUP_B),
    "rate": (lambda r: pair(r, B, adaptation_rate=0.999), SUP_B),
    "predictor": (lambda r: pair(r, B, predictor_gain=0.5), SUP_B),
    "predictor that is not damped": (lambda r: pair(r, B, predictor_gain=-1), SUP_B),
    "rate of the split": (lambda r: times(r[B]["split"], "adaptation_rate", 0.99), SUP_B),
    "projection": (lambda r: pair(r, B, projection_radius=0.999), SUP_B),
    "projection of the split": (lambda r: times(r[B]["split"], "projection_radius", 0.999), SUP_B),
    "gains of the recipe": (lambda r: r["proof"][B].update(adaptation_rate=1e9), SUP_B),
    **{
        name: (lambda r, name=name: times(r["proof"][B], name, 1 - 1e-6), SUP_B)
        for name in ("speed", "prediction_error", "uncertainty")
    },
    "error that is too large": (lambda r: times(r["proof"][B], "prediction_error", 1.001), SUP_B),
    "radius": (lambda r: times(r[B], "ultimate_radius", 1 - 1e-6), "B: ultimate radius"),
    "radius of the pair": (lambda r: times(r[B]["least_adaptation"], "ultimate_radius", 1 - 1e-6), SUP_B),
    "radius of the split": (lambda r: times(r[B]["split"], "ultimate_radius", 1 - 1e-3), SUP_B),
    "radius without one of the pair": (
        lambda r: r[B]["least_adaptation"].update(ultimate_radius=None),
        "B: ultimate radius",
    ),
    "no bandwidth": (lambda r: pair(r, B, bandwidth=0), ""),
    "a negative rate": (lambda r: pair(r, B, adaptation_rate=-1), SUP_B),
    "another rate than that of the recipe": (
        lambda r: times(r[B]["least_adaptation"], "adaptation_rate", 0.99),
        SUP_B,
    ),
    "an extreme Y": (lambda r: r["proof"][B].update(speed=1e308), ""),
    "a Y that is no number": (lambda r: r["proof"][B].update(speed="nan"), ""),
    "no recipe": (lambda r: r["proof"].pop(B), ""),
    "half a recipe": (lambda r: r["proof"][B].pop("uncertainty"), ""),
    "a key of the recipe that is not known": (lambda r: r["proof"][B].update(settling=1.0), ""),
    "no section": (lambda r: r.pop(B), ""),
    "a key of the section that is not known": (lambda r: r[B].update(windows=[]), ""),
    "no pair": (lambda r: r[B].update(least_adaptation=None), ""),
    "it decides twice": (lambda r: r["decided_by"].append(B), ""),
    "half-widths of the states": (lambda r: times(r["tube"]["half_widths"], "x", 0.97), "half-width of x"),
    "a half-width of nobody": (lambda r: r["tube"]["half_widths"].update(z=1.0), ""),
}


def less(name: str) -> Change:
    """A constant a little less than it is, by more than it is enclosed by."""

    def change(r: Result) -> None:
        own = r["constants"][name]
        own["above"] *= 0.99
        own["below"] = min(own["below"], own["above"])

    return change


OF_START: dict[str, tuple[Change, str]] = {
    "d0": (less("initial_distance"), "initial_distance <= "),
    "H0": (less("h_initial"), "h_initial <= "),
    "defect": (less("plan_defect"), "plan_defect <= "),
    "defect in the metric": (less("plan_defect_metric"), "plan_defect_metric <= "),
    **{f"{name} of A": (less(name), "A: derived constants") for name in DERIVED},
}


GROUPS = {"0": OF_0, "A": OF_A, "B": OF_B, "start": OF_START}


@pytest.mark.parametrize(("group", "name"), [(group, name) for group, own in GROUPS.items() for name in own])
def test_what_is_stated_better_than_it_is_fails_in_the_claim_about_it(honest, group, name):
    change, claim = GROUPS[group][name]
    found = failed(honest, change)
    assert any(name.startswith(claim) for name in found), found


WEAKER: dict[str, Change] = {
    "distance": lambda r: times(r[ALONE]["distance"], 1, 1.1),
    "radii": lambda r: [times(r[key], "ultimate_radius", 1.1) for key in (ALONE, A, B)],
    "largest h": lambda r: times(r[ALONE], "uncertainty_limit", 0.9),
    "derived": lambda r: times(r["constants"]["theta"], "above", 2),
}


@pytest.mark.parametrize("name", WEAKER)
def test_what_is_stated_worse_than_it_is_stays_confirmed(honest, name):
    """What shows that the others fail for what they are, and not for being touched."""
    assert failed(honest, WEAKER[name]) == []


def test_a_distance_below_the_start_is_refused_where_d_falls_from_there():
    far = confirmed(
        SMALL.replace("0.1*sin(t) + 0.05*x", "0.01*sin(t)").replace("at: [0.05, 0]", "at: [0.15, 0.1]"),
        conditions="distance",
    )
    assert far[0]["result"][ALONE]["ultimate_radius"] < 0.02

    def change(r: Result) -> None:
        r[ALONE]["distance"] = [0.1, 0.99 * r["constants"]["initial_distance"]["above"]]

    assert any(name.startswith("0: sup D <= ") for name in failed(far, change))


@pytest.fixture(scope="module")
def strong():
    return confirmed(SMALL.replace("0.1*sin(t)", "0.4*sin(t)"), conditions="distance")


TOLD: dict[str, Change] = {
    "a better margin": lambda r: more(r[ALONE]["margin"], by=1e-3),
    "a radius": lambda r: r[ALONE].update(ultimate_radius=1.0),
}


@pytest.mark.parametrize("name", TOLD)
def test_what_is_told_of_a_feedback_that_does_not_suffice_is_true(strong, name):
    assert strong[0]["result"][ALONE]["verdict"] == "refuted"
    assert "0: what is told of it" in failed(strong, TOLD[name])
    assert failed(strong, lambda r: more(r[ALONE]["margin"], by=-1e-3)) == []


@pytest.fixture(scope="module")
def asked():
    """Gains that do for B and not for A, for which 0 decides."""
    return confirmed(SMALL, conditions="0", bandwidth=Fraction(5), adaptation_rate=Fraction(26_000))


@pytest.fixture(scope="module")
def weak():
    """Gains that do for neither."""
    return confirmed(SMALL, conditions="0", bandwidth=Fraction("0.5"), adaptation_rate=Fraction(10_000))


@pytest.fixture(scope="module")
def windy():
    return confirmed(BLOWN, conditions="distance")


def without_gains(r: Result) -> None:
    """A radius is all that is left of A."""
    gone = ("bandwidth", "adaptation_rate", "predictor_gain", "projection_radius", "margins")
    r[A] |= dict.fromkeys((*gone, "least_adaptation")) | {"ultimate_radius": 1e-9}
    for name in rates.DERIVED:
        del r["constants"][name]


def no_pairs(r: Result) -> None:
    """A radius is all that is left of B."""
    r[B] |= dict.fromkeys(("asked", "least_adaptation", "split")) | {"ultimate_radius": 1e-9}


RADIUS_A, RADIUS_B = "A: ultimate radius", "B: ultimate radius"
TOLD_BESIDE: dict[str, tuple[str, Change, str]] = {
    "A, better (26a)": (
        "asked",
        lambda r: r[A]["margins"].update({"26a": [0.99, 1.0]}),
        "A: what is told of it",
    ),
    "A, better (26b)": (
        "asked",
        lambda r: r[A]["margins"].update({"26b": [0.99, 1.0]}),
        "A: what is told of it",
    ),
    "A, better (26c)": (
        "asked",
        lambda r: r[A]["margins"].update({"26c": [-1e-3, 1.0]}),
        "A: what is told of it",
    ),
    "A, a radius": ("asked", lambda r: r[A].update(ultimate_radius=1.0), RADIUS_A),
    "A, a radius in a wind": ("windy", lambda r: r[A].update(ultimate_radius=0.1), RADIUS_A),
    "A, a radius of no gains": ("windy", without_gains, RADIUS_A),
    "B, a better margin": (
        "weak",
        lambda r: r[B]["asked"].update(margin=[-1e-3, 1.0]),
        "B: what is told of it",
    ),
    "B, a radius": ("weak", lambda r: r[B].update(ultimate_radius=0.1), RADIUS_B),
    "B, its radius": ("weak", lambda r: r[B]["asked"].update(ultimate_radius=0.1), "B: what is told of it"),
    "B, a radius of no gains": ("weak", no_pairs, RADIUS_B),
}


@pytest.mark.parametrize("name", TOLD_BESIDE)
def test_what_is_told_of_gains_that_do_not_suffice_is_true(request, name):
    made, change, claim = TOLD_BESIDE[name]
    assert claim in failed(request.getfixturevalue(made), change)


def test_what_is_told_of_gains_that_do_not_suffice_may_be_worse(weak):
    assert failed(weak, lambda r: more(r[B]["asked"]["margin"], by=-0.01)) == []
    assert failed(weak, lambda r: more(r[A]["margins"]["26a"], by=-0.01)) == []


def test_a_tube_that_is_wider_than_it_has_to_be_refutes_nothing():
    """Its radius is the certificate's own word: what leaves the set is examined at the least that it can be."""
    made = certified(SMALL.replace("safe_set: {x: [-1", "safe_set: {x: [-0.2"))
    assert made["result"]["verdict"] == "refuted"
    assert failing(examine(made)) == []
    forged = respecified(made, lambda s: s["safe_set"].update(x=["-1", "1"]))
    forged["result"]["safe_set"]["x"] = [-1.0, 1.0]
    forged["result"]["tube"] |= {"rho": 100.0, "rho_r": 99.9}
    assert [name for name, _ in failing(examine(sealed(forged)))] == ["refuted: tube_in_safe_set"]


@pytest.mark.parametrize(("key", "option"), [(A, "26"), (B, "distance")])
@pytest.mark.parametrize("gain", ["bandwidth", "adaptation_rate"])
def test_gains_that_were_asked_for_are_those_that_are_judged(key, option, gain):
    asked = {"bandwidth": Fraction(300), "adaptation_rate": Fraction(10**9)}
    made = confirmed(SMALL, conditions=option, **asked)

    def change(r: Result) -> None:
        r["overrides"][gain] *= 2
        if key != A:  # the first that differs is named
            r[A][gain] *= 2

    document = copy.deepcopy(made[0])
    change(document["result"])
    reasons = [why for _, why in failing(examine(sealed(document), memory=dict(made[1])))]
    assert any(f"overrides.{gain} is not what {key} judges" in why for why in reasons), reasons


def test_a_pair_of_b_is_called_asked_where_it_was():
    """Where gains were asked for no others decide, and where none were none are told as if they had been."""
    asked = {"bandwidth": Fraction(300), "adaptation_rate": Fraction(10**9)}
    for options, gone, there in (({}, "least_adaptation", "asked"), (asked, "asked", "least_adaptation")):
        made = confirmed(SMALL, conditions="distance", **options)

        def change(r: Result, gone: str = gone, there: str = there) -> None:
            r[B][there], r[B][gone] = r[B][gone], None

        assert "the specification and what repeats it" in failed(made, change)


@pytest.mark.parametrize(("key", "option"), [(A, "26"), (B, "distance")])
def test_a_predictor_that_was_asked_for_is_the_one_that_is_proven(key, option):
    """Where the rate is as large as one likes, another one would do."""
    made = confirmed(SMALL, conditions=option)

    def change(r: Result) -> None:
        pair(r, key, predictor_gain=2, adaptation_rate=10**6)

    assert any("omega = " in name for name in failed(made, change))


@pytest.mark.parametrize(("limits", "holds"), [((-1, 1), True), ((-0.2, 3), False), ((-3, 0.2), False)])
def test_an_input_stays_within_both_of_its_limits(honest, limits, holds):
    """Specification and entry agree; the bound lies within, or beyond one end."""
    document = respecified(honest[0], lambda s: s["limits"].update(u=list(map(str, limits))))
    document["result"]["inputs"][0]["limits"] = list(map(float, limits))
    names = [name for name, _ in failing(examine(sealed(document), memory=dict(honest[1])))]
    assert names == ([] if holds else ["the verdict follows from the sections"])


def test_an_input_is_bounded_by_what_is_certified_alone():
    made = confirmed(
        SMALL.replace("0.1*sin(t)", "0.4*sin(t)") + "limits: {u: [-9, 9]}\n", conditions="distance"
    )
    assert ALONE not in made[0]["result"]["inputs"][0]["bounds"]

    def change(r: Result) -> None:
        bounds = r["inputs"][0]["bounds"]
        bounds[ALONE] = {"least": -8.0, "greatest": 8.0, "feedback": 7.0, "adaptation": 0.0}

    assert "the verdict follows from the sections" in failed(made, change)


def test_a_plan_outside_of_the_safe_set_is_one_in_the_checkers_eyes_too():
    made = certified(SMALL.replace("safe_set: {x: [-1", "safe_set: {x: [1/2"))
    assert made["result"]["reasons"][0]["claim"] == "plan_in_safe_set"
    assert failing(examine(made)) == []
    forged = respecified(made, lambda s: s["safe_set"].update(x=["-1", "1"]))
    forged["result"]["safe_set"]["x"] = [-1.0, 1.0]
    assert [name for name, _ in failing(examine(sealed(forged)))] == ["refuted: plan_in_safe_set"]
    for key in ("state", "side"):
        own = made["result"]["reasons"][0][key]
        other = {"lower": "upper", "upper": "lower", "x": "y"}[own]
        assert failed((made, {}), lambda r, key=key, other=other: r["reasons"][0].update({key: other})), key


def test_a_start_outside_of_the_half_widths_is_one_in_the_checkers_eyes_too():
    narrow = SMALL.replace("epsilon: 0.2, rho_a: 0.1", "half_widths: {x: 0.3}")
    made = certified(narrow.replace("at: [0.05, 0]", "at: [0.4, 0]"))
    assert made["result"]["reasons"][0]["claim"] == "start_in_tube"
    assert failing(examine(made)) == []
    forged = respecified(made, lambda s: s["initial_state"].update(at=["0.2", "0"]))
    assert [name for name, _ in failing(examine(sealed(forged)))] == ["refuted: start_in_tube"]
    assert failed((made, {}), lambda r: r["reasons"][0].update(half_width=0.001))
