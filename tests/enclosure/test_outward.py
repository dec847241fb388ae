"""Bounds that no sampling of a whole certificate would miss: the last rounding, the last vertex, the width of a box."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from systems import values

from tubecert.bounds.feedback import ClosedFormGain, down_to_zero, tangents
from tubecert.enclosure.objective import Target
from tubecert.enclosure.pencil import ProjectedPencil
from tubecert.expression import constant, cos, sin, symbol
from tubecert.expression.matrix import matrix
from tubecert.model import ControlAffineModel
from tubecert.spec import Knots
from tubecert.trajectory.pieces import TAU, piecewise_plan

NAMES = ("x", "y", "z")
x, y, z = (symbol(name) for name in NAMES)
ZERO, ONE = constant(0), constant(1)
TENTH = constant(Fraction(1, 10))
MODEL = ControlAffineModel(
    states=NAMES,
    inputs=("u", "v"),
    f=(y - 2 * x + sin(z), x * y - y, z / 3 - x),
    B=((3 + x, y), (z, 2 - x), (x * y, x)),
    W=(
        (2 + sin(x), TENTH * x, ZERO),
        (TENTH * x, constant(Fraction(3, 2)), z / 5),
        (ZERO, z / 5, 1 + y**2 / 3),
    ),
    rate=Fraction(1, 2),
    h=None,
)


def boxes(count, width, seed=0):
    rng = np.random.default_rng(seed)
    lo = rng.uniform(-1, 1 - width, (count, 3))
    hi = lo + rng.uniform(0, width, (count, 3))
    return lo, hi, [lo + rng.uniform(0, 1, lo.shape) * (hi - lo) for _ in range(200)]


def projected_values(model, points):
    """The largest eigenvalue of the pencil (N, D) on the null space of B'."""
    basis = np.linalg.svd(values(model.B, NAMES, points), full_matrices=True)[0][:, :, len(model.inputs) :]
    turned = np.swapaxes(basis, -1, -2)
    root = np.linalg.inv(np.linalg.cholesky(turned @ values(model.W, NAMES, points) @ basis))
    form = turned @ values(model.drift_form, NAMES, points) @ basis
    return np.linalg.eigvalsh(root @ form @ np.swapaxes(root, -1, -2))[:, -1]


@pytest.mark.slow
@pytest.mark.parametrize("inputs", [1, 2])
def test_finslers_lemma_is_proven_at_every_vertex(inputs):
    """A target below a value inside the box is never said to hold, one well above it is in small boxes."""
    model = replace(MODEL, inputs=("u", "v")[:inputs], B=matrix([row[:inputs] for row in MODEL.B]))
    pencil = ProjectedPencil(model.drift_form, model.W, model.BBt, model.projector, inputs=len(model.inputs))
    lo, hi, points = boxes(60, 0.3)
    inside = np.array([projected_values(model, p) for p in points])
    least, most = inside.min(axis=0), inside.max(axis=0)
    for k in range(len(lo)):
        box = lo[k : k + 1], hi[k : k + 1]
        for share in (0.02, 0.3, 0.7, 0.98):
            target = float(least[k] + share * (most[k] - least[k]))
            assert pencil.upper(*box, Target(target)).upper[0] > target
    centre = 0.5 * (lo + hi)
    for k in range(len(lo)):
        near = centre[k : k + 1] - 1e-4, centre[k : k + 1] + 1e-4
        target = float(projected_values(model, centre[k : k + 1])[0]) + 0.05
        assert pencil.upper(*near, Target(target)).upper[0] == target


def test_the_closed_form_holds_over_boxes():
    """For a double integrator with a metric that moves along x, against directions sampled inside the box."""
    model = replace(
        MODEL,
        f=(y, z + sin(x), -x),
        B=((ZERO, ZERO), (ONE, ZERO), (ONE, constant(2))),
        W=(
            (1 + x**2, -ONE - x / 2, ZERO),
            (-ONE - x / 2, constant(4) + cos(x), ONE),
            (ZERO, ONE, constant(3)),
        ),
    )
    gain = ClosedFormGain(model)
    assert gain.variables == ("x", "y")
    centre = np.stack([np.linspace(-0.4, 0.4, 9), np.linspace(0.5, -0.3, 9)], axis=1)
    for half in (0.0, 1e-3, 0.02, 0.1):
        above = gain.bound(centre - half, centre + half)
        for share in (-1.0, -0.5, 0.0, 0.5, 1.0):
            points = np.concatenate([centre + share * half, np.zeros((9, 1))], axis=1)
            W, F, B = (values(rows, NAMES, points) for rows in (model.W, model.F, model.B))
            t = np.linalg.inv(np.linalg.cholesky(W))
            image = t @ B
            u, s, _ = np.linalg.svd(image, full_matrices=True)
            form = np.swapaxes(u, -1, -2) @ t @ F @ np.swapaxes(t, -1, -2) @ u
            cross = np.linalg.norm(form[:, 2:, :2], 2, axis=(-2, -1))
            push = np.maximum(np.linalg.eigvalsh(form[:, :2, :2])[:, -1], 0)
            exact = np.sqrt(cross**2 + push**2 / 4) / s[:, 1]
            assert (exact <= above * (1 + 1e-12)).all()
            assert half > 1e-3 or (above <= exact * 1.05).all()


