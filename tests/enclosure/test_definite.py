"""Positive definite, by a Cholesky factorisation in floats: against exact pivots, and with its shift taken away."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tubecert.enclosure import linalg
from tubecert.enclosure.linalg import exceeds

SEEDS = st.integers(0, 2**32 - 1)
QUICK = settings(max_examples=25, deadline=None)
ETA = 2.0**-1074


def is_above(s, least):
    """Whether S > least I for the lower half of S, by pivots in exact arithmetic."""
    n = len(s)
    left = [[Fraction(float(s[max(i, j), min(i, j)])) for j in range(n)] for i in range(n)]
    for i in range(n):
        left[i][i] -= Fraction(float(least))
    for j in range(n):
        if left[j][j] <= 0:
            return False
        for i in range(j + 1, n):
            share = left[i][j] / left[j][j]
            left[i] = [a - share * b for a, b in zip(left[i], left[j], strict=True)]
    return True


def singular(rng, n):
    """A matrix of whole numbers, positive semidefinite with 0 for an eigenvalue, exactly."""
    g = rng.integers(-999, 1000, (n - 1, n)).astype(float)
    return g.T @ g


def below_zero(rng, n):
    """The same, and one diagonal entry less by one unit in its last place: indefinite, or as good as that."""
    s = singular(rng, n)
    k = rng.integers(n)
    s[k, k] = np.nextafter(s[k, k], -np.inf)
    return s


def subnormal(rng, n):
    """The same of a few of the least floats, where every product is rounded to a whole number of them."""
    while True:
        g, more = rng.integers(-2, 3, (n, n)), rng.integers(-1, 2, (n, n))
        s = (g.T @ g + more + more.T) * ETA
        if not is_above(s, 0.0):
            return s


def accepted(make, count=300):
    """How many of such matrices, none of which is positive definite, are said to be."""
    rng = np.random.default_rng(7)
    return sum(bool(exceeds(make(rng, int(rng.integers(2, 6))), np.zeros(()))) for _ in range(count))


@pytest.mark.parametrize("make", [singular, below_zero, subnormal])
def test_no_matrix_that_is_slightly_indefinite_is_accepted(make):
    rng = np.random.default_rng(7)
    assert not any(is_above(make(rng, n), 0.0) for n in (2, 3, 4, 5) for _ in range(5))
    assert not accepted(make)


@given(seed=SEEDS, n=st.integers(1, 6), kind=st.sampled_from(["plain", "graded", "tiny", "huge"]))
@QUICK
def test_what_is_accepted_is_above(seed, n, kind):
    """Matrices whose least eigenvalue is a few roundings from `least`, of all sizes and on both sides."""
    rng = np.random.default_rng(seed)
    q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    least, scale = rng.choice([0.0, 0.125, 3.0]), {"tiny": 1e-160, "huge": 1e150}.get(kind, 1.0)
    values = np.concatenate([[rng.normal() * 1e-15], rng.uniform(0, 2, n - 1)]) + least
    s = q @ np.diag(values) @ q.T * scale
    if kind == "graded":
        grade = 2.0 ** -rng.integers(0, 30, n)
        s, least = grade[:, None] * s * grade, 0.0
    if exceeds(s, np.array(least * scale)):
        assert is_above(s, least * scale)


@given(seed=SEEDS, n=st.integers(1, 9))
@QUICK
def test_little_more_than_the_shift_suffices(seed, n):
    rng = np.random.default_rng(seed)
    s = singular(rng, n) if n > 1 else np.zeros((1, 1))
    c = linalg._gamma(n + 1) * np.trace(s) + 1.0
    assert exceeds(s + 3 * c * np.eye(n), np.array(c))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_entries_that_are_no_numbers_are_not_accepted(bad):
    for n in (1, 2, 4):
        for i in range(n):
            for j in range(i + 1):
                s = 100 * np.eye(n)
                s[i, j] = bad
                assert not exceeds(s, np.zeros(()))
        assert not exceeds(np.eye(n), np.array(bad if bad > 0 else np.nan))


def test_only_what_is_below_the_diagonal_is_read():
    s = np.array([[2.0, np.nan], [1.0, 2.0]])
    assert exceeds(s, np.array(0.5))
    assert not exceeds(s.T, np.array(0.5))


def test_a_trace_beyond_all_floats_and_a_row_that_it_drowns():
    assert not exceeds(np.diag([1.5e308, 1.5e308]), np.zeros(()))
    assert not exceeds(np.diag([1e300, -1e-300]), np.zeros(()))
    assert exceeds(np.diag([1e300, 1e290]), np.zeros(()))
    assert not exceeds(np.array([[1e-300, 1e10], [1e10, 1e300]]), np.zeros(()))  # its root overflows


def test_every_matrix_of_a_batch_has_its_own_answer():
    rng = np.random.default_rng(3)
    count = 2 * linalg._LANES + 3
    shift = rng.uniform(-1, 1, (count, 2))
    s = np.eye(3) * shift[..., None, None]
    assert np.array_equal(exceeds(s, np.zeros(())), shift > 0)
    assert np.array_equal(
        exceeds(s + 2 * np.eye(3), np.broadcast_to([1.5, 2.5], (count, 2))), shift > [-0.5, 0.5]
    )


def test_traps_are_not_sprung():
    with np.errstate(all="raise"):
        assert not exceeds(np.array([[1.0, 2.0], [2.0, 1.0]]), np.zeros(()))
        assert not exceeds(np.array([[1e-320, 1e-310], [1e-310, 1e300]]), np.zeros(()))
