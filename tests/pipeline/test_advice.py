"""What would certify: each piece of advice, taken, certifies; the search is bounded and says what it tried."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import inf

import pytest
from proven import proven
from systems import SMALL
from tubecert.pipeline.levers import nearer_start

from tubecert import certificate, pipeline
from tubecert.claims.advice import EnlargeSafeSet, HalveConstant, NoKnobAlone, ReduceRadii, TurnKnob
from tubecert.pipeline import Options, advice, certify
from tubecert.recheck.certificate import read_certificate
from tubecert.recheck.document import CertificateError, read
from tubecert.spec import Setting, load_text
from tubecert.spec.load import load_source
from tubecert.spec.source import Source
from tubecert.verdict import Verdict
from tubecert.words.advice import advice as words

ONE = """tubecert: 1
name: one
system: {states: [x], inputs: [u], f: [-x], B: [[1]]}
safe_set: {x: [-1, 1]}
uncertainty: {h: [0.1*sin(t) + 0.08*abs(x)]}
trajectory: {kind: equilibrium, at: [0], horizon: 10}
initial_state: {at: [0.05]}
metric: {rate: 0.5, dual_metric: [[1]]}
tube: {epsilon: 0.03, rho_a: 0.1}
conditions: {decides: "0"}
adaptation: {A_m: -1}
"""


def spec_of(*settings):
    last = {each.split("=")[0]: each for each in settings}
    return load_source(Source.of("one.yaml", ONE), [Setting.of(each) for each in last.values()])


def turned(item):
    """The setting that is what the advice says, on top of the others."""
    value = float(item.value)
    match item.knob:
        case "epsilon" | "rho_a":
            return f"tube.{item.knob}={value}"
        case "rate":
            return f"metric.rate={value}"
        case "start":
            return f"initial_state.at=[{0.05 * value}]"
    part = {"0.1*sin(t)": (value, 1), "0.08*abs(x)": (1, value), None: (value, value)}[item.term]
    return f"uncertainty.h=[{0.1 * part[0]}*sin(t) + {0.08 * part[1]}*abs(x)]"


def advised(*settings, **options):
    """The advice, and the settings it is about."""
    result = certify(spec_of(*settings), Options(**options), advise=True)
    return result.reason.relax


@pytest.mark.slow
def test_what_is_advised_certifies_and_much_less_does_not():
    settings = ("metric.rate=0.45",)
    found = [item for item in advised(*settings) if isinstance(item, TurnKnob)]
    assert {item.knob for item in found} >= {"uncertainty", "rate"}
    for item in found:
        assert certify(spec_of(*settings, turned(item)), Options()).verdict is Verdict.CERTIFIED
        if item.knob == "uncertainty":
            nearer = item.value + (item.now - item.value) * Fraction(1, 2)
            less = TurnKnob(knob=item.knob, now=item.now, value=nearer, input=item.input, term=item.term)
            assert certify(spec_of(*settings, turned(less)), Options()).verdict is not Verdict.CERTIFIED


@pytest.mark.slow
def test_where_nothing_serves_alone_two_are_named_that_do():
    settings = ("uncertainty.h=[2*sin(t)]", "metric.rate=1")
    (item,) = advised(*settings)
    assert isinstance(item, NoKnobAlone)
    assert "uncertainty" in item.tried
    assert "epsilon" in item.tried
    both = (f"uncertainty.h=[{2 * float(item.uncertainty)}*sin(t)]", f"tube.epsilon={float(item.epsilon)}")
    for some, verdict in (
        (both, Verdict.CERTIFIED),
        (both[:1], Verdict.REFUTED),
        (both[1:], Verdict.REFUTED),
    ):
        assert certify(spec_of(*settings, *some), Options()).verdict is verdict


@pytest.mark.slow
def test_a_start_outside_of_the_tube_is_told_how_near_it_may_be_and_how_wide_the_tube():
    """All the effort went into less of h and narrower tubes: `nothing that was tried serves alone`."""
    spec = load_text(SMALL.replace("{epsilon: 0.2, rho_a: 0.1}", "{half_widths: {x: 0.06}}"))
    far = replace(spec, x0=(Fraction(7, 100), Fraction(0)))
    result = certify(far, Options(conditions="distance"), advise=True)
    assert result.verdict is Verdict.REFUTED
    knobs = {item.knob: item.value for item in result.reason.relax if isinstance(item, TurnKnob)}
    assert list(knobs) == ["start", "half_widths"]
    assert knobs["start"] < 1 < knobs["half_widths"]


@pytest.mark.parametrize("share", [1.5, 9.85, 1234.5, inf])
def test_a_start_that_is_far_outside_is_tried_where_the_tube_begins(share):
    """Half the way and the plan itself were tried: `start where the plan starts`."""
    spec = load_text(SMALL)
    for start, further in (
        ({}, Fraction(0)),
        ({"start_box": ((Fraction(0), Fraction(1)),) * 2}, Fraction(1, 10)),
    ):
        (lever,) = nearer_start(replace(spec, **start), [0.0, 0.0], share)
        if share in (1.5, inf):
            assert lever.tries == (Fraction(1, 2), further)
        else:
            assert 0.85 < lever.tries[0] * share <= 0.9
            assert lever.tries[1:] in ((further,), ())


@pytest.mark.slow
def test_a_tube_that_does_not_fit_is_told_how_small_it_may_be():
    far = "initial_state.at=[0.9]"
    found = advised(far, "tube.epsilon=0.2", "uncertainty.h=[0.01*sin(t)]")
    assert [item.knob for item in found if isinstance(item, TurnKnob)] == ["start"]
    assert EnlargeSafeSet() in found
    assert ReduceRadii() not in found


@pytest.mark.slow
def test_the_search_is_bounded_by_what_the_verdict_cost(monkeypatch):
    monkeypatch.setattr(advice, "_CHEAP", 0)
    monkeypatch.setattr(advice, "_EXPLAINED", 0)
    spent = []

    def watched(result, end, ledger, *rest):
        spent.append(ledger.work)
        found = advice.advised(result, end, ledger, *rest)
        spent.append(ledger.work - spent[0])
        return found

    monkeypatch.setattr(pipeline, "advised", watched)
    after = certify(spec_of(), Options(), advise=True)
    assert spent[0] <= spent[1] <= 2 * spent[0]  # it ends with the search that exceeds it
    assert after.verdict is Verdict.REFUTED
    assert len(after.reason.relax) <= 1


@pytest.mark.slow
def test_the_verdict_is_told_before_advice_is_looked_for(monkeypatch):
    heard = []
    monkeypatch.setattr(advice._Search, "run", lambda self: heard.append("advice") or iter(()))
    for settings in ((), ("uncertainty.h=[0.001]",), ("metric.dual_metric=[[-1]]",)):
        certify(spec_of(*settings), Options(), advise=True, told=lambda result: heard.append(result.verdict))
    assert heard == [Verdict.REFUTED, "advice"]


@pytest.mark.slow
def test_who_does_not_ask_for_advice_gets_none():
    assert proven(ONE)["result"]["reasons"][0].get("relax", []) == []


@pytest.mark.slow
def test_recheck_knows_each_knob():
    data = proven(ONE)
    (reason,) = [item for item in data["result"]["reasons"] if item["claim"] == "condition_holds"]
    for relax, known in (
        ({"id": "turn_knob", "knob": "epsilon", "now": 1, "value": 0.5}, True),
        ({"id": "turn_knob", "knob": "luck", "now": 1, "value": 0.5}, False),
        ({"id": "no_knob_alone", "tried": ["epsilon", "rate"], "uncertainty": 0.5}, True),
        ({"id": "no_knob_alone", "tried": "epsilon"}, False),
    ):
        reason["relax"] = [relax]
        text = certificate.dump(certificate.seal(data["result"], {}))
        if known:
            read_certificate(read(text, "c.json"))
        else:
            with pytest.raises(CertificateError):
                read_certificate(read(text, "c.json"))


def test_words():
    terms = TurnKnob(knob="uncertainty", now=Fraction(1), value=Fraction(1, 2), input="u", term="0.1*sin(t)")
    epsilon = TurnKnob(knob="epsilon", now=Fraction(3, 10), value=Fraction(1, 5))
    assert words([epsilon]) == "this is proven to serve: epsilon 0.2 in place of 0.3"
    assert words([epsilon, terms, EnlargeSafeSet()]) == (
        "each of these alone is proven to serve: epsilon 0.2 in place of 0.3; or 0.1*sin(t) in the h of u at 50 % of "
        "its size; enlarge the safe set"
    )
    alone = NoKnobAlone(tried=("epsilon",), half_widths=Fraction(1, 2), uncertainty=Fraction(1, 10))
    assert words([alone]) == (
        "nothing that was tried serves alone (epsilon); together these are proven to serve: all half-widths at 50 % "
        "and all of h at 10 % of its size"
    )


def test_the_users_own_h_is_named_beside_the_constant_that_bounds_it():
    """Once: reports said `halving Dh (sup |h|)`, which no user has written."""
    items = [HalveConstant(constant=name, factor=0.5) for name in ("M_x", "h", "h_t")]
    told = words(items, ["0.1*sin(t)"])
    assert "DMx (sup of the sum of |dM/dx_i|) would" in told
    assert "halving Dh (sup |h|, h = 0.1*sin(t)) would lower the least Gamma by 50 %" in told
    assert told.count("sin(t)") == 1
    assert "h = [a, b])" in words(items[1:], ["a", "b"])
    assert "h = " not in words(items)
    assert f"h = {'1 + ' * 15} ...)" in words(items, ["1 + " * 40])