def test_weights_of_the_denominator_lie_below_it():
    """Exactly: over a range of mu, what lies between the two ends is at most (1/mu, mu)."""
    rng = np.random.default_rng(3)
    lo = rng.uniform(0.1, 10, (400, 1)) * 10.0 ** rng.integers(-8, 8, (400, 1))
    hi = lo * (1 + rng.choice([0, 1e-12, 1e-3, 0.5, 3, 9], (400, 1)))
    lo[0], hi[0] = 0, 1e-3
    ones, slopes, levels = tangents(lo, hi)
    assert (ones == 1).all()
    for row in np.concatenate([lo, hi, slopes, levels], axis=1).tolist():
        a, b, s0, s1, w0, w1 = map(Fraction, row)
        for part in (Fraction(k, 7) for k in range(8)):
            mu = a + part * (b - a)
            assert mu == 0 or (s0 + part * (s1 - s0)) * mu <= 1
            assert w0 + part * (w1 - w0) <= mu
            assert min(s0, s1, w0, w1) >= 0


@pytest.mark.slow
def test_ranges_down_to_zero_are_bounded_by_their_two_ends():
    """For all mu in (0, h]; and where the cross terms alone count the bound is attained."""
    rng = np.random.default_rng(11)
    finite = 0
    for trial in range(300):
        F, L = rng.normal(size=(5, 5)), rng.normal(size=(5, 5))
        F, W = F + F.T, L @ L.T + 0.1 * np.eye(5)
        null = F[2:, 2:]
        F[2:, 2:] -= (np.linalg.eigvalsh(null)[-1] + rng.choice([0, 0.3])) * np.eye(3)
        if trial % 10 == 0:
            F[:2, :2], W[:2, 2:], W[2:, :2] = 0, 0, 0
        h = float(10 ** rng.uniform(-3, 0.5))
        weights = down_to_zero(np.zeros((1, 1)), np.full((1, 1), h), inputs=2, states=5)
        gram = np.diag([1.0, 1, 0, 0, 0])
        tops = []
        for end in range(2):
            numerator = weights[0][0, end] * F
            denominator = weights[1][0, end] * gram + weights[2][0, end] * W
            if np.linalg.eigvalsh(denominator)[0] > 1e-9:
                tops.append(pencil_top(numerator, denominator))
        if len(tops) < 2:
            continue
        finite += 1
        above = max(0.0, *tops)
        for mu in h * np.append(np.logspace(-4, 0, 40), rng.uniform(0, 1, 10)):
            assert pencil_top(F, gram / mu + mu * W) <= above * (1 + 1e-6) + 1e-9
    assert finite > 150


def pencil_top(numerator, denominator):
    t = np.linalg.inv(np.linalg.cholesky(denominator))
    return np.linalg.eigvalsh(t @ numerator @ t.T)[-1]


def test_a_piece_is_searched_to_its_very_end():
    """Lengths such as 1/3 are no floats: the time within a piece reaches past them, never short of them."""
    t = tuple(Fraction(n * n, 7) for n in range(30))
    rest = ((Fraction(0),) * 3,) * len(t)
    plan = piecewise_plan(MODEL, Knots(t=t, x=rest, u=((Fraction(0),) * 2,) * len(t), interpolation="hold"))
    lo, hi = plan.domain.boxes(plan.domain.variables((TAU,)))
    assert (lo[:, 0] == 0).all()
    steps = [b - a for a, b in pairwise(t)]
    assert all(Fraction(float(end)) >= step for end, step in zip(hi[:, 0], steps, strict=True))
    assert any(Fraction(float(end)) > step for end, step in zip(hi[:, 0], steps, strict=True))
