"""Ranges of keys: what they stand for, and what is refused."""

import math
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tubecert.errors import SpecError
from tubecert.sweep.grid import MOST, Axis, points

NUMBERS = st.fractions(min_value=Fraction(1, 100), max_value=100, max_denominator=1000)


@pytest.mark.parametrize(
    ("words", "texts"),
    [
        ("tube.epsilon=.1:.6:6", (".1", "0.2", "0.3", "0.4", "0.5", ".6")),
        ("a= 1 : 0 : 3 ", ("1", "0.5", "0")),
        ("a=0:1:4", ("0", "0.333333", "0.666667", "1")),
        ("a=1/3:2/3:3", ("1/3", "0.5", "2/3")),
        ("a=1e2:1e4:log3", ("1e2", "1000", "1e4")),
        ("hardware.rate=100:2000:log5", ("100", "211.5", "447.2", "945.7", "2000")),
        ("a=3,1,2", ("3", "1", "2")),
        ("conditions.decides=A, B", ("A", "B")),
        ("a=-1:1:2", ("-1", "1")),
    ],
)
def test_the_values_of_a_range(words, texts):
    assert Axis.of(words).texts == texts


@pytest.mark.slow
@given(NUMBERS, NUMBERS, st.integers(2, 40), st.booleans())
def test_a_range_goes_from_end_to_end_in_equal_steps_or_factors(first, last, count, log):
    if first == last:
        return
    try:
        axis = Axis.of(f"a={first}:{last}:{'log' if log else ''}{count}")
    except SpecError:
        apart = abs(math.log(last / first)) if log else float(abs(last - first) / max(first, last))
        assert apart / (count - 1) < (1e-3 if log else 1e-5), "closer than the digits that are written"
        return
    assert (axis.texts[0], axis.texts[-1], len(axis.texts)) == (str(first), str(last), count)
    values = axis.numbers
    for i, value in enumerate(values):
        share = i / (count - 1)
        steps = float(first + (last - first) * Fraction(i, count - 1))
        wanted = float(first) ** (1 - share) * float(last) ** share if log else steps
        assert value == pytest.approx(wanted, rel=1e-3 if log else 1e-5)
    assert all((a < b) == (first < last) for a, b in pairwise(values))


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("a=.1-.6", "TC112", "is one value, not a range"),
        ("a=0.1..0.6", "TC112", "is one value, not a range"),
        ("a=1:2", "TC112", "is no range"),
        ("a=1:2:x", "TC112", "is no range"),
        ("a=1:2:3:4", "TC112", "is no range"),
        ("a=1:2:1", "TC112", "2 to 100,000 values"),
        ("a=1:1:3", "TC112", "are equal"),
        ("a=0:1:log3", "TC112", "are positive"),
        ("a=1:2x:3", "TC108", "an end of the range is no number"),
        ("a=1,,2", "TC112", "is empty or occurs twice"),
        ("a=1,1", "TC112", "is empty or occurs twice"),
        ("a=1:1.0000000000001:9", "TC112", "are not apart"),
        ("a=22489/225:83659/837:4", "TC112", "are not apart"),  # 99.9511 would come after 99.9510...
    ],
)
def test_what_is_no_range_is_refused_in_the_option(words, code, said):
    with pytest.raises(SpecError) as caught:
        Axis.of(words)
    (finding,) = caught.value.findings
    assert (finding.code, str(finding.location)) == (code, f"--over {words.partition('=')[0]}")
    assert said in finding.message


def test_the_last_key_changes_first():
    found = points([Axis.of("a=1,2"), Axis.of("b.c=x,y,z")])
    assert [" ".join(map(str, each)) for each in found] == [
        f"a={a} b.c={b}" for a in ("1", "2") for b in ("x", "y", "z")
    ]


@pytest.mark.slow
def test_keys_that_meet_and_grids_without_end_are_refused():
    with pytest.raises(SpecError, match="a has a range already"):
        points([Axis.of("a=1,2"), Axis.of("a.b=1,2")])
    with pytest.raises(SpecError, match="may have 100,000"):
        points([Axis.of("a=0:1:400"), Axis.of("b=0:1:400")])
    assert MOST > 300 * 300
    assert len(points([Axis.of("a=0:1:300"), Axis.of("b=0:1:300")])) == 300 * 300
