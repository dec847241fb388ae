"""Definitions: a name for an expression, which stands for it everywhere, what it owes included."""

import time
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given, settings
from strategies import texts

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError
from tubecert.expression import full_text
from tubecert.model import domain_findings
from tubecert.spec import canonical, load, load_text

OK = Path(__file__).parents[1] / "specs/ok/definitions.yaml"
FILE = """
tubecert: 1
name: small
system:
  states: [x, y]
  inputs: [u]
  parameters: {{k: 2}}
  definitions: {definitions}
  f: ["{f}", "-y"]
  B: [[0], [1]]
safe_set: {{x: [-1, 1], y: [-1, 1]}}
uncertainty: {{h: ["{h}"]}}
trajectory: {{kind: equilibrium, at: [0, 0]}}
"""


def spec(definitions: str = "{}", f: str = "-x", h: str = "0.1*sin(t)"):  # type: ignore[no-untyped-def]
    return load_text(FILE.format(definitions=definitions, f=f, h=h))


def written_out(text: str) -> str:
    for name, meant in (
        ("push", "(0.1*sin(t)*abs(v))"),
        ("lean", "(1 + 0.001*cos(p))"),
        ("wave", "(0.05*sin(2*t))"),
        ("*d)", "*(1 + m*sin(p)**2))"),
        ("/d]", "/(1 + m*sin(p)**2)]"),
        ("-s/", "-sin(p)/"),
        ("0.1*s]", "0.1*sin(p)]"),
    ):
        assert name in text
        text = text.replace(name, meant)
    return text


def test_the_canonical_form_knows_no_definitions() -> None:
    """Written out by hand it is the same system, with the same hash."""
    text = OK.read_text(encoding="utf-8")
    head, tail = text.split("  definitions:\n")
    plain = head + written_out(tail[tail.index("  f:") :])
    assert canonical(load_text(plain)) == canonical(load(str(OK)))
    assert load_text(text.replace("wave", "path").replace("lean", "tilt")).f == load_text(text).f


def test_a_definition_owes_what_its_expression_owes_also_where_it_cancels() -> None:
    """1/d with d zero in the safe set: refuted where it is used, though 0*r is 0."""
    found = spec("{d: x - 1/2, r: 1/d}", "-x + 0*r")
    assert full_text(found.f[0].expression, found.f[0].obligations) == "-x + 0/(x - 0.5)"
    (finding,) = domain_findings(found, None, Effort())
    assert (finding.code, finding.message.split()[0]) == ("TC201", "'1/d'")
    assert finding.location is not None
    assert (finding.location.line, finding.location.column) == (9, 15)
    assert domain_findings(spec("{d: x - 1/2, r: 1/d}"), None, Effort()) == []


def test_what_a_definition_owes_at_times_keeps_it_out_of_f() -> None:
    """0/(t - 3) is 0, and owes that t is not 3: of no use on the safe set."""
    for defined, code in (("0/(t - 3)", "TC112.*horizon"), ("0/(1 + abs(x))", "TC110")):
        with pytest.raises(SpecError, match=code):
            spec(f"{{z: {defined}}}", "-x + z")
    assert spec("{z: 0/(t - 3)}", h="z").uncertainty.h


@pytest.mark.slow
def test_definitions_do_not_hide_a_text_without_end() -> None:
    """Forty doublings would be 10^12 characters: refused before they are written."""
    chain = "".join(f", a{k}: sin(a{k - 1})*(1 + a{k - 1})" for k in range(1, 40))
    begin = time.perf_counter()
    with pytest.raises(SpecError, match="definitions written out"):
        spec(f'{{"a0": x{chain}}}', "a39")
    assert time.perf_counter() - begin < 2


@given(first=texts(leaves=5), second=texts(leaves=4))
@settings(max_examples=40, deadline=None)
@pytest.mark.slow
def test_a_definition_is_what_it_stands_for(first: str, second: str) -> None:
    named = spec(f'{{"a": "{first}", "b": "{second}"}}', h="a*b + a")
    plain = spec(h=f"({first})*({second}) + ({first})")
    assert canonical(named) == canonical(plain)


def test_definitions_may_use_parameters_and_those_before_them() -> None:
    found = spec("{a: k*x, b: a**2}", "-x + b")
    assert str(found.f[0].expression) == "4*x**2 - x"
    assert found.definitions == ("a", "b")
    assert found.parameters == (("k", Fraction(2)),)
