"""Untrusted pieces that lie: whatever a search hands over, nothing is certified that is not true."""

import copy
import pickle
from dataclasses import replace
from pathlib import Path

import pytest
from problems import three_state

from tubecert import certificate
from tubecert.conditions.theorem import Asked
from tubecert.kernel import NotProvenError, Proof, Unproven, check
from tubecert.kinds.table import KINDS, kind_of
from tubecert.letters import RATES
from tubecert.pipeline import Options, certify, question_of
from tubecert.pipeline.certification import answer
from tubecert.pipeline.certification import judge as judge_gains
from tubecert.pipeline.certification import result as result_of_answer
from tubecert.recheck.run import recheck
from tubecert.search.elasticities import elasticities
from tubecert.search.proposers import PROPOSERS
from tubecert.search.rates import RateSearch
from tubecert.spec import load

CONFIG = Path(__file__).parents[2] / "configs" / "three_state.yaml"
KEYS = ("conditions_26", "distance")


def slow(recipe):
    """A recipe whose rate is 1000 times too small."""
    return replace(recipe, adaptation_rate=recipe.adaptation_rate / 1000)


@pytest.fixture(scope="module")
def bounded():
    """A shipped specification, up to its proven constants."""
    return answer(question_of(load(str(CONFIG)), Options(conditions="all"))).bounded


@pytest.fixture(scope="module")
def honest(bounded):
    """The certificate if nobody lies."""
    return result_of_answer(judge_gains(bounded)).to_json()


@pytest.mark.slow
@pytest.mark.parametrize("key", KEYS)
def test_a_search_that_lies_certifies_nothing(key, bounded, honest, monkeypatch):
    """One lie on the way from the proposer to the certificate; all of them meet the kernel in `test_lying_searches`."""
    recipe = kind_of(key).theorem.recipe
    own = PROPOSERS[recipe]

    def propose(problem, asked):
        told = own.propose(problem, asked)
        beside = {role: slow(each) for role, each in told.beside.items()}
        return replace(told, decisive=slow(told.decisive), beside=beside, curve=tuple(map(slow, told.curve)))

    monkeypatch.setitem(PROPOSERS, recipe, replace(own, propose=propose))
    result = result_of_answer(judge_gains(bounded)).to_json()
    assert honest["verdict"] == honest[key]["verdict"] == "certified"
    assert result[key]["verdict"] != "certified"
    assert result["verdict"] != "certified"
    assert key not in result["proof"]
    assert result[key]["shortfalls"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "slopes",
    [
        lambda problem, least: {"h": float("inf"), "B": float("nan")},
        lambda problem, least: {"h": -1e300, "h_t": 1e300},
        lambda problem, least: {k: -v for k, v in elasticities(RateSearch, problem, least).items()},
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
    for key in KEYS:
        recipe = kind_of(key).theorem.recipe
        honest = PROPOSERS[recipe]

        def propose(problem, asked, honest=honest):
            told = honest.propose(problem, asked)
            return replace(told, beside={}, curve=tuple(map(slow, told.curve)), around=())

        monkeypatch.setitem(PROPOSERS, recipe, replace(honest, propose=propose))
    result = certify(load(str(CONFIG)), Options(conditions="all")).to_json()
    assert result["verdict"] == "certified"
    found = recheck(certificate.dump(certificate.seal(result, {})), "made")
    assert found.verdict == "confirmed", found.failing
    assert "curve" not in result["conditions_26"]


@pytest.mark.parametrize("kind", [kind_of(key) for key in KEYS], ids=lambda kind: kind.key)
def test_a_proof_has_one_maker_and_cannot_be_changed(kind):
    problem = three_state()
    recipe = PROPOSERS[kind.theorem.recipe].propose(problem, Asked()).decisive
    proof = check(problem, recipe)
    assert isinstance(proof, Proof)
    assert all(margin.lo > 0 for margin in proof.margins.values())
    for name in ("recipe", "margins", "problem", "other"):
        with pytest.raises(AttributeError, match="cannot be changed"):
            setattr(proof, name, None)
    bad = slow(recipe)
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
