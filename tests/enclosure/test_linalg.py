"""Eigenvalues, singular values and quadratic forms against ball arithmetic, and with a LAPACK that lies."""

from fractions import Fraction

import balls as ball_arithmetic
import numpy as np
import pytest
from flint import arb, arb_mat
from hypothesis import given, settings
from hypothesis import strategies as st

from tubecert.enclosure import linalg
from tubecert.enclosure.interval import Interval
from tubecert.enclosure.linalg import (
    congruence,
    eigenvalues_midrad,
    midrad,
    norm_bound,
    product,
    quadratic_form,
    spectral_norm,
    spectral_norm_midrad,
    whitening,
)

SEEDS = st.integers(0, 2**32 - 1)
QUICK = settings(max_examples=25, deadline=None)
EIGH, SVD = np.linalg.eigh, np.linalg.svd


precision = ball_arithmetic.precision(300, quiet=True)


def balls(m):
    return arb_mat([[arb(float(x)) for x in row] for row in m])


def covers(exact, mid, rad):
    places = np.ndindex(mid.shape)
    return all(abs(exact[i, j] - arb(float(mid[i, j]))) <= arb(float(rad[i, j])) for i, j in places)


def exact_eigenvalues(m):
    """Ascending balls (the exact matrix must have separated eigenvalues, or be judged by `inertia`)."""
    power = -int(np.frexp(np.abs(m).max())[1])
    found = (balls(m) * arb(2) ** power).eig(multiple=True)  # of size 1, or the eigenvalues are not isolated
    return sorted((v.real * arb(2) ** -power for v in found), key=lambda v: float(v.mid()))


def exact_norm(m):
    power = -int(np.frexp(np.abs(m).max())[1])
    b = balls(m) * arb(2) ** power
    gram = b * b.transpose() if len(m) <= len(m[0]) else b.transpose() * b
    values = [v.real for v in gram.eig(multiple=True)]
    return max(values, key=lambda v: float(v.mid())).sqrt() * arb(2) ** -power


def eigenvalues(s):
    return eigenvalues_midrad(*midrad(s))


def holds(ball, lo, hi):
    """Whether the number in the ball may lie in [lo, hi]; false proves that it does not."""
    return not (ball < arb(float(lo))) and not (ball > arb(float(hi)))


def symmetric(seed, kind, n):
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((n, n))
    m = a + a.T
    if kind == "graded":
        scale = 10.0 ** -np.arange(0, 3 * n, 3)
        m = scale[:, None] * m * scale
    elif kind == "close":
        q, _ = np.linalg.qr(a)
        m = q @ np.diag(1 + 1e-13 * np.arange(n)) @ q.T
        m = (m + m.T) / 2
    elif kind == "tiny":
        m = m * 1e-200
    elif kind == "huge":
        m = m * 1e140
    elif kind == "singular":
        m = np.outer(a[0], a[0])
    return m


KINDS = ("plain", "graded", "close", "tiny", "huge", "singular")


@pytest.mark.parametrize("kind", KINDS)
@given(seed=SEEDS, n=st.integers(2, 5))
@QUICK
def test_eigenvalues_are_enclosed(kind, seed, n):
    m = symmetric(seed, kind, n)
    found = eigenvalues(Interval.exact(m[None]))
    size = np.abs(m).max()
    for k, value in enumerate(exact_eigenvalues(m)):
        assert holds(value, found.lo[0, k], found.hi[0, k])
    assert np.all(found.hi - found.lo <= 1e-12 * size + 1e-140)


