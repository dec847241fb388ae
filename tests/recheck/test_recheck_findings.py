"""Findings that have no other place: what plans owe (R6), which file a certificate is of (R4, R5), R7, S7, S8."""

import copy
import math
from fractions import Fraction

import proven
import pytest
from flint import ctx
from rechecked import (
    belongs_to,
    case_of,
    certified,
    digest,
    doubted,
    examine,
    failing,
    respecified,
    sealed,
    shipped,
    terms,
    unconfirmed,
)
from systems import BLOWN, SCALAR, SMALL

from tubecert import spec
from tubecert.certificate.belonging import ForeignError
from tubecert.certificate.result import Result
from tubecert.errors import ExitCode, TubecertError
from tubecert.expression import number_text
from tubecert.recheck import geodesics
from tubecert.recheck.claims import of_certified
from tubecert.recheck.constants import feedback_gain
from tubecert.recheck.monomials import degree
from tubecert.records import FormError

GIVEN = 'metric: {rate: 0.8, dual_metric: [[1, "-0.3"], ["-0.3", 2]]}'


@pytest.mark.parametrize(
    ("where", "owes"),
    [("-x + y", "-x + y + 0*sqrt(x - 5)"), ("-x + y", "-x + y + 0/x"), ("0.05*x", "0.05*x + 0*abs(x)/x")],
    ids=["a root", "a divisor", "a divisor in h"],
)
def test_what_folding_drops_is_owed_and_makes_another_system(where, owes, tmp_path):
    """R4: such a file had the hash of the one without; certify refuses it, and recheck said that it belongs."""
    document, text = certified(SMALL), SMALL.replace(where, owes)
    assert belongs_to(document, SMALL, tmp_path)
    with pytest.raises(ForeignError):
        belongs_to(document, text, tmp_path)
    effective = spec.canonical(spec.load_text(text, "plant.yaml"))

    def change(own):
        own |= {key: effective[key] for key in ("system", "uncertainty")}

    forged = respecified(document, change)
    assert belongs_to(forged, text, tmp_path)
    found = examine(forged, 2_000, to_first_failure=True)
    assert [name for name, _ in failing(found)] == ["f, B, W, h and the plan are smooth"]


@pytest.mark.slow
def test_a_metric_that_was_asked_for_is_not_any_metric(tmp_path):
    """R5: a certificate with a metric written by hand, at another rate, was taken for the one that was synthesised."""
    text = SMALL.replace(GIVEN, "metric: {synthesise: {rate: 0.5}}")
    made = certified(text, conditions="distance")
    assert "the metric was synthesised for it" in belongs_to(made, text, tmp_path)
    assert failing(examine(made)) == []
    with pytest.raises(ForeignError):
        belongs_to(certified(SMALL), text, tmp_path)
    with pytest.raises(ForeignError):
        belongs_to(made, SMALL.replace(GIVEN, "metric: {synthesise: {rate: 1.7}}"), tmp_path)
    for asked in ({"rate": "0.6"}, {"condition_number": "1"}):
        forged = copy.deepcopy(made)
        forged["result"]["synthesis"]["asked"] |= asked
        assert examine(sealed(forged), 100).exit_code == ExitCode.NOT_CERTIFIED


ASKED = {  # of a metric in y alone, of degree 2 at most
    "another state": {"variables": ["x"]},
    "no state": {"variables": []},
    "a lower degree": {"degree": "1"},
    "what is no state": {"variables": ["y", "z"]},
    "too large a degree": {"degree": "9"},
    "an objective that there is not": {"objective": "fun"},
    "an objective that searches for the rate": {"objective": "rate"},
    "outputs of another objective": {"outputs": ["x"]},
    "outputs that there are not": {"objective": "tube", "outputs": ["w"]},
    "a route that there is not": {"route": "guessed"},
    "a solver that there is not": {"solver": "mosek"},
    "coordinates that there are not": {"coordinates": "polar"},
}


@pytest.mark.parametrize(
    ("text", "most"), [("x*sin(y)**2*cos(y) + x", 4), ("(x + 1)**2 - x**2", 1), ("3/2", 0)]
)
def test_a_degree_counts_waves_as_variables(text, most):
    assert degree(terms([text], ["x", "y"])) == most


