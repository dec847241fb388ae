"""Functions of tables as a computer has them: the bound of (H.45) against exact fractions, and recheck's beside it."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from followed import bounds, texts, with_a_table
from tubecert.export import lookups
from tubecert.export.followed import FLOATS, Followed, UncoveredError
from tubecert.export.rounding import _Analysis, rounding_of
from tubecert.export.tables import looked_up
from tubecert.recheck.code import lookups as own
from tubecert.recheck.code.words import UnreadError

from tubecert.enclosure.interval import Interval
from tubecert.expression.lookup import Lookup


def fractions(*texts):
    return tuple(map(Fraction, texts))


BEND = Lookup(
    "bend",
    fractions("-1.1", "-0.3", "-0.1", "0.07", "1.3"),
    fractions("-0.3", "0", "5", "-2", "0.2"),
    fractions("1", "-70", "0", "3", "0.1"),
)


def analysis(precision):
    return _Analysis(with_a_table()[0], FLOATS[precision])


def bound(precision, low, high, error=0.0):
    own = analysis(precision)
    x = Followed(value=Interval(np.array([low]), np.array([high])), error=np.array([error]))
    return float(lookups.followed(BEND, x, own.real, own._rounded).error[0])


@pytest.mark.slow
@pytest.mark.parametrize(("precision", "real"), [("single", np.float32), ("double", np.float64)])
def test_what_a_table_gives_is_within_its_bound(precision, real):
    """At numbers of the type, many of them next to knots as they are and as they are rounded."""
    generator = np.random.default_rng(2)
    near = [real(float(q)) for q in BEND.knots[1:-1]]
    beside = [np.nextafter(x, real(side)) for x in near for side in (-9, 9)]
    x = np.array([*near, *beside, *generator.uniform(-1.09, 1.29, 300)]).astype(real)
    found = [Fraction(float(value)) for value in looked_up(BEND, x, real)]
    off = [abs(a - BEND.at(Fraction(float(b)))) for a, b in zip(found, x, strict=True)]
    whole = bound(precision, -1.09, 1.29)
    assert 0.01 * whole < float(max(off)) <= whole
    for each, value in zip(off[:60], x, strict=False):
        assert float(each) <= bound(precision, float(value), float(value))


def test_an_argument_that_is_off_moves_the_value():
    """By the slope between, also over a knot."""
    whole = bound("double", -0.2, -0.2, error=0.15)
    exact = BEND.at(Fraction("-0.2"))
    worst = max(abs(BEND.at(Fraction("-0.2") + Fraction(k, 100)) - exact) for k in range(-15, 16))
    assert worst <= whole
    assert bound("double", 1.2, 1.2, error=0.2) == np.inf  # beyond the table


def test_knots_that_a_type_cannot_tell_apart_are_not_covered():
    close = Lookup(
        "close", fractions("0", "1", "1.0000001", "2"), fractions(0, 1, 1, 2), fractions(1, 1, 1, 1)
    )
    own, x = analysis("single"), Followed(value=Interval.exact(np.ones(1)), error=np.zeros(1))
    with pytest.raises(UncoveredError, match="knots"):
        lookups.followed(close, x, own.real, own._rounded)
    own = analysis("double")
    assert lookups.followed(close, x, own.real, own._rounded).error < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "single"])
def test_recheck_has_a_bound_of_its_own(precision, monkeypatch):
    """Near to the exporter's; an exporter that takes cubics, or arguments, for exact is noticed."""
    c, formulas = with_a_table()
    found, theirs = bounds(c, formulas, texts(c, precision)), rounding_of(c, precision)
    for name in ("feedback", "input", "estimate"):
        assert 0.05 < found[name] / float(getattr(theirs, name)) < 1.6  # a certificate allows for twice
    whole = lookups.followed
    monkeypatch.setattr(
        "tubecert.export.rounding.looked_up",
        lambda *args: Followed(value=whole(*args).value, error=0 * whole(*args).error),
    )
    less = rounding_of(c, precision)
    assert less.estimate < theirs.estimate
    assert less.feedback < theirs.feedback


@pytest.mark.parametrize(
    "change", [(">= at_bend", "> at_bend"), ("- at_bend[low]", "+ at_bend[low]"), ("k < 3;", "k < 2;")]
)
def test_another_search_is_refused(change):
    c, formulas = with_a_table()
    header, source = texts(c, "double")
    assert change[0] in source
    with pytest.raises(UnreadError, match="another form"):
        bounds(c, formulas, (header, source.replace(*change)))


@pytest.mark.slow
def test_what_a_table_loses_is_in_rechecks_bound(monkeypatch):
    c, formulas = with_a_table()
    whole = bounds(c, formulas, texts(c, "double"))
    made = own._function

    def exactly(code, table, a):
        function = made(code, table, a)
        return lambda x: own.Seen(function(x).value, 0 * function(x).error)

    monkeypatch.setattr(own, "_function", exactly)
    less = bounds(c, formulas, texts(c, "double"))
    assert less["estimate"] < whole["estimate"]
