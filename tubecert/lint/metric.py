"""The metric at points of the safe set, in floats with room for rounding; and modes that no metric can contract.

What is found here is certain enough to be named before a certification proves it; what is not found proves nothing.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import Expression, is_zero
from tubecert.findings import Finding, Severity
from tubecert.lint import codes
from tubecert.lint.floats import floats, nearest
from tubecert.model import TIME, ControlAffineModel, build, place
from tubecert.spec import Spec

_POINTS = 200
_MOST_CORNERS = 64
_ROUNDING = 1e-6
_LOOSE = 1.5
_ILL = 1e8  # beyond this condition number floats say nothing about a rate or a bound


def metric_findings(spec: Spec) -> list[Finding]:
    """Findings about the metric, if there is one, and about the dynamics that it has to contract."""
    if spec.metric is None:
        return []
    model = build(spec)
    points = _points(spec)
    W = _values(model.W, model, points)
    lowest = np.linalg.eigvalsh(W)[:, 0] if np.isfinite(W).all() else np.full(len(points), np.nan)
    scale = np.abs(W).max(initial=0.0)
    if not np.isfinite(lowest).all():
        return []
    k = int(np.argmin(lowest))
    if lowest[k] < -_ROUNDING * scale:
        return [_indefinite(spec, points[k], lowest[k])]
    killing = list(_killing(spec, model))
    if np.linalg.cond(W).max() > _ILL:
        return killing or list(_modes(spec, model))
    return killing or [
        *_contraction(spec, model, points, W),
        *_declared(spec, points, W),
        *_modes(spec, model),
    ]


def _points(spec: Spec) -> Array:
    """The middle of the safe set, corners, and points inside, the same in every run; shape (K, n)."""
    low, high = (floats([side[i] for side in spec.safe_set]) for i in (0, 1))
    signs = list(itertools.islice(itertools.product((0.0, 1.0), repeat=len(low)), _MOST_CORNERS))
    inside = np.random.default_rng(0).random((_POINTS, len(low)))
    shares = np.concatenate([np.full((1, len(low)), 0.5), np.array(signs), inside])
    return np.asarray(low + shares * (high - low))


def _values(matrix: Sequence[Sequence[Expression]], model: ControlAffineModel, points: Array) -> Array:
    """A matrix of expressions at points, at the start where f depends on t; shape (K, rows, columns)."""
    tape = Tape([e for row in matrix for e in row], (*model.states, TIME))
    values = tape.run_floats([*points.T, np.zeros(len(points))], (len(points),))
    return values.T.reshape(len(points), len(matrix), -1)


def _at(spec: Spec, point: Array) -> str:
    return place({name: float(value) for name, value in zip(spec.states, point, strict=True)})


def _indefinite(spec: Spec, point: Array, lowest: float) -> Finding:
    return Finding(
        code=codes.INDEFINITE,
        message=f"W is not positive definite: its smallest eigenvalue is {near(lowest, 3)} at {_at(spec, point)}",
        location=spec.location("metric.dual_metric"),
        help="give another dual metric, or shrink the safe set",
    )


def _killing(spec: Spec, model: ControlAffineModel) -> Iterator[Finding]:
    for j, name in enumerate(model.inputs):
        if any(is_zero(e) is False for row in model.killing_defect(j) for e in row):
            yield Finding(
                code=codes.NOT_KILLING,
                message=f"C3 fails for the input {name}: d_b W - b_x W - W b_x' is not zero",
                location=spec.location("metric.dual_metric"),
                help="where B is constant, W may not depend on the states that inputs drive directly",
            )


def _contraction(spec: Spec, model: ControlAffineModel, points: Array, W: Array) -> Iterator[Finding]:
    """C2 at points: the largest rate r with N'(F_0 + 2 r W)N <= 0, N a basis of what inputs cannot reach."""
    n, m = len(model.states), len(model.inputs)
    if m == n:
        return
    drift, B = _values(model.drift_form, model, points), _values(model.B, model, points)
    if not (np.isfinite(drift).all() and np.isfinite(B).all()):
        return
    N = np.linalg.svd(B)[0][:, :, m:]
    across = N.transpose(0, 2, 1)
    with np.errstate(all="ignore"):
        root = (
            np.linalg.cholesky(across @ W @ N + 1e-300 * np.eye(n - m)) if _definite(across @ W @ N) else None
        )
    if root is None:
        return
    inverse = np.linalg.inv(root)
    largest = -np.linalg.eigvalsh(inverse @ (across @ drift @ N) @ inverse.transpose(0, 2, 1))[:, -1] / 2
    k = int(np.argmin(largest))
    rate = nearest(model.rate)
    if largest[k] < rate - _ROUNDING * max(rate, abs(float(largest[k]))):
        word = (
            f"it supports {near(largest[k], 4)} at most" if largest[k] > 0 else "it does not contract at all"
        )
        slower = "lower metric.rate, shrink the safe set, or give another dual metric"
        wrong = (
            "no rate will do: are the signs right, and is it W and not its inverse? tubecert synth finds one"
        )
        yield Finding(
            code=codes.NOT_CONTRACTING,
            message=f"C2 fails at {_at(spec, points[k])}: at rate {near(rate)} the metric does not contract; "
            f"there {word}",
            location=spec.location("metric.rate"),
            help=slower if largest[k] > 0 else wrong,
        )