@pytest.fixture(scope="module")
def bent():
    """A certificate of a metric that was written down, told as one that was asked for."""
    turned = 'metric: {rate: 0.5, dual_metric: [["2 + y**2/100", "-0.3"], ["-0.3", 2]]}'
    made = certified(SMALL.replace("[[0], [1]]", "[[1], [0]]").replace(GIVEN, turned), conditions="distance")
    made["result"]["synthesis"] = {
        "asked": {"rate": "0.5", "objective": "condition", "degree": "2", "variables": ["y"]}
        | {"route": "auto", "solver": "clarabel"}
    }
    return made


@pytest.mark.slow
@pytest.mark.parametrize("name", [None, *ASKED])
def test_a_metric_is_told_to_be_asked_for_as_it_is(bent, name):
    forged = copy.deepcopy(bent)
    forged["result"]["synthesis"]["asked"] |= ASKED.get(name, {})
    assert unconfirmed(forged) is (name is not None)


@pytest.mark.slow
def test_a_metric_that_was_not_found_is_the_one_that_was_asked_for():
    """Every word of it: where only rates were compared, a search of another degree could be told."""
    unreached = SMALL.replace('"-x + y"', '"-x + x*y"')
    made = certified(unreached.replace(GIVEN, "metric: {synthesise: {rate: 1.5, degree: 0}}"))
    assert made["result"]["verdict"] == "refuted"
    said = made["result"]["synthesis"]["asked"]
    assert not doubted(made)
    for key, value in (
        ("degree", "4"),
        ("degree", "auto"),
        ("variables", ["y"]),
        ("route", "sos"),
        ("solver", "scs"),
    ):
        forged = copy.deepcopy(made)
        forged["result"]["synthesis"]["asked"] = said | {key: value}
        assert unconfirmed(forged), key


def planned():
    return shipped("two_state")


def names(found):
    return {name for name, _ in failing(found)}


def misses(result):
    """The last knot a hundredth of the way back to the first."""
    x = result["plan"]["knots"]["x"]
    x[-1] = [
        number_text(Fraction(a) / 100 + 99 * Fraction(b) / 100) for a, b in zip(x[0], x[-1], strict=True)
    ]


OTHER_TASKS = {
    "R6: it has a goal and ends elsewhere": misses,
    "it begins elsewhere": lambda r: r["spec"]["effective"]["trajectory"].update(start=["3.4", "-2.3"]),
    "it lasts longer": lambda r: r["plan"]["knots"]["t"].__setitem__(-1, "5.01"),
}


@pytest.mark.slow
@pytest.mark.parametrize("other", OTHER_TASKS)
def test_a_plan_serves_its_task(other):
    document = planned()
    assert document["result"]["spec"]["effective"]["trajectory"]["goal"] == "true"
    OTHER_TASKS[other](document["result"])
    assert "the plan serves its task" in names(examine(sealed(document), 20))


@pytest.mark.slow
def test_inputs_that_do_not_lead_along_the_states_are_a_defect():
    """R6: the plan is what its knots define; other inputs are another plan, with a defect of its own."""
    document = planned()
    knots = document["result"]["plan"]["knots"]
    knots["u"] = [[number_text(Fraction(u) * Fraction(99, 100)) for u in row] for row in knots["u"]]
    found = names(examine(sealed(document), 20))
    assert any(name.startswith(("plan_defect <=", "plan_defect_metric <=")) for name in found)
    assert "the plan serves its task" not in found


