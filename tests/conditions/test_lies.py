"""Recipes of 0, A and B that lie, one number at a time: the kernel certifies what an oracle in 60 digits does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from decimal import Decimal
from fractions import Fraction
from itertools import permutations
from math import inf
from typing import Any

import gains_oracle as oracle
import pytest
from gains_oracle import CLOSE
from lies import KINDS, NUMBERS, OMEGAS, PROBLEMS, at, exactly, honest, problems, told, told_twice
from problems import ALIVE

from tubecert.conditions.alone import NoGains
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe
from tubecert.conditions.theorem import Proposal
from tubecert.kernel import Proof, check, judge, theorem_of
from tubecert.search.distance import recipes_at
from tubecert.verdict import Verdict

F = Fraction
PRINTED = 1 + 1e-8  # what is printed is rounded up


def agrees(problem: TubeProblem, recipe: Any, words: object = "") -> bool:
    """Whether a recipe is proven, which has to be what the oracle says of it, with its margins, radius and inputs."""
    true, found = oracle.margins(problem, recipe), check(problem, recipe)
    for claim, margin in found.margins.items() if true else ():
        assert margin.lo <= true[claim], (words, claim)
    if not isinstance(found, Proof):
        assert oracle.left(true) <= CLOSE, words
        return False
    assert oracle.left(true) > 0, words
    assert all(true[x] - CLOSE <= margin.lo <= true[x] <= margin.hi for x, margin in found.margins.items()), (
        words
    )
    own, shares = oracle.claims(problem, recipe), found.input_shares
    assert (shares is None) == (own.feedback == inf), words
    if shares is not None:
        assert own.feedback <= shares.feedback <= own.feedback * PRINTED, words
        assert own.adaptation <= F(shares.adaptation) <= own.adaptation * F(PRINTED), words
    assert (own.radius is None) == (found.ultimate_radius is None), words
    assert own.radius is None or own.radius <= found.ultimate_radius <= own.radius * PRINTED, words
    return True


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), [(name, kind) for name in PROBLEMS for kind in KINDS])
def test_numbers_that_lie_are_certified_where_they_prove_the_theorem_all_the_same(name, kind):
    (problem, proven), recipe = PROBLEMS[name], honest(name, kind)
    assert agrees(problem, recipe, "the truth") == (kind in proven)
    lies = (*told(recipe, kind), *told_twice(recipe, kind))
    found = [agrees(problem, lie, words) for words, lie in lies]
    if kind != "0":
        assert any(found) == (kind in proven)
        assert not all(found)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_recipe_for_another_problem_is_certified_where_it_proves_the_theorem_all_the_same(kind):
    found = [
        agrees(PROBLEMS[name][0], honest(other, kind), (name, other))
        for name, other in permutations(PROBLEMS, 2)
    ]
    assert any(found)
    assert not all(found)


MOVED = sorted(ALIVE)
PARTS = {"rate": F("0.97"), "epsilon": F(2), "rho_a": F("0.9"), "rho_r": F("0.97")}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_recipe_for_a_milder_problem_is_certified_where_it_proves_the_theorem_all_the_same(kind):
    """Every constant and every radius, a little and much worse than it was for the search."""
    name = "every term alive"
    problem, recipe = PROBLEMS[name][0], honest(name, kind)
    for constant in MOVED:
        for factor in (0.5, 0.99, 1.01, 3.0, inf):
            moved = {constant: exactly(ALIVE[constant] * factor)}
            other = replace(problem, constants=replace(problem.constants, **moved))
            agrees(other, recipe, (constant, factor))
    for part, factor in PARTS.items():
        agrees(replace(problem, **{part: getattr(problem, part) * factor}), recipe, part)
    for T in map(F, ("0.01", "0.1", "1", "10")):
        agrees(replace(problem, horizon=T), recipe, T)


@pytest.mark.slow
@pytest.mark.parametrize("omega", OMEGAS)
def test_margins_of_any_size_are_those_of_the_theory(omega):
    for problem in problems():
        gains = at(problem, "A", omega)
        own = recipes_at(problem, [(gains.bandwidth, gains.adaptation_rate, gains.predictor_gain)])[0]
        for recipe in (NoGains(), gains, own):
            true = oracle.margins(problem, recipe)
            for claim, margin in check(problem, recipe).margins.items():
                tolerance = 1e-9 * (1 + abs(true[claim]))
                assert margin.lo <= true[claim]
                assert margin.lo >= true[claim] - tolerance or true[claim] == -inf


@pytest.mark.parametrize("kind", KINDS)
def test_a_recipe_of_another_kind_proves_nothing(kind):
    problem = PROBLEMS["every term alive"][0]
    theorem = theorem_of(KINDS[kind])
    for other in KINDS:
        recipe = honest("every term alive", other)
        judgement = judge(
            problem, theorem, Proposal(decisive=recipe, beside={"beside": recipe}, curve=(recipe,))
        )
        assert (judgement.verdict is Verdict.CERTIFIED) == (kind == other)
        assert bool(judgement.beside) == bool(judgement.curve) == (kind == other)


@pytest.mark.parametrize("kind", KINDS)
def test_a_recipe_for_a_b_that_is_known_proves_nothing_for_one_that_is_not(kind):
    problem, recipe = PROBLEMS["every term alive"][0], honest("every term alive", kind)
    unknown = replace(problem, gained=True)
    assert isinstance(check(problem, recipe), Proof)
    assert not isinstance(check(unknown, recipe), Proof)
    judgement = judge(unknown, theorem_of(KINDS[kind]), Proposal(decisive=recipe, beside={"least": recipe}))
    assert judgement.verdict is Verdict.UNDECIDED
    assert judgement.ultimate_radius is None
    assert judgement.proof is None


@pytest.mark.parametrize("kind", KINDS)
def test_what_only_looks_like_a_recipe_proves_nothing(kind):
    problem, recipe = PROBLEMS["every term alive"][0], honest("every term alive", kind)
    alike = type("Alike", (KINDS[kind],), {})
    for lie in (
        alike(**{item.name: getattr(recipe, item.name) for item in fields(recipe)}),
        object(),
        KINDS[kind],
    ):
        judgement = judge(problem, theorem_of(KINDS[kind]), Proposal(decisive=lie))
        assert judgement.verdict is Verdict.UNDECIDED
        assert judgement.decisive is None


NO_NUMBERS = (None, float("nan"), inf, -inf, 20.0, 20, True, "20", Decimal(20), 20 + 0j)


@pytest.mark.parametrize("kind", "AB")
def test_what_is_no_exact_decimal_proves_nothing(kind):
    problem, recipe = PROBLEMS["any predictor"][0], honest("any predictor", kind)
    for name in NUMBERS[kind]:
        for lie in NO_NUMBERS:
            told = replace(recipe, **{name: lie})
            judgement = judge(
                problem, theorem_of(KINDS[kind]), Proposal(decisive=told, beside={"beside": told})
            )
            assert judgement.verdict is Verdict.UNDECIDED, (name, lie)
            assert judgement.decisive is None
            assert not judgement.beside


@pytest.mark.parametrize("kind", "AB")
def test_another_predictor_than_was_asked_for_proves_nothing(kind):
    problem, recipe = PROBLEMS["every term alive"][0], honest("every term alive", kind)
    free = PROBLEMS["any predictor"][0]
    for g in (problem.predictor_gain * F("1.000001"), F(20)):
        other = replace(recipe, predictor_gain=g, adaptation_rate=F(10) ** 12)
        assert isinstance(check(free, other), Proof)
        assert not isinstance(check(problem, other), Proof)


def lies_beside(kind: str) -> Iterator[Any]:
    """What proves nothing, for any of the reasons that there are."""
    problem, recipe = PROBLEMS["every term alive"][0], honest("every term alive", kind)
    for factor in (F("0.999"), F("0.9"), F(-1)):
        for name in NUMBERS[kind]:
            lie = replace(recipe, **{name: getattr(recipe, name) * factor})
            if not oracle.proves(problem, lie):
                yield lie


@pytest.mark.parametrize("kind", "AB")
def test_of_what_stands_beside_only_what_is_proven_is_kept(kind):
    problem, recipe = PROBLEMS["every term alive"][0], honest("every term alive", kind)
    theorem = theorem_of(KINDS[kind])
    lies = tuple(lies_beside(kind))
    assert len({type(lie) for lie in lies}) == 1
    assert len(lies) >= 8
    named = {f"lie {k}": lie for k, lie in enumerate(lies)} | {"truth": recipe}
    judgement = judge(problem, theorem, Proposal(decisive=recipe, role="asked", beside=named))
    assert judgement.verdict is Verdict.CERTIFIED
    assert set(judgement.beside) == {"truth"}
    for lie in lies:
        judgement = judge(
            problem, theorem, Proposal(decisive=recipe, curve=(recipe, lie), around=(recipe, lie))
        )
        assert set(judgement.curve) <= {recipe}
        for claim, lows in judgement.around.items():
            for other, low in zip(judgement.around_at, lows, strict=True):
                assert low <= oracle.margins(problem, other).get(claim, -inf)
        # and the lie decides: what is true beside it does not help
        judgement = judge(
            problem, theorem, Proposal(decisive=lie, beside={"least_adaptation": recipe}, curve=(recipe,))
        )
        assert judgement.verdict is not Verdict.CERTIFIED
        assert judgement.ultimate_radius is None
        assert judgement.proof is None


@pytest.mark.parametrize("kind", "AB")
def test_a_curve_is_about_the_projection_of_the_gains_that_it_is_printed_with(kind):
    """Points of a curve are printed without a radius: that of the pair is theirs."""
    problem, recipe = PROBLEMS["every term alive"][0], honest("every term alive", kind)
    wide = replace(recipe, projection_radius=recipe.projection_radius * 4)
    told = judge(problem, theorem_of(KINDS[kind]), Proposal(decisive=wide, curve=(recipe,), around=(recipe,)))
    assert told.curve == ()
    assert told.around_at == ()


@pytest.mark.parametrize("kind", "AB")
def test_margins_around_are_about_the_rate_and_the_predictor_that_they_are_printed_with(kind):
    problem, recipe = PROBLEMS["any predictor"][0], honest("any predictor", kind)
    for other in (
        replace(recipe, adaptation_rate=recipe.adaptation_rate * 100),
        replace(
            recipe,
            predictor_gain=recipe.predictor_gain * F("1.001"),
            adaptation_rate=recipe.adaptation_rate * 2,
        ),
    ):
        assert oracle.proves(problem, other)
        told = judge(problem, theorem_of(KINDS[kind]), Proposal(decisive=recipe, around=(recipe, other)))
        assert told.around_at in ((), (recipe,))


@pytest.mark.slow
@pytest.mark.parametrize("kind", "AB")
def test_gains_are_refuted_where_nothing_serves_with_them(kind):
    refuted = 0
    for name in ("every term alive", "a wind, B turns") if kind == "B" else ("every term alive",):
        problem = PROBLEMS[name][0]
        for words, lie in told(honest(name, kind), kind):
            if judge(problem, theorem_of(KINDS[kind]), Proposal(decisive=lie)).verdict is Verdict.REFUTED:
                refuted += 1
                assert oracle.best(problem, lie) <= 0, (name, words)
    assert refuted > 10


@pytest.mark.slow
def test_a_companion_tells_a_radius_where_it_is_a_proof_at_the_same_gains():
    name = "every term alive"
    problem, recipe, theorem = PROBLEMS[name][0], honest(name, "A"), theorem_of(RateRecipe)
    gains = recipe.bandwidth, recipe.adaptation_rate, recipe.predictor_gain
    companion, kept = recipes_at(problem, [gains])[0], 0
    for words, lie in (("the truth", companion), *told(companion, "B")):
        radius = judge(problem, theorem, Proposal(decisive=recipe, companion=lie)).ultimate_radius
        same = all(getattr(lie, name) == getattr(recipe, name) for name in NUMBERS["A"])
        assert (radius is not None) == (same and oracle.proves(problem, lie)), words
        if radius is not None:
            kept += 1
            assert radius >= oracle.claims(problem, lie).radius
    assert kept > 1
    for stranger in (NoGains(), recipe, object(), replace(companion, speed=None)):
        assert judge(problem, theorem, Proposal(decisive=recipe, companion=stranger)).ultimate_radius is None
