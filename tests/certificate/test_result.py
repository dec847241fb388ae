"""Certificates as values: read strictly, written again byte for byte."""

import copy
import json

import certificates
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tampers import leaves

from tubecert.certificate.result import Result
from tubecert.claims.advice import PlanRemedy
from tubecert.claims.failures import Failure, Outcome
from tubecert.claims.family import Assumption, Claim, Relax
from tubecert.claims.statements import MetricContraction, TubeInSafeSet
from tubecert.records import FormError, to_json
from tubecert.verdict import Verdict

RESULTS = {
    "certified": certificates.certified(),
    "refuted metric": certificates.refuted_metric(),
    "refuted gains": certificates.refuted_gains(),
    "undecided": certificates.undecided(),
}


def place(value, path):
    for key in path:
        value = value[key]
    return value


PLACES = {name: list(leaves(result)) for name, result in RESULTS.items()}
ANY_PLACE = st.sampled_from([(name, path) for name, found in PLACES.items() for path in found])


@pytest.mark.parametrize("name", RESULTS)
def test_what_is_written_is_what_was_read(name):
    assert to_json(Result.from_json(RESULTS[name])) == RESULTS[name]


def test_values_have_types():
    refuted = Result.from_json(certificates.refuted_metric())
    assert refuted.verdict is Verdict.REFUTED
    assert isinstance(refuted.reason.claim, MetricContraction)
    assert refuted.constants == {}
    certified = Result.from_json(certificates.certified())
    (pair,) = certified.deciding().values()
    assert (float(pair.bandwidth), pair.role) == (41.82, "least_bandwidth")
    assert certified.spec.effective.system.units["angle"] == "rad"


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(
    where=ANY_PLACE, value=st.sampled_from([None, 7, -1.5, True, "text", [], {}, {"a": 1}, [1, 2], "absent"])
)
def test_a_changed_place_is_an_error_that_says_where_or_is_kept(where, value):
    """Nothing is dropped or made up in silence: what is read is written again, or refused."""
    name, path = where
    data = copy.deepcopy(RESULTS[name])
    parent, key = place(data, path[:-1]), path[-1]
    if value == "absent":
        del parent[key]
    else:
        parent[key] = value
    try:
        read = Result.from_json(data)
    except FormError:
        return
    written = to_json(read)
    assert json.dumps(pruned(written), sort_keys=True) == json.dumps(pruned(data), sort_keys=True)


def pruned(value):
    """Without members that are null, empty or false: whether they are written does not change what is said."""
    if isinstance(value, dict):
        inner = {k: pruned(v) for k, v in value.items()}
        return {k: v for k, v in inner.items() if v is not None and v not in ({}, [], False)}
    if isinstance(value, list):
        return [pruned(item) for item in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


@settings(deadline=None, max_examples=80)
@given(where=ANY_PLACE)
def test_a_key_that_is_not_known_is_refused(where):
    name, path = where
    data = copy.deepcopy(RESULTS[name])
    inner = place(data, path)
    free = ("declared", "safe_set", "constants", "half_widths", "margins", "spec", "domain")
    if not isinstance(inner, dict) or path[-1] in free or path[0] == "spec":
        return
    inner["surprise"] = 1
    with pytest.raises(FormError, match="surprise is not known"):
        Result.from_json(data)


def test_a_claim_has_its_own_parameters_and_no_others():
    data = certificates.refuted_metric()
    data["reasons"][0]["state"] = "x1"
    with pytest.raises(FormError, match=r"result\.reasons\[0\]\.state is not known"):
        Result.from_json(data)
    claim = TubeInSafeSet(radius=1, state="x", side="upper", excess=0.1)
    assert to_json(claim)["claim"] == "tube_in_safe_set"


def test_absurd_numbers_are_refused_at_once():
    for value in ("1e999999999", "9" * 4000, "1/0", "nan", "0x10", " 1", 10**400):
        data = certificates.certified()
        data["tube"]["rho"] = value
        with pytest.raises(FormError, match=r"result\.tube\.rho is not a number"):
            Result.from_json(data)
    data = certificates.certified()
    data["tube"]["half_widths"] = {"x": 10**400}
    with pytest.raises(FormError, match=r"result\.tube\.half_widths\.x is not finite"):
        Result.from_json(data)


@pytest.mark.parametrize("kind", [Claim, Relax, Failure, Assumption, Outcome, PlanRemedy])
def test_every_id_has_words_beside_its_fields(kind):
    """Words that stand still, or a sentence of its own; and a claim has what it is called."""
    assert len(kind.family) > 2
    for member in kind.family.values():
        own = {name for name in ("_why", "_told", "of") if name in vars(member)}
        assert own or member.says, member
        if kind is Claim:
            assert "_title" in vars(member) or member.name, member