@pytest.mark.slow
def test_a_contraction_that_exceeds_its_rate_is_confirmed():
    """R7: a largest eigenvalue may be negative; a true certificate was contradicted."""
    text = (
        SMALL.replace('"-y + 0.3*sin(x)"', '"-y"')
        .replace(GIVEN, "metric: {rate: 0.3, dual_metric: [[1, 0], [0, 1]]}")
        .replace("0.1*sin(t) + 0.05*x", "0.1*sin(t)")
    )
    document = certified(text, conditions="distance")
    assert document["result"]["constants"]["feedback_gain"]["above"] < 1e-11
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_a_feedback_of_nothing_is_confirmed():
    """W contracts at its rate by itself: F is 0, so du = 0 is a bound; of any other F it is none."""
    own = SCALAR.replace("-x + 0.1*sin(x)", "-0.5*x").replace("0.2*sin(t)", "0.05*sin(t)")
    document = certified(own, conditions="distance")
    assert document["result"]["constants"]["feedback_gain"]["above"] == 0
    assert failing(examine(document, 400)) == []
    # of a plant that contracts more slowly than that, F is .2
    place = case_of(certified(SCALAR.replace("-x + 0.1*sin(x)", "-0.4*x"), conditions="distance")).place
    assert not feedback_gain(place, Fraction(0), Fraction(1)).holds
    assert feedback_gain(place, Fraction(1), Fraction(1)).holds


@pytest.mark.slow
def test_outcomes_of_a_forged_certificate_are_not_those_of_another():
    """A half-width that only a forged bound of the metric allows is not confirmed with the bound that is true."""
    document, memory = copy.deepcopy(certified(SMALL, conditions="distance")), {}
    document["result"]["tube"]["half_widths"]["x"] /= 2
    forged = copy.deepcopy(document)
    forged["result"]["constants"]["lower"] |= {"below": 1e6, "above": 1e6}
    examine(sealed(forged), memory=memory)
    assert any("half-width of x" in name for name, _ in failing(examine(sealed(document), memory=memory)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "resting"),
    [("lower", "half-width"), ("h", "B: "), ("feedback_gain", "B: "), ("initial_distance", "0: ")],
)
def test_claims_depend_on_all_that_they_rest_on(name, resting):
    honest = certified(SMALL, conditions="distance")
    other = copy.deepcopy(honest)
    other["result"]["constants"][name] |= {"below": 7.0, "above": 7.0}
    keys, others = ({c.name: c.key for c in of_certified(case_of(x))} for x in (honest, sealed(other)))
    found = [own for own in keys if resting in own]
    assert found
    assert all(keys[own] != others[own] for own in found)


def test_the_hash_of_the_specification_is_compared():
    document = certified(SMALL)
    document["result"]["spec"]["effective"]["name"] = "other"
    document["hash"] = digest(document["result"])
    assert "the specification and what repeats it" in names(examine(document, 20))


@pytest.mark.slow
def test_unique_geodesics_of_a_metric_that_varies_about_a_plan_that_moves():
    """R8: samples of a grid missed the extreme of the tube, and the bound was shared by them."""
    text = (
        SMALL.replace(
            "trajectory: {kind: equilibrium, at: [0, 0], input: [0]}",
            'trajectory: {kind: expressions, x: ["0.1*sin(t)", "0.1*sin(t) + 0.1*cos(t)"], '
            'u: ["0.2*cos(t) - 0.3*sin(0.1*sin(t))"], horizon: 3}',
        )
        .replace("at: [0.05, 0]", "at: [0.02, 0.1]")
        .replace(GIVEN, 'metric: {rate: 0.35, dual_metric: [["1 + 0.1*x + 0.1*x**2", "-0.3"], ["-0.3", 2]]}')
    )
    case = case_of(certified(text, conditions="distance"), 20_000)
    place = case.place
    value = case.metric.unique_geodesics.value.above
    with ctx.workprec(64):
        assert geodesics.unique(place, value).holds
        sampled = [
            Fraction(geodesics._sampled(geodesics.SymbolsBelow(place.fields, order, Fraction(0)), place))
            for order in (0, 1)
        ]
        tight = sampled[0] * place.rho + sampled[1] * place.rho**2 / 8
        assert geodesics.unique(place, tight * Fraction(10002, 10000)).holds
        assert not geodesics.unique(place, tight * Fraction(9998, 10000)).holds


@pytest.mark.slow
def test_what_was_asked_of_a_synthesis_survives_reading():
    """The reader of reports knew no `synthesis.asked`: every certificate with a synthesis was an internal error."""
    document = certified(SMALL.replace(GIVEN, "metric: {synthesise: {rate: 0.5}}"), conditions="distance")
    read = Result.from_json(document["result"])
    assert read.synthesis.asked.data == document["result"]["synthesis"]["asked"]
    for asked in ({}, {"rate": 0.5}, {"objective": "condition", "speed": "1"}):
        changed = copy.deepcopy(document["result"])
        changed["synthesis"]["asked"] = asked
        with pytest.raises(FormError):
            Result.from_json(changed)