@given(seed=SEEDS, n=st.integers(1, 4), width=st.sampled_from([0.0, 1e-12, 1e-3, 0.5]))
@QUICK
def test_members_of_an_interval_matrix_have_enclosed_eigenvalues(seed, n, width):
    rng = np.random.default_rng(seed)
    mid = symmetric(seed, "plain", n)
    rad = width * np.abs(symmetric(seed + 1, "plain", n))
    found = eigenvalues_midrad(mid[None], rad[None])
    for _ in range(4):
        # corners of the interval matrix, moved inward so that rounding keeps them in it
        move = np.sign(rng.standard_normal((n, n)))
        member = mid + np.triu(move, 1) * rad * 0.999 + np.triu(move).T * rad * 0.999
        member = np.tril(member) + np.tril(member, -1).T
        for k, value in enumerate(exact_eigenvalues(member)):
            assert holds(value, found.lo[0, k], found.hi[0, k])


@pytest.mark.parametrize("kind", ["plain", "graded", "tiny", "huge", "singular"])
@given(seed=SEEDS, p=st.integers(1, 4), q=st.integers(1, 4))
@QUICK
def test_spectral_norms_are_enclosed(kind, seed, p, q):
    n = max(p, q)
    m = symmetric(seed, kind, n)[:p, :q] if n > 1 else np.random.default_rng(seed).standard_normal((1, 1))
    if kind in ("tiny", "huge"):
        m = m * (1e60 if kind == "tiny" else 1e-60)  # squares must not leave the range of their sum
    found = spectral_norm(Interval.exact(m[None]))
    assert holds(exact_norm(m), found.lo[0], found.hi[0])
    assert found.hi[0] - found.lo[0] <= 1e-11 * np.abs(m).max() + 1e-140


@given(seed=SEEDS, p=st.integers(1, 4), q=st.integers(1, 4))
@QUICK
def test_norm_bound_holds_for_every_member(seed, p, q):
    rng = np.random.default_rng(seed)
    m = np.abs(rng.standard_normal((p, q))) * 10.0 ** rng.uniform(-5, 5, (p, q))
    bound = norm_bound(m)
    for _ in range(5):
        member = m * rng.choice([-1.0, 1.0], (p, q))
        assert np.linalg.norm(member, 2) <= bound * (1 + 1e-12)
    assert bound >= np.abs(m).max()


def congruence_holds(t, s):
    return covers(balls(t) * balls(s) * balls(t).transpose(), *congruence(t, s, np.zeros_like(s)))


def form_holds(v, s):
    form, column = quadratic_form(v[None], s[None], np.zeros_like(s)[None]), balls(v[:, None])
    return holds((column.transpose() * balls(s) * column)[0, 0], form.lo[0], form.hi[0])


@given(seed=SEEDS, n=st.integers(2, 4), scale=st.sampled_from([1.0, 1e-140, 1e140]))
@QUICK
def test_congruence_and_quadratic_form_contain_the_exact_ones(seed, n, scale):
    rng = np.random.default_rng(seed)
    t, s, v = rng.standard_normal((n, n)), symmetric(seed, "plain", n) * scale, rng.standard_normal(n)
    assert congruence_holds(t, s)
    assert form_holds(v, s)


@given(seed=SEEDS, p=st.integers(1, 3), q=st.integers(1, 3), r=st.integers(1, 3))
@QUICK
def test_product_contains_products_of_members(seed, p, q, r):
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((p, q)), rng.standard_normal((q, r))
    ra, rb = np.abs(rng.standard_normal((p, q))) * 0.1, np.abs(rng.standard_normal((q, r))) * 0.1
    mid, rad = product((a, ra), (b, rb))
    for _ in range(4):
        one = a + ra * rng.choice([-0.999, 0.999], (p, q))
        two = b + rb * rng.choice([-0.999, 0.999], (q, r))
        assert covers(balls(one) * balls(two), mid, rad)


def test_congruence_and_quadratic_form_of_what_is_huge_cover_underflow():
    # products t_ik s_kj that underflow are multiplied by the large entries of t afterwards
    t = np.array([[1e-160, 0.0], [0.0, 1e160]])
    s = np.array([[1.0, 1e-170], [1e-170, 1e-320]])
    assert congruence_holds(t, s)
    assert form_holds(np.array([1e-160, 1e160]), np.array([[1.0, 3e-170], [3e-170, 1.3e-322]]))


