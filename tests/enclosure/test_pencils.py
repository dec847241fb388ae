"""Bounds of pencils where little is to spare: against exact rationals, and whatever LAPACK answers."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import balls as ball_arithmetic
import mpmath
import numpy as np
import pytest

from tubecert.bounds.feedback import MU, exact_gain
from tubecert.enclosure.linalg import whitening
from tubecert.enclosure.objective import Target
from tubecert.enclosure.pencil import Definite, Pencil, SumOfPencils, WeightedPencil, Weights
from tubecert.enclosure.vertices import Balls, Vertices
from tubecert.expression import ONE, ZERO, constant, symbol
from tubecert.model import ControlAffineModel

x = symbol("x")
UNIT = Fraction(1, 2**52)  # in the last place of what lies in [1, 2)
NOWHERE = np.zeros((1, 0))


precision = ball_arithmetic.precision(53, quiet=True)


def of_floats(rows):
    return tuple(tuple(constant(Fraction(float(e))) for e in row) for row in rows)


def left_of(tau, near, share):
    """A float d with tau d further than `share` units below the float next to it, and that float."""
    for k in range(10_000):
        d = Fraction(near) + k * UNIT
        product = Fraction(float(tau * d))
        if product - tau * d > share * UNIT:
            return d, product
    raise AssertionError("there is none")


def test_a_target_that_is_exceeded_by_less_than_a_rounding_is_not_said_to_hold():
    """In floats N - tau D is -1 unit times I; exactly, its row sums are positive."""
    tau, n = Fraction(1 + 3 * 2.0**-7 + 2.0**-40), 4
    (own, own_product), (off, off_product) = left_of(tau, 1.875, 0.45), left_of(tau, 1.5, 0.45)
    N = [[own_product - UNIT if i == j else off_product for j in range(n)] for i in range(n)]
    D = [[own if i == j else off for j in range(n)] for i in range(n)]
    excess = sum(N[i][j] - tau * D[i][j] for i in range(n) for j in range(n))
    assert excess > 0
    assert all(Fraction(float(q)) == q for rows in (N, D) for row in rows for q in row)
    found = (
        Pencil(of_floats(N), of_floats(D)).upper(NOWHERE, NOWHERE, Target(float(tau), float(tau))).upper[0]
    )
    assert float(tau) < found < float(tau) * (1 + 1e-12)


@pytest.mark.parametrize("target", [0.0, 3.0, 3.4, 4.0, 30.0, np.inf, -np.inf])
def test_what_is_left_below_a_target_is_divided_by_the_largest_eigenvalue(target):
    """D is as small as 1/2 in directions that have nothing to do with the value, which is 10/3 everywhere."""
    diagonals = (constant(Fraction(10, 3)), ZERO, ZERO), (ONE, 1 + x, 1 - x)
    N, D = (tuple(tuple(d[i] if i == j else ZERO for j in range(3)) for i in range(3)) for d in diagonals)
    found = Pencil(N, D).upper(np.array([[-0.5]]), np.array([[0.5]]), Target(target, target)).upper[0]
    assert Fraction(float(found)) >= Fraction(10, 3)


def spectrum(N, *terms):
    """Eigenvalues of a pencil, to 40 digits; D is a sum of floats times matrices of floats."""
    with mpmath.workdps(40):
        D = sum((mpmath.mpf(w) * mpmath.matrix(d.tolist()) for w, d in terms), start=mpmath.zeros(len(N)))
        root = mpmath.cholesky(D) ** -1
        S = root * mpmath.matrix(N.tolist()) * root.T
        return sorted(mpmath.eigsy((S + S.T) / 2, eigvals_only=True))


def definite(rng, n, condition):
    q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    a = q * 10.0 ** rng.uniform(-condition / 2, condition / 2, n) @ q.T
    return 0.5 * (a + a.T)


@pytest.mark.slow
def test_badly_scaled_pencils_at_points():
    """Condition numbers up to 1e11, values of every size and sign, targets on both sides: no tolerance."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        n = int(rng.integers(1, 5))
        D = definite(rng, n, rng.uniform(0, 11)) * 10.0 ** rng.integers(-8, 9)
        N = rng.normal(size=(n, n)) * 10.0 ** rng.integers(-8, 9)
        N = 0.5 * (N + N.T) if rng.random() < 0.5 else -definite(rng, n, 3)
        pencil, values = Pencil(of_floats(N), of_floats(D)), spectrum(N, (1, D))
        near = float(values[-1])
        for target in (np.inf, -np.inf, np.nan, near, near - 1e-3 * abs(near), near + 0.1 * abs(near), 0.0):
            assert pencil.upper(NOWHERE, NOWHERE, Target(target)).upper[0] >= values[-1]
            assert pencil.upper(NOWHERE, NOWHERE, Target(target, target)).upper[0] >= values[-1]
        assert pencil.lower(NOWHERE, NOWHERE)[0] <= values[-1]
        both = SumOfPencils([of_floats(N), of_floats(D)], of_floats(D))
        largest = max(abs(values[0]), abs(values[-1])) + 1
        assert (
            both.lower(NOWHERE, NOWHERE)[0]
            <= largest
            <= both.upper(NOWHERE, NOWHERE, Target(np.inf)).upper[0]
        )


