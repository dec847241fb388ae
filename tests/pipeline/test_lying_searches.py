"""From what searches hand over to the certificate: lies about 0, A and B are certified where an oracle says so."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import gains_oracle as oracle
import pytest
from lies import KINDS, told, told_twice
from systems import SMALL

from tubecert import certificate
from tubecert.conditions.theorem import Asked, Proposal
from tubecert.kinds.table import kind_of
from tubecert.pipeline import Options, question_of
from tubecert.pipeline.certification import answer, result
from tubecert.recheck.run import recheck
from tubecert.search.proposers import PROPOSERS
from tubecert.spec import load_text
from tubecert.stages.bounded import Bounded
from tubecert.stages.judged import Judged, judge_all
from tubecert.verdict import Verdict

pytestmark = pytest.mark.slow
DECIDING = {"A": "26", "B": "distance"}


def bounded(**options: Any) -> Bounded:
    """A small system, up to its proven constants."""
    found = answer(question_of(load_text(SMALL, "spec.yaml"), Options(gap=Fraction(1, 10), **options)))
    assert isinstance(found, Judged)
    return found.bounded


@pytest.fixture(scope="module", params=DECIDING)
def case(request):
    """A kind that decides, and what its search honestly proposes."""
    made, kind = bounded(conditions=DECIDING[request.param]), request.param
    return kind, made, PROPOSERS[KINDS[kind]].propose(made.problem, Asked(curve=False))


def everywhere(proposal: Proposal[Any], lie: Any) -> Proposal[Any]:
    """One recipe in every place."""
    roles = dict.fromkeys(("pair", "least_adaptation", "split"), lie)
    return replace(proposal, decisive=lie, beside=roles, curve=(lie,), around=(lie,))


def test_what_is_said_of_a_lie_is_what_the_oracle_says(case):
    kind, made, honest = case
    certified = 0
    for words, lie in (*told(honest.decisive, kind), *told_twice(honest.decisive, kind)):
        found = judge_all(made, {KINDS[kind]: everywhere(honest, lie)})
        section, holds = found.sections[kind_of(kind).key], oracle.proves(made.problem, lie)
        assert (found.verdict is Verdict.CERTIFIED) == (section.verdict is Verdict.CERTIFIED) == holds, words
        assert (section.proof is not None) == bool(section.curve) == bool(section.beside) == holds, words
        certified += holds
    assert 0 < certified < 200


def test_what_is_certified_of_a_lie_is_confirmed(case):
    kind, made, honest = case
    lies = [each for _, each in told(honest.decisive, kind) if oracle.proves(made.problem, each)]
    for lie in (lies[0], lies[-1]):
        end = judge_all(made, {KINDS[kind]: replace(honest, decisive=lie, beside={})})
        sealed = certificate.seal(result(end).to_json(), {})
        found = recheck(certificate.dump(sealed), "made")
        assert found.verdict == "confirmed", found.failing


@pytest.mark.parametrize("kind", DECIDING)
def test_other_gains_than_were_asked_for_are_no_answer(kind):
    """Neither those that would serve, nor those that would not."""
    asked = {"bandwidth": Fraction(300), "adaptation_rate": Fraction(10**9)}
    made = bounded(conditions=DECIDING[kind], **asked)
    recipe = (
        PROPOSERS[KINDS[kind]].propose(made.problem, Asked(curve=False, gains=tuple(asked.values()))).decisive
    )
    assert {name: getattr(recipe, name) for name in asked} == asked
    for name, value in asked.items():
        for factor in (Fraction(2), Fraction(1, 10**6)):
            lie = replace(recipe, **{name: value * factor})
            found = judge_all(made, {KINDS[kind]: Proposal(decisive=lie, role="asked")})
            assert found.verdict is Verdict.UNDECIDED, (name, factor)