@given(seed=SEEDS, n=st.integers(2, 4))
@QUICK
def test_midrad_covers_its_interval(seed, n):
    rng = np.random.default_rng(seed)
    lo = rng.standard_normal(n) * 10.0 ** rng.integers(-300, 300, n)
    hi = lo + np.abs(rng.standard_normal(n)) * 10.0 ** rng.integers(-300, 300, n)
    mid, rad = midrad(Interval(lo, hi))
    for low, high, m, r in zip(lo, hi, mid, rad, strict=True):
        assert Fraction(m) - Fraction(r) <= Fraction(low)
        assert Fraction(m) + Fraction(r) >= Fraction(high)


@pytest.mark.parametrize(("lo", "hi"), [(1 + 2.0**-52, 1 + 2.0**-51), (1.0, 1 + 2.0**-52)])
def test_a_midpoint_that_is_rounded_to_an_end_is_as_far_from_the_other(lo, hi):
    """No float lies between them: the middle is one of both, the upper or the lower one."""
    mid, rad = midrad(Interval(np.array([lo]), np.array([hi])))
    assert mid[0] in (lo, hi)
    assert Fraction(mid[0]) - Fraction(rad[0]) <= Fraction(lo)
    assert Fraction(mid[0]) + Fraction(rad[0]) >= Fraction(hi)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_unknown_entries_leave_eigenvalues_and_norms_unbounded(bad):
    m = np.eye(3)[None].repeat(2, axis=0)
    m[1, 0, 1] = m[1, 1, 0] = bad
    for found in (eigenvalues(Interval.exact(m)), eigenvalues(Interval.exact(np.full((1, 1, 1), bad)))):
        assert np.all(found.hi[-1] == np.inf)
        assert np.all(found.lo[-1] == -np.inf)
    norms = spectral_norm(Interval.exact(m))
    assert norms.hi[0] < 1.01
    assert norms.hi[1] == np.inf
    assert norms.lo[1] == 0


def test_squares_that_overflow_leave_nothing_known_but_nothing_false():
    m = 1e200 * np.array([[[1.0, 0.5], [0.5, 2.0]]])
    found = eigenvalues(Interval.exact(m))
    assert np.all(found.lo <= 1e200)
    assert np.all(found.hi >= 2e200)
    column = spectral_norm(Interval.exact(m[:, :, :1]))
    assert column.lo[0] <= 1.1e200
    assert column.hi[0] >= 1.1e200


@pytest.mark.parametrize("scales", [(1e-9, 1, 1e9), (1e12, 1e-6, 3)])
def test_whitening_does_not_depend_on_units(scales):
    """Where these are far apart, the smallest eigenvalue is lost in the rounding errors of the largest."""
    plain = np.array([[2, 0.9, 0.3], [0.9, 1, -0.4], [0.3, -0.4, 1.5]])
    units = np.array(scales)
    s = plain * units * units[:, None]
    t = whitening(s[None])[0]
    assert np.abs(t @ s @ t.T - np.eye(3)).max() < 1e-12


def test_whitening_turns_a_matrix_into_nearly_the_identity_or_gives_up():
    s = symmetric(3, "plain", 3)
    s = s @ s.T + np.eye(3)
    t = whitening(s[None])[0]
    assert np.allclose(t @ s @ t.T, np.eye(3), atol=1e-12)
    for hopeless in (-s, np.full((3, 3), np.nan), np.zeros((3, 3))):
        assert np.array_equal(whitening(hopeless[None])[0], np.eye(3))