def scaled_down(d, v):
    return d, v * 1e-3


def nothing(d, v):
    return d, v * 0


def reversed_order(d, v):
    return d[..., ::-1], v


def singular(d, v):
    return d, np.repeat(v[..., :1], v.shape[-1], axis=-1)


def no_numbers(d, v):
    return d * np.nan, v * np.nan


def too_small(d, v):
    return d * 1e-20, v


def turned(d, v):
    return d + 1e3, np.swapaxes(v, -1, -2)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, -1.0, np.nan])
@pytest.mark.parametrize(
    "lie",
    [scaled_down, nothing, reversed_order, singular, no_numbers, too_small, turned],
    ids=lambda f: f.__name__,
)
def test_whatever_lapack_answers_no_bound_is_false(lie, factor, monkeypatch):
    """Also where D is not positive: then N <= tau D itself is what a finite answer says."""
    rng = np.random.default_rng(2)
    true_pairs, true_values = np.linalg.eigh, np.linalg.eigvalsh
    with monkeypatch.context() as patch:
        patch.setattr(np.linalg, "eigh", lambda a: lie(*true_pairs(a)))
        patch.setattr(np.linalg, "eigvalsh", lambda a: true_values(a) * factor)
        answers = []
        for _ in range(5):
            D = definite(rng, 3, 1) - rng.choice([0.0, 0.3]) * np.eye(3)
            N = definite(rng, 3, 1) - np.eye(3)
            for target in map(Target, (np.inf, 0.0, -1.0, 1.0, 1e6), (-np.inf, 0.0, -np.inf, 1.0, 1e6)):
                answers.append(
                    (N, D, Pencil(of_floats(N), of_floats(D)).upper(NOWHERE, NOWHERE, target).upper[0])
                )
            answers.append(
                (-D, np.eye(3), Definite(of_floats(D)).upper(NOWHERE, NOWHERE, Target(-5e-324)).upper[0])
            )
    for N, D, tau in answers:
        assert not np.isnan(tau)
        assert tau == np.inf or true_values(N - tau * D)[-1] <= 1e-9 * (1 + abs(tau))


def test_radii_of_a_box_count_with_their_weights_at_every_vertex():
    """Entries that are known to a radius only: N and D move against each other, whatever the sign of the target."""

    class Known(Pencil):
        def __init__(self, N, D, r, s):
            super().__init__(((constant(N),),), ((constant(D),),))
            self._r, self._s = r, s

        def upper(self, lo, hi, target):
            true = self._function.expand

            def blurred(lo, hi):
                e = true(lo, hi)
                return replace(e, rad=[e.rad[0] + self._r, e.rad[1] + self._s])

            self._function.expand = blurred
            return super().upper(lo, hi, target)

    for N, D, r, s in (
        (1.0, 2.0, 0.0, 0.5),
        (-1.0, 2.0, 0.0, 0.5),
        (-1.0, 2.0, 0.5, 0.0),
        (3.0, 1.0, 0.25, 0.125),
    ):
        true = max((N + r) / d for d in (D - s, D + s))
        for target in (np.inf, true - 1e-9, true, 2 * true, -10.0, 10.0):
            assert (
                Known(Fraction(N), Fraction(D), r, s).upper(NOWHERE, NOWHERE, Target(target, target)).upper[0]
                >= true
            )


def test_the_value_of_a_box_is_that_of_its_worst_vertex():
    for low, high in pairwise((-0.9, -0.3, 0.2, 0.8)):
        box = np.array([[low]]), np.array([[high]])
        for N, most in ((x, high), (-x, -low)):
            pencil = Pencil(((N, ZERO), (ZERO, constant(-5))), ((ONE, ZERO), (ZERO, ONE)))
            for target in (np.inf, most - 0.01, 0.5 * (low + high) if N is x else -0.5 * (low + high)):
                assert pencil.upper(*box, Target(target, target)).upper[0] >= most


def test_a_ball_that_is_not_positive_bounds_nothing():
    pencil = Pencil(((ONE, ZERO), (ZERO, ONE)), ((x, ZERO), (ZERO, constant(2))))
    for low, high in ((-1.0, 1.0), (0.0, 1.0), (-2.0, -1.0)):
        for target in (np.inf, 1.0, 1e9):
            assert (
                pencil.upper(np.array([[low]]), np.array([[high]]), Target(target, target)).upper[0] == np.inf
            )


