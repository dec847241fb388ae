"""Untrusted pieces that lie: whatever a search hands over, nothing is certified that is not true."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from problems import ALIVE, alive, three_state

from tubecert import certificate
from tubecert.conditions.proposal import Asked, Proposal
from tubecert.conditions.verdict import Verdict
from tubecert.kernel import NotProvenError, Proof, Unproven, check, judge
from tubecert.kinds.table import KINDS, kind_of
from tubecert.letters import RATES
from tubecert.pipeline import Options, certify, question_of
from tubecert.pipeline.certification import answer
from tubecert.pipeline.certification import judge as judge_gains
from tubecert.pipeline.certification import result as result_of_answer
from tubecert.recheck.run import recheck
from tubecert.search.elasticities import elasticities_26
from tubecert.search.proposers import PROPOSERS, Proposer
from tubecert.spec import load

CONFIG = Path(__file__).parents[2] / "configs" / "three_state.yaml"
THOUSANDTH = Fraction(1, 1000)


def less(*names, factor=THOUSANDTH):
    """A recipe with some of its numbers made smaller."""

    def lie(recipe):
        return replace(recipe, **{name: getattr(recipe, name) * factor for name in names})

    return lie


LIES = {
    "conditions_26": {
        "a rate 1000 times too small": less("adaptation_rate"),
        "half the bandwidth": less("bandwidth", factor=Fraction(1, 2)),
        "a projection that cuts h off": less("projection_radius", factor=Fraction(9, 10)),
        "a rate just too small": less("adaptation_rate", factor=Fraction(999, 1000)),
    },
    "distance": {
        "a rate 1000 times too small": less("adaptation_rate"),
        "a rate 1000 times too small and an error to match": less("adaptation_rate", "prediction_error"),
        "no error, no uncertainty left": less("prediction_error", "uncertainty", "adaptation_rate"),
        "a speed that is exceeded": less("speed", factor=Fraction(99, 100)),
        "a projection that cuts h off": less("projection_radius", factor=Fraction(9, 10)),
    },
}
CASES = [(key, name) for key, lies in LIES.items() for name in lies]


def other(**numbers):
    """A recipe with other numbers."""
    return lambda recipe: replace(recipe, **numbers)


# what margins alone would let pass: the theorems are stated for this loop and for positive gains
for _key, _lies in LIES.items():
    _lies |= {
        "another predictor than was asked for": other(predictor_gain=Fraction(1, 10)),
        "a predictor that is not damped": other(predictor_gain=Fraction(-1000)),
        "no predictor": other(predictor_gain=None),
        "a negative bandwidth": less("bandwidth", factor=Fraction(-1)),
        "no clip at all": other(projection_radius=Fraction(0)),
        "a number that is none": other(bandwidth=float("nan")),
        "a binary number": other(bandwidth=20.0),
    }
LIES["conditions_26"]["a negative rate"] = less("adaptation_rate", factor=Fraction(-1))
LIES["distance"]["a negative error"] = less("prediction_error", factor=Fraction(-1))
LIES["distance"]["a negative uncertainty"] = less("uncertainty", factor=Fraction(-1))
CASES = [(key, name) for key, lies in LIES.items() for name in lies]


@pytest.fixture(scope="module")
def bounded():
    """A shipped specification, up to its proven constants."""
    return answer(question_of(load(str(CONFIG)), Options(conditions="all"))).bounded


@pytest.fixture(scope="module")
def honest(bounded):
    """The certificate if nobody lies."""
    return result_of_answer(judge_gains(bounded)).to_json()


@pytest.fixture(scope="module")
def problem(bounded):
    return bounded.problem


@pytest.fixture(scope="module")
def honestly():
    """What every proposer honestly told about the shipped specification, once for all lies about it."""
    return {}


@pytest.fixture
def told(honestly, monkeypatch):
    """Proposers that are asked once: for tests about `bounded` only."""

    def of(kind, propose):
        def telling(problem, asked):
            if (kind, asked) not in honestly:
                honestly[kind, asked] = propose(problem, asked)
            return honestly[kind, asked]

        return telling

    for kind, each in PROPOSERS.items():
        monkeypatch.setitem(PROPOSERS, kind, replace(each, propose=of(kind, each.propose)))


def lying(key, lie, monkeypatch):
    """The proposer of one kind tells a lie about every recipe."""
    kind = next(kind for kind in KINDS if kind.key == key)
    honest = PROPOSERS[kind.theorem.recipe]

    def propose(problem, asked):
        told = honest.propose(problem, asked)
        return replace(
            told,
            decisive=None if told.decisive is None else lie(told.decisive),
            beside={role: lie(recipe) for role, recipe in told.beside.items()},
            curve=tuple(map(lie, told.curve)),
        )

    monkeypatch.setitem(PROPOSERS, kind.theorem.recipe, replace(honest, propose=propose))


@pytest.mark.slow
@pytest.mark.usefixtures("told")
@pytest.mark.parametrize(("key", "name"), CASES)
def test_a_search_that_lies_certifies_nothing(key, name, bounded, honest, monkeypatch):
    lying(key, LIES[key][name], monkeypatch)
    result = result_of_answer(judge_gains(bounded)).to_json()
    assert honest["verdict"] == honest[key]["verdict"] == "certified"
    assert result[key]["verdict"] != "certified"
    assert result["verdict"] != "certified"
    assert key not in result["proof"]
    assert result[key]["shortfalls"]
    for role in ("least_adaptation", "split"):
        assert not result[key].get(role) or result[key]["verdict"] != "certified"


@pytest.mark.parametrize("key", LIES)
def test_points_beside_the_decisive_gains_are_checked_too(key, problem, monkeypatch):
    kind = next(kind for kind in KINDS if kind.key == key)
    honest = PROPOSERS[kind.theorem.recipe]
    lie = next(iter(LIES[key].values()))

    def propose(problem, asked):
        told = honest.propose(problem, asked)
        return replace(
            told,
            curve=tuple(map(lie, told.curve)),
            beside={role: lie(recipe) for role, recipe in told.beside.items()},
        )

    monkeypatch.setitem(PROPOSERS, kind.theorem.recipe, Proposer(propose=propose))
    section = kind.section(problem, propose(problem, Asked()))
    assert section.verdict is Verdict.CERTIFIED
    assert not section.curve
    assert not section.judgement.beside


def test_an_ultimate_radius_needs_a_companion_at_the_same_gains_that_is_proven(problem):
    kind = kind_of(RATES.key)
    told = PROPOSERS[kind.theorem.recipe].propose(problem, Asked())
    honest = kind.section(problem, told).judgement.ultimate_radius
    assert honest is not None
    for companion in (
        replace(told.companion, uncertainty=told.companion.uncertainty / 2),
        replace(told.companion, prediction_error=told.companion.prediction_error / 2),
        replace(told.companion, adaptation_rate=told.companion.adaptation_rate * 10),
        None,
    ):
        section = kind.section(problem, replace(told, companion=companion))
        assert section.verdict is Verdict.CERTIFIED
        assert section.judgement.ultimate_radius is None


@pytest.mark.slow
@pytest.mark.parametrize(
    "slopes",
    [
        lambda problem, least: {"h": float("inf"), "B": float("nan")},
        lambda problem, least: {"h": -1e300, "h_t": 1e300},
        lambda problem, least: {k: -v for k, v in elasticities_26(problem, least).items()},
    ],
    ids=["no numbers", "absurd", "turned round"],
)
def test_elasticities_that_lie_change_no_claim(slopes, bounded, honest, monkeypatch):
    recipe = kind_of(RATES.key).theorem.recipe
    monkeypatch.setitem(PROPOSERS, recipe, replace(PROPOSERS[recipe], slopes=slopes))
    result = result_of_answer(judge_gains(bounded)).to_json()
    for key in ("conditions_26", "distance", "proof", "verdict", "constants"):
        assert result[key] == honest[key]


@pytest.mark.slow
def test_what_a_lying_search_leaves_certified_is_confirmed(monkeypatch):
    """Both kinds lie about other gains than the decisive ones: the certificate stands without them."""
    for key, lies in LIES.items():
        kind = next(kind for kind in KINDS if kind.key == key)
        honest, lie = PROPOSERS[kind.theorem.recipe], next(iter(lies.values()))

        def propose(problem, asked, honest=honest, lie=lie):
            told = honest.propose(problem, asked)
            return replace(told, beside={}, curve=tuple(map(lie, told.curve)), around=())

        monkeypatch.setitem(PROPOSERS, kind.theorem.recipe, replace(honest, propose=propose))
    result = certify(load(str(CONFIG)), Options(conditions="all")).to_json()
    assert result["verdict"] == "certified"
    found = recheck(certificate.dump(certificate.seal(result, {})), "made")
    assert found.verdict == "confirmed", found.failing
    assert "curve" not in result["conditions_26"]


# --- the kernel itself


@pytest.mark.parametrize("kind", [kind_of(key) for key in LIES], ids=lambda kind: kind.key)
def test_a_recipe_of_another_theorem_proves_nothing_here(kind, problem):
    for stranger in KINDS:
        found = PROPOSERS[stranger.theorem.recipe].propose(problem, Asked())
        section = kind.section(problem, replace(found, companion=None, around=()))
        assert (section.verdict is Verdict.CERTIFIED) == (stranger is kind)
        assert bool(section.curve) == (stranger is kind)


@pytest.mark.parametrize("kind", [kind_of(key) for key in LIES], ids=lambda kind: kind.key)
def test_a_proof_has_one_maker_and_cannot_be_changed(kind):
    problem = three_state()
    recipe = PROPOSERS[kind.theorem.recipe].propose(problem, Asked()).decisive
    proof = check(problem, recipe)
    assert isinstance(proof, Proof)
    assert all(margin.lo > 0 for margin in proof.margins.values())
    for name in ("recipe", "margins", "problem", "other"):
        with pytest.raises(AttributeError, match="cannot be changed"):
            setattr(proof, name, None)
    bad = next(iter(LIES[kind.key].values()))(recipe)
    with pytest.raises(NotProvenError):
        Proof(problem, bad)
    assert isinstance(check(problem, bad), Unproven)


@pytest.mark.parametrize("travel", [copy.deepcopy, lambda proof: pickle.loads(pickle.dumps(proof))])
def test_a_proof_that_travels_is_proven_anew(travel):
    problem = three_state()
    recipe = PROPOSERS[KINDS[1].theorem.recipe].propose(problem, Asked()).decisive
    again = travel(check(problem, recipe))
    assert isinstance(again, Proof)
    assert again.recipe == recipe


@pytest.mark.slow
def test_gains_that_stand_for_others_prove_nothing():
    for kind in KINDS:
        problem = alive()
        found = PROPOSERS[kind.theorem.recipe].propose(problem, Asked()).decisive
        judgement = judge(problem, kind.theorem, Proposal(hopeless=found))
        assert judgement.verdict is Verdict.UNDECIDED
        assert judgement.decisive is None
        assert judgement.shortfalls


@pytest.mark.slow
def test_a_constant_without_a_bound_proves_nothing():
    for kind in KINDS:
        problem = alive()
        recipe = PROPOSERS[kind.theorem.recipe].propose(problem, Asked()).decisive
        assert isinstance(check(problem, recipe), Proof)
        for name in kind.theorem.needs(problem):
            endless = alive(values={name: (0.9 * ALIVE[name], float("inf"))})
            assert isinstance(check(endless, recipe), Unproven), name
            judgement = judge(endless, kind.theorem, Proposal(decisive=recipe))
            assert judgement.verdict is Verdict.UNDECIDED, name