def lies(honest, rng):
    """Wrong answers of an eigenvalue or singular value routine: tuples of arrays."""
    vectors = [k for k, part in enumerate(honest) if part.ndim == 3]
    values = next(k for k, part in enumerate(honest) if part.ndim == 2)

    def changed(k, new):
        return tuple(new if i == k else part for i, part in enumerate(honest))

    order = np.arange(honest[values].shape[-1])[::-1]
    swapped = list(honest)
    swapped[values] = honest[values][..., order]
    for k in vectors:
        across = k == 2  # v' has its vectors as rows
        swapped[k] = honest[k][..., order, :] if across else honest[k][..., order]
    yield tuple(swapped)  # right in every pair, but not sorted
    yield changed(values, -honest[values])
    yield changed(values, honest[values] * (1 + 1e-3))
    yield changed(values, honest[values] + 0.1)
    yield changed(values, np.full_like(honest[values], np.nan))
    yield changed(values, np.full_like(honest[values], np.inf))
    yield changed(values, np.zeros_like(honest[values]))
    for k in vectors:
        # vectors of another length, and values such that their product is the matrix
        for c in (1.1, 1 / 1.1, 2.0):
            long = list(changed(k, honest[k] * c))
            long[values] = honest[values] / (c if len(vectors) == 2 else c**2)
            yield tuple(long)
        yield changed(k, honest[k] * (1 + 1e-6))
        yield changed(k, honest[k] + 1e-4 * rng.standard_normal(honest[k].shape))
        yield changed(k, rng.standard_normal(honest[k].shape))
        yield changed(k, np.zeros_like(honest[k]))
        yield changed(k, np.full_like(honest[k], np.nan))
        yield changed(k, -honest[k])
    signs = list(honest)  # a factorisation of the same matrix with negative singular values
    if len(honest) == 3:
        signs[1], signs[0] = -honest[1], -honest[0]
        yield tuple(signs)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", ["eigh", "svd"])
def test_a_lying_routine_never_yields_a_false_enclosure(name, seed, monkeypatch):
    rng = np.random.default_rng(seed)
    if name == "eigh":
        m = symmetric(seed, "plain", 3)[None]
        exact, bound, honest = exact_eigenvalues(m[0]), eigenvalues, EIGH(m)
    else:
        m = rng.standard_normal((1, 3, 2))
        exact, bound, honest = [exact_norm(m[0])], spectral_norm, SVD(m, full_matrices=False)
    answers = [*lies(tuple(honest), rng)]
    assert len(answers) >= 12
    for answer in answers:
        monkeypatch.setattr(np.linalg, name, lambda *_, answer=answer, **__: answer)
        found = bound(Interval.exact(m))
        assert not np.isnan([found.lo, found.hi]).any()
        for value, lo, hi in zip(exact, found.lo.ravel(), found.hi.ravel(), strict=True):
            assert holds(value, lo, hi)


@pytest.mark.parametrize("seed", range(20))
def test_products_of_single_matrices_are_covered_in_their_last_digits(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((3, 3)), rng.standard_normal((3, 3))
    assert congruence_holds(a, symmetric(seed, "plain", 3))
    assert covers(balls(a) * balls(b), *product((a, np.zeros_like(a)), (b, np.zeros_like(b))))


@pytest.mark.parametrize("scale", [1.0, 1e-200])
@pytest.mark.parametrize("seed", range(20))
def test_radii_of_products_are_not_less_than_what_they_are_summed_from(seed, scale):
    rng = np.random.default_rng(seed)
    a, ra, rb = (scale * np.abs(rng.standard_normal((3, 3))) for _ in range(3))
    _, rad = product((a, ra), (np.zeros((3, 3)), rb))
    for i, j in np.ndindex(3, 3):
        terms = ((Fraction(a[i, k]) + Fraction(ra[i, k])) * Fraction(rb[k, j]) for k in range(3))
        assert Fraction(rad[i, j]) >= sum(terms)


def test_thin_matrices_have_thin_norms():
    found = spectral_norm_midrad(np.array([[[3.0], [4.0]]]), np.zeros((1, 2, 1)))
    assert found.lo[0] <= 5 <= found.hi[0]
    assert found.hi[0] - found.lo[0] < 1e-13


def test_error_constants_exceed_the_classical_ones():
    for k in range(1, 200):
        classical = Fraction(k, 2**53) / (1 - Fraction(k, 2**53))
        assert Fraction(linalg._gamma(k)) >= 2 * classical