A = np.array([[-3.0, 1.0, 0.5], [0.25, -2.0, 1.0], [2.0, -1.0, 1.0]])
W = np.array([[2.0, 0.25, -0.5], [0.25, 1.5, 0.125], [-0.5, 0.125, 1.0]])
INPUTS = {
    "along an axis": [[0], [0], [4]],
    "weak": [[0], [0], [0.125]],
    "askew": [[1], [-1], [4]],
    "two": [[0, 1], [1, 0], [4, 1]],
    "all": [[2, 0, 0], [0, 1, 0], [1, 0, 4]],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", INPUTS)
def test_the_feedback_gain_holds_over_ranges_of_mu(name):
    """x' = A x + B u with a constant W for which C2 holds: every range of mu, down to 0 among them, against values."""
    B = np.array(INPUTS[name], dtype=float)
    n, m = B.shape
    states = tuple(f"x{i}" for i in range(n))
    f = tuple(
        sum((constant(Fraction(a)) * symbol(s) for a, s in zip(row, states, strict=True)), start=ZERO)
        for row in A
    )
    model = ControlAffineModel(
        states=states,
        inputs=tuple(f"u{j}" for j in range(m)),
        f=f,
        B=of_floats(B),
        W=of_floats(W),
        rate=Fraction(1, 2),
        h=None,
    )
    F = A @ W + W @ A.T + W
    null = np.linalg.svd(B)[0][:, m:]
    assert m == n or np.linalg.eigvalsh(null.T @ F @ null)[-1] < 0
    largest = np.sqrt(float(spectrum(B @ B.T, (1, W))[-1]))
    gain = exact_gain(model, largest)
    assert gain.variables == (MU,)
    ends = [0.0, *(largest * 2.0 ** np.arange(-12, 1, 1.5))]
    ranges = (
        [(0.0, high) for high in ends[1:]] + list(pairwise(ends)) + list(zip(ends, ends[3:], strict=False))
    )
    finite = 0
    for low, high in ranges:
        inside = [low + share * (high - low) for share in (1e-6, 1e-3, 0.03, 0.3, 0.6, 1.0)]
        values = [float(spectrum(F, (1 / mu, B @ B.T), (mu, W))[-1]) for mu in inside]
        most = max(0.0, *values)
        for target in (np.inf, 0.99 * most, 1.01 * most, -1.0):
            found = gain.upper(np.array([[low]]), np.array([[high]]), Target(target)).upper[0]
            assert found >= most * (1 - 1e-12)
            finite += low == 0 and bool(np.isfinite(found))
        for mu, value in zip(inside, values, strict=True):
            at = np.array([[mu]])
            assert gain.lower(at, at)[0] <= max(0.0, value * (1 + np.sign(value) * 1e-12))
    assert finite >= 4 or m == n  # C2 is void then, and nothing bounds the gain towards mu = 0 at once
    assert gain.lower(np.array([[0.0]]), np.array([[0.0]]))[0] == 0.0


@pytest.mark.parametrize("lost", [1e-14, 1e-6, 0.1, 3.0])
def test_a_proposal_that_is_too_low_is_mended_and_one_that_is_too_high_is_kept(lost):
    """Whatever is proposed first: what comes out is proven, and near the least number for which it can be."""
    rng = np.random.default_rng(4)
    D, N = definite(rng, 4, 2), definite(rng, 4, 3)
    balls = [Balls(m[None, None], np.abs(m)[None, None], 0 * m[None, None]) for m in (N, D)]
    vertices, most = Vertices(whitening(D[None])[:, None], *balls), spectrum(N, (1, D))[-1]
    low, high = np.array([float(most) * (1 - lost)]), np.array([float(most) * (1 + lost)])
    assert not vertices.below(low)[0]
    assert most < vertices.proven(low)[0] < most * (1 + 1e-9)
    assert most < vertices.proven(high)[0] <= high[0] * (1 + 1e-9)
    assert vertices.proven(high, float(high[0]))[0] == high[0] or lost < 1e-12


@pytest.mark.parametrize("per_entry", [False, True])
def test_radii_count_with_the_weights_of_their_matrices(per_entry):
    """Bowls and hills that the vertices do not show, in numerators and denominators of which each has its weight."""
    bowl, hill = ((1 + x**2,),), ((3 - x**2,),)
    box = np.array([[-1.0]]), np.array([[1.0]])

    def ends(lo, hi):
        return [np.full((len(lo), 1, 1, 1) if per_entry else (len(lo), 1), w) for w in (0.5, 4.0, 0.25, 2.0)]

    weights = Weights(variables=(), ends=ends, loss=lambda lo, hi: np.zeros((len(lo), 0)))
    cases = (([bowl, bowl], [hill, hill], 9.0 / 4.5), ([hill, hill], [bowl, bowl], 13.5 / 2.25))
    for numerators, denominators, most in cases:
        pencil = WeightedPencil(numerators, denominators, weights)
        for target in (np.inf, 0.0, 0.9 * most, most - 1e-9, -1.0):
            assert pencil.upper(*box, Target(target, target)).upper[0] >= most
        assert pencil.upper(*box, Target(10 * most)).upper[0] <= 10 * most