def _definite(matrices: Array) -> bool:
    return bool((np.linalg.eigvalsh(matrices)[:, 0] > 0).all())


def _declared(spec: Spec, points: Array, W: Array) -> Iterator[Finding]:
    """Declared bounds a I <= M <= A I against M at points."""
    metric = spec.metric
    assert metric is not None
    if metric.lower is None or metric.upper is None:
        return
    values = np.linalg.eigvalsh(W)
    least, most = 1 / values[:, -1], 1 / values[:, 0]
    i, k = int(np.argmin(least)), int(np.argmax(most))
    lower, upper = nearest(metric.lower), nearest(metric.upper)
    for name, declared, found, at, broken, loose in (
        ("lower", lower, least[i], i, least[i] < lower * (1 - _ROUNDING), False),
        ("upper", upper, most[k], k, most[k] > upper * (1 + _ROUNDING), False),
        ("lower", lower, least[i], i, False, lower * _LOOSE < least[i]),
        ("upper", upper, most[k], k, False, upper > _LOOSE * most[k]),
    ):
        if broken or loose:
            yield Finding(
                code=codes.BROKEN_METRIC_BOUND if broken else codes.LOOSE_METRIC_BOUND,
                severity=Severity.ERROR if broken else Severity.WARNING,
                message=f"{name} is declared as {near(declared)}, but an eigenvalue of M is {near(found, 4)} at "
                f"{_at(spec, points[at])}"
                if broken
                else f"{name} is declared as {near(declared)}, but about {near(found, 3)} would do",
                location=spec.location(f"metric.bounds.{name}"),
                help="declare what holds, or remove metric.bounds: they are derived",
            )


def _modes(spec: Spec, model: ControlAffineModel) -> Iterator[Finding]:
    """Eigenvalues of d(f + B u*)/dx at an equilibrium that B does not reach (Hautus): no rate lies beyond them."""
    plan = spec.trajectory
    if plan.kind != "equilibrium" or spec.lacks:
        return
    x, u = ([nearest(term.expression.fraction) for term in terms] for terms in (plan.x, plan.u))
    at = np.array([x])
    A, B = _values(model.f_x, model, at)[0], _values(model.B, model, at)[0]
    for value, slope in zip(u, model.b_x, strict=True):
        A = A + value * _values(slope, model, at)[0]
    if not (np.isfinite(A).all() and np.isfinite(B).all()):
        return
    scale = max(float(np.linalg.norm(A)), float(np.linalg.norm(B)), 1e-300)
    rate = nearest(model.rate)
    for value in np.linalg.eigvals(A):
        test = np.concatenate([value * np.eye(len(A)) - A, B], axis=1) / scale
        reached = np.linalg.svd(test, compute_uv=False)[-1] > _ROUNDING
        if not reached and value.real > -rate * (1 - _ROUNDING) + _ROUNDING * scale:
            yield Finding(
                code=codes.SLOW_MODE,
                severity=Severity.WARNING,
                message=f"at the equilibrium, inputs do not reach a mode with eigenvalue {near(value.real, 4)} 1/s: "
                f"no metric contracts at the rate {near(rate)}",
                location=spec.location("metric.rate"),
                help="lower metric.rate, or add an input that reaches this mode",
            )
            return
