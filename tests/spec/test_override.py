"""Keys that are set from outside the file: the same system as the file that says so, and located errors."""

import json
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from texts import ROOT

from tubecert.checking.cache import key_of_system, key_of_text
from tubecert.errors import SpecError
from tubecert.spec import Setting, Spec, canonical, load_text
from tubecert.spec.load import again, load_source
from tubecert.spec.source import Source

TWO = (ROOT / "configs" / "two_state.yaml").read_text(encoding="utf-8")
MINIMAL = (ROOT / "tests/specs/ok/minimal.yaml").read_text(encoding="utf-8")
PARAMETER = MINIMAL.replace("{states", "{parameters: {m: 2, k: m/4}, states")


def read(text: str, *words: str) -> Spec:
    return load_source(Source.of("file.yaml", text), [Setting.of(each) for each in words])


@pytest.mark.parametrize(("words", "old", "new"), [
    (["tube.epsilon=.25"], "epsilon: 0.6", "epsilon: .25"),
    (["tube.epsilon = 1/4 "], "epsilon: 0.6", "epsilon: 1/4"),
    (["initial_state.at[1]=-2"], "[3.4, -2.4]", "[3.4, -2]"),
    (["safe_set.x2=[-7, 8]"], "x2: [-6, 6]", "x2: [-7, 8]"),
    (["system.f[0]=-x1 + 3*x2"], "- -x1 + 2*x2", "- -x1 + 3*x2"),
    (["tube={epsilon: .25, rho_a: 0.1}"], "epsilon: 0.6", "epsilon: .25"),
    (["metric.bounds.lower=.1", "metric.bounds.upper=9"], "rate: 1.74", "bounds: {lower: .1, upper: 9}\n  rate: 1.74"),
    (["conditions.decides=B"], "tube:", "conditions: {decides: B}\ntube:"),
    (["trajectory.Q=[[1, 0], [0, 2]]"], "Q: 0.5", "Q: [[1, 0], [0, 2]]"),
    (["name=other", "trajectory.knots=11"], "name: two_state", "name: other"),
])  # fmt: skip
def test_a_key_that_is_set_is_as_if_the_file_said_so(words: list[str], old: str, new: str) -> None:
    assert TWO.count(old) == 1
    edited = TWO.replace(old, new)
    if "trajectory.knots=11" in words:
        edited = edited.replace("knots: 101", "knots: 11")
    assert canonical(read(TWO, *words)) == canonical(load_text(edited)) != canonical(load_text(TWO))


@pytest.mark.slow
@given(st.fractions(min_value=Fraction(1, 1000), max_value=1000, max_denominator=10**6))
def test_numbers_are_read_exactly(value: Fraction) -> None:
    spec = read(TWO, f"tube.epsilon={value}")
    assert spec.tube.epsilon == value
    assert spec.settings == (("tube.epsilon", str(value)),)


def test_parameters_reach_what_is_made_of_them() -> None:
    spec = read(PARAMETER, "system.parameters.m=0.5")
    assert dict(spec.parameters) == {"m": Fraction(1, 2), "k": Fraction(1, 8)}


@pytest.mark.parametrize(
    ("words", "code", "column", "said"),
    [
        ("tube.epsilom=.3", "TC103", 6, "did you mean epsilon?"),
        ("tubes.epsilon=.3", "TC103", 1, "did you mean tube?"),
        ("system.parameters.mm=3", "TC103", 19, "did you mean m?"),
        ("system.units.x1=m", "TC103", 14, "unknown name x1 in system.units"),
        ("safe_set.x9=[0, 1]", "TC103", 10, "x9"),
        ("tube.epsilon.x=3", "TC103", 14, "tube.epsilon is a value: it has no keys"),
        ("system.f.x=3", "TC103", 10, "number the entries of a list from 0"),
        ("system.f[9]=x1", "TC103", 9, "there is no [9]"),
        ("tube[0]=1", "TC103", 5, "tube is no list"),
        ("initial_state.zz[0]=1", "TC103", 15, "initial_state.zz is not in the file"),
        ("tube.epsilon=-1", "TC112", 14, "it must be > 0"),
        ("tube.epsilon=.3q", "TC108", 14, "lacks a multiplication sign"),
        ("system.f[0]=x + y", "TC110", 17, "y"),
        ("tube=3", "TC106", 6, "tube must be a mapping"),
        ("tube.epsilon=[1]", "TC106", 14, "tube.epsilon must be a number"),
        ("safe_set.x1=[0, *a]", "TC114", 17, "aliases"),
        ("safe_set.x1=[0, 1", "TC101", 18, "close every ["),
        ("tubecert=2", "TC112", 10, "version 2"),
    ],
)
def test_what_does_not_fit_is_located_in_the_option(words: str, code: str, column: int, said: str) -> None:
    text = PARAMETER if words.startswith("system.") else TWO.replace("units:", "")
    with pytest.raises(SpecError) as caught:
        read(text, words)
    (finding,) = caught.value.findings
    path = words.partition("=")[0]
    assert (finding.code, str(finding.location)) == (code, f"--set {path}")
    assert finding.location is not None
    assert finding.location.column == column
    assert said in f"{finding.message} {finding.help}"


@pytest.mark.parametrize(
    "words",
    ["", "x", "=3", "x=", "a b=3", "a..b=3", "a.[0]=3", "a[01]=3", "a[-1]=3", ".a=3", "a=3\nb", "a=\x1b"],
)
def test_what_is_no_setting_is_refused(words: str) -> None:
    with pytest.raises(SpecError) as caught:
        Setting.of(words)
    (finding,) = caught.value.findings
    assert str(finding.location) == "--set"


@pytest.mark.parametrize("other", ["tube.epsilon=.3", "tube={epsilon: 1, rho_a: 1}"])
def test_a_key_is_set_once(other: str) -> None:
    with pytest.raises(SpecError, match="TC104") as caught:
        read(TWO, other, "tube.epsilon=.4")
    assert str(caught.value.findings[0].location) == "--set tube.epsilon"
    assert read(TWO, "tube.epsilon=.4", "tube.rho_a=1").tube.rho_a == 1


def test_other_errors_of_the_file_stay_where_they_are() -> None:
    with pytest.raises(SpecError) as caught:
        read(TWO.replace("rho_a: 0.1", "rho_a: 0"), "tube.epsilon=0")
    places = sorted(str(item.location) for item in caught.value.findings)
    assert places == ["--set tube.epsilon", "file.yaml:39:29"]


def test_the_text_can_be_read_again_with_other_settings() -> None:
    spec = read(TWO, "tube.epsilon=.3")
    assert again(spec, []) is spec
    other = again(spec, [Setting.of("tube.rho_a=.2")])
    assert (other.tube.epsilon, other.tube.rho_a) == (Fraction("0.6"), Fraction("0.2"))


def test_what_checks_have_found_is_not_taken_for_another_setting() -> None:
    plain, changed = load_text(TWO), read(TWO, "tube.epsilon=.3")
    assert plain.source == changed.source
    assert key_of_text("lint", plain) != key_of_text("lint", changed)
    assert key_of_system(plain, Fraction(1), 1) != key_of_system(changed, Fraction(1), 1)
    assert key_of_text("lint", replace(changed, settings=())) == key_of_text("lint", plain)


def test_the_effective_specification_has_it_and_is_a_specification() -> None:
    spec = read(TWO, "tube.epsilon=.3")
    data = canonical(spec)
    assert data["tube"]["epsilon"] == "0.3"
    assert canonical(load_text(json.dumps(data))) == data
