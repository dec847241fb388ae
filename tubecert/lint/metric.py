"""The metric at points of the safe set, in floats with room for rounding; what no input reaches along the plan.

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
from tubecert.expression.matrix import jacobian
from tubecert.findings import Finding, Severity
from tubecert.lint import codes
from tubecert.lint.codes import finding
from tubecert.lint.plan import curve_of
from tubecert.model import TIME, ControlAffineModel, build, place
from tubecert.spec import Spec

_POINTS = 200
_MOST_CORNERS = 64
_ROUNDING = 1e-6
_LOOSE = 1.5
_ILL = 1e8  # beyond this condition number floats say nothing about a rate or a bound


def metric_findings(spec: Spec) -> list[Finding]:
    """Findings about the metric, if there is one."""
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
        return killing
    return killing or [*_contraction(spec, model, points, W), *_declared(spec, points, W)]


def _points(spec: Spec) -> Array:
    """The middle of the safe set, corners, and points inside, the same in every run; shape (K, n)."""
    low, high = np.array(spec.safe_set, dtype=float).T
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
    found = f"its smallest eigenvalue is {near(lowest, 3)} at {_at(spec, point)}"
    message = f"W is not positive definite: {found}"
    help = "give another dual metric, or shrink the safe set"
    return finding(spec, codes.INDEFINITE, "metric.dual_metric", message, help, severity=Severity.ERROR)


def _killing(spec: Spec, model: ControlAffineModel) -> Iterator[Finding]:
    for j, name in enumerate(model.inputs):
        if any(is_zero(e) is False for row in model.killing_defect(j) for e in row):
            message = f"C3 fails for the input {name}: d_b W - b_x W - W b_x' is not zero"
            help = "where B is constant, W may not depend on the states that inputs drive directly"
            yield finding(
                spec, codes.NOT_KILLING, "metric.dual_metric", message, help, severity=Severity.ERROR
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
    inner = across @ W @ N
    if not (np.linalg.eigvalsh(inner)[:, 0] > 0).all():
        return
    inverse = np.linalg.inv(np.linalg.cholesky(inner + 1e-300 * np.eye(n - m)))
    largest = -np.linalg.eigvalsh(inverse @ (across @ drift @ N) @ inverse.transpose(0, 2, 1))[:, -1] / 2
    k = int(np.argmin(largest))
    rate = float(model.rate)
    if largest[k] < rate - _ROUNDING * max(rate, abs(float(largest[k]))):
        word = (
            f"it supports {near(largest[k], 4)} at most" if largest[k] > 0 else "it does not contract at all"
        )
        slower = "lower metric.rate, shrink the safe set, or give another dual metric"
        wrong = (
            "no rate will do: are the signs right, and is it W and not its inverse? tubecert synth finds one"
        )
        message = (
            f"C2 fails at {_at(spec, points[k])}: at rate {near(rate)} the metric does not contract; "
            f"there {word}"
        )
        help = slower if largest[k] > 0 else wrong
        yield finding(spec, codes.NOT_CONTRACTING, "metric.rate", message, help, severity=Severity.ERROR)


def _declared(spec: Spec, points: Array, W: Array) -> Iterator[Finding]:
    """Declared bounds a I <= M <= A I against M at points."""
    metric = spec.metric
    assert metric is not None
    if metric.lower is None or metric.upper is None:
        return
    values = np.linalg.eigvalsh(W)
    least, most = 1 / values[:, -1], 1 / values[:, 0]
    i, k = int(np.argmin(least)), int(np.argmax(most))
    lower, upper = float(metric.lower), float(metric.upper)
    help = "declare what holds, or remove metric.bounds: they are derived"
    for name, declared, found, at, broken, loose in (
        ("lower", lower, least[i], i, least[i] < lower * (1 - _ROUNDING), lower * _LOOSE < least[i]),
        ("upper", upper, most[k], k, most[k] > upper * (1 + _ROUNDING), upper > _LOOSE * most[k]),
    ):
        path, told = f"metric.bounds.{name}", f"{name} is declared as {near(declared)}, but"
        if broken:
            message = f"{told} an eigenvalue of M is {near(found, 4)} at {_at(spec, points[at])}"
            yield finding(spec, codes.BROKEN_METRIC_BOUND, path, message, help, severity=Severity.ERROR)
        elif loose:
            message = f"{told} about {near(found, 3)} would do"
            yield finding(spec, codes.LOOSE_METRIC_BOUND, path, message, help)


def reach_findings(spec: Spec) -> list[Finding]:
    """A combination of states that no input reaches along the plan, and that decays too slowly by itself, or not."""
    if not spec.trajectory.known:
        return []
    model, curve = build(spec), curve_of(spec)
    every = slice(None, None, -(-len(curve.t) // _POINTS))
    names, n = (*model.states, *model.inputs, TIME), len(model.states)
    slopes = jacobian([row[0] for row in model.drift_on_plan()], model.states)
    tape = Tape([e for row in (*slopes, *model.B) for e in row], names)
    points = [*curve.x[every].T, *curve.u[every].T, curve.t[every]]
    values = tape.run_floats(points, points[-1].shape).T
    size = np.array([float(high - low) / 2 for low, high in spec.safe_set])
    A = values[:, : n * n].reshape(-1, n, n) * size / size[:, None]
    B = values[:, n * n :].reshape(len(A), n, -1) / size[:, None]
    if not (np.isfinite(A).all() and np.isfinite(B).all()):
        return []
    U = _unreached(A, B)
    if not U.shape[1]:
        return []
    value, direction = _by_itself(U.T @ A @ U)
    scale = max(float(np.linalg.norm(A, axis=(1, 2)).max()), 1e-300)
    asked = spec.metric.rate if spec.metric else spec.synthesis.rate if spec.synthesis else None
    rate = 0.0 if asked is None else float(asked)
    if value <= -rate * (1 - _ROUNDING) + _ROUNDING * scale * (1 if rate else -1):
        return []
    shares = U @ direction / size
    shares /= shares[np.argmax(np.abs(shares))]
    named = {name: float(own) for name, own in zip(spec.states, shares, strict=True) if abs(own) > _ROUNDING}
    what = " + ".join(name if own == 1 else f"{near(own, 3)}*{name}" for name, own in named.items())
    held = spec.trajectory.kind == "equilibrium"
    decays = value < -_ROUNDING * scale
    speed = f"decays by itself at {near(-value, 4)} 1/s" if decays else "does not decay by itself"
    within = "" if held else "that is the same along the plan "
    lower = "lower metric.rate, or " if decays else ""
    message = f"{'at the equilibrium' if held else 'along the plan'}, no input reaches {what}, which {speed}"
    if spec.hardware is None:
        message += f": no metric {within}contracts at {f'the rate {near(rate)}' if rate else 'any rate'}"
    severity = Severity.WARNING if spec.hardware is None else Severity.NOTE
    path = "metric.rate" if spec.location("metric.rate") else "trajectory"
    help = f"{lower}add an input that moves it, or leave it out of the states"
    return [finding(spec, codes.SLOW_MODE, path, message, help, severity=severity)]


def _unreached(A: Array, B: Array) -> Array:
    """Columns (n, r) that span the c for which c'x goes its own way, whatever inputs do, by (K, n, n) and (K, n, m)."""
    scale = max(float(np.abs(B).max(initial=0.0)), 1e-300)
    U = _left_null(np.hstack(list(B)) / scale)
    while U.shape[1]:
        outside = U.T @ A - U.T @ A @ U @ U.T
        kept = _left_null(np.hstack(list(outside)) / max(float(np.abs(A).max()), 1e-300))
        if kept.shape[1] == U.shape[1]:
            break
        U = U @ kept
    return U


def _left_null(matrix: Array) -> Array:
    """An orthonormal basis of the y with y' matrix = 0, as columns."""
    left, values, _ = np.linalg.svd(matrix)
    return np.asarray(left[:, int((values > _ROUNDING).sum()) :])


def _by_itself(M: Array) -> tuple[float, Array]:
    """How fast z' = M z grows at most, in 1/s, and the combination of z that does; of an M (K, r, r) that changes along
    the plan the mean over its directions, which one of them exceeds.
    """
    if np.abs(M - M[0]).max() > _ROUNDING * np.abs(M).max():
        return float(np.trace(M, axis1=1, axis2=2).mean()) / M.shape[1], np.eye(M.shape[1])[0]
    values, vectors = np.linalg.eig(M[0].T)
    k = int(np.argmax(values.real))
    return float(values[k].real), vectors[:, k].real