def not_certified(document, key, **told):
    """A section that does not decide says that it is not certified, and tells of gains all the same."""
    document = copy.deepcopy(document)
    result = document["result"]
    other = next(name for name in ("distance", "conditions_26") if name != key)
    result |= {"decided_by": [other], "reasons": []}
    result["proof"].pop(key, None)
    result[key] |= {"verdict": "undecided", **told}
    return names(examine(sealed(document), 1_000))


NOT_CERTIFIED = {
    "A": ("conditions_26", {"adaptation_rate": 1.0, "ultimate_radius": None}),
    "0, a radius": ("no_adaptation", {"ultimate_radius": 0.001}),
    "0, a margin": ("no_adaptation", {"margin": [0.9, 0.95], "ultimate_radius": None}),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", NOT_CERTIFIED)
def test_what_is_not_certified_is_not_told_as_if_it_were(case):
    """An attack: gains that do not serve, with the margins of gains that do, in a section that is not certified."""
    key, told = NOT_CERTIFIED[case]
    assert f"{case[0]}: what is told of it" in not_certified(certified(SMALL), key, **told)


@pytest.mark.slow
def test_a_certificate_of_b_is_none_for_a_specification_that_a_decides():
    """A is undecided in a wind; B, which is certified, decides in its place: it was confirmed, with --spec too."""
    document = proven.proven(BLOWN + "conditions: {decides: A}\n", bare=True)
    result = document["result"]
    assert (result["verdict"], result["decided_by"]) == ("undecided", ["conditions_26"])
    result |= {"verdict": "certified", "decided_by": ["distance"], "reasons": []}
    assert examine(sealed(document)).verdict != "confirmed"


@pytest.mark.slow
def test_a_recipe_of_a_kind_that_is_not_certified_is_refused():
    """Nothing examines it: in a wind, of which A knows nothing, a recipe of A was confirmed with the rest."""
    document = copy.deepcopy(certified(BLOWN, conditions="distance"))
    assert failing(examine(document)) == []
    document["result"]["proof"]["conditions_26"] = certified(SMALL)["result"]["proof"]["conditions_26"]
    with pytest.raises(TubecertError, match="conditions_26 is not known"):
        examine(sealed(document))


ONE = """tubecert: 1
name: one
system: {states: [x], inputs: [u], f: [-x], B: [[1]]}
safe_set: {x: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: PLAN
initial_state: START
metric: {rate: 0.5, dual_metric: [[1]]}
tube: {epsilon: 0.2, rho_a: 0.1}
"""
REST = ONE.replace("PLAN", "{kind: equilibrium, at: [0], horizon: 2}").replace("START", "{at: [0.05]}")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "asked"),
    [
        (REST + "adaptation: {A_m: -1/3}\n", {}),
        (REST, {"bandwidth": Fraction(100, 3), "adaptation_rate": Fraction(10**9)}),
    ],
    ids=["A_m", "a bandwidth"],
)
def test_numbers_without_a_short_decimal_are_certified_and_confirmed(text, asked):
    """S7: they ended the program."""
    assert text != SMALL
    document = certified(text, conditions="all" if not asked else None, **asked)
    assert document["result"]["verdict"] == "certified"
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_a_start_that_is_the_rounded_start_of_an_irrational_plan_is_bounded():
    """S8: of all digits of a float d0 could not be bounded, of six it could."""
    plan = '{kind: expressions, x: ["sin(t + 1)/3"], u: ["cos(t + 1)/3 + sin(t + 1)/3"], horizon: 2}'
    text = ONE.replace("PLAN", plan).replace("START", f"{{at: [{math.sin(1) / 3!r}]}}")
    document = certified(text, conditions="distance")
    assert document["result"]["verdict"] == "certified"
    assert document["result"]["constants"]["initial_distance"]["above"] < 1e-9
    assert failing(examine(document)) == []
