"""Tables -> stages and a recipe for the theorem: the fixed point of its own inequalities, from below.

Untrusted: what is proposed here is examined by `sampled_loop.theorem.check`, which may say no.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from typing import Final

import numpy as np

from tubecert.digits import up
from tubecert.enclosure.interval import Array
from tubecert.lint.plan import held_by
from tubecert.loop_design.design import NoDesign
from tubecert.sampled_loop.matrices import total
from tubecert.sampled_loop.record import Notes, Recipe, Shares, Stage, Tables
from tubecert.sampled_loop.remainders import Remainders
from tubecert.sampled_loop.responses import Dynamics
from tubecert.sampled_loop.setting import Loop
from tubecert.sampled_loop.theorem import MOST_LAGS, Boxes, Inequalities
from tubecert.trajectory.plan import Plan

_FORGOTTEN: Final = 1e-4  # what is left of the oldest sample that counts
_FEWEST: Final = 8
_PARTS: Final = (2, 4, 8, 16, 32, 64)
_ENOUGH: Final = 16  # parts, but where a mode is faster
_SETTLED: Final = 5e-3  # finer pieces that gain less are not worth it
_SHORTER: Final = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # of the lags, where they are enough
_STEPS: Final = 200
_STEADY: Final = 0.9  # a long run that is not narrower than this of the tube is no stage of its own
_STAGES: Final = (32, 8, 3, 1)
_WIDER: Final = 1 + 1e-3  # what another arithmetic finds has to be inside as well
_INSIDE: Final = 1 - 1e-5
_DIGITS: Final = 7
_NOTABLE: Final = 0.01  # of a half-width: what a plan's own defect may fill without a word
_POINTS: Final = 401  # of the plan, to be drawn

Report = Callable[[int, Array], None]


def propose(
    remainders: Remainders, controller: Tables, report: Report | None = None
) -> tuple[Inequalities, tuple[Stage, ...]]:
    """Stages that should hold, with the inequalities that say so. Raises `NoDesign`."""
    loop = remainders.loop
    lags = _lags(loop, controller)
    outputs = loop.states + loop.inputs + controller.size
    recipe = Recipe(
        lags=lags,
        cuts=((lags,) * loop.H.shape[1],) * outputs,
        pieces=(few := _fewest(loop)),
        panels=few,
        windows=remainders.windows,
        parameters="slow" if loop.slow else "sudden",
    )
    rough = Inequalities.made(remainders, controller, recipe)
    found = replace(rough, recipe=replace(recipe, cuts=_cuts(rough)))
    boxes = _fixed_point(found, report)
    for panels in _PARTS[_PARTS.index(few) + 1 : _PARTS.index(_ENOUGH) + 1]:
        finer = Inequalities.made(remainders, controller, replace(found.recipe, panels=panels))
        if np.max(1 - finer.of(boxes).W / np.maximum(found.of(boxes).W, 1e-300)) < _SETTLED:
            break
        found = finer
    if (pieces := _pieces(found, boxes)) > few:
        found = Inequalities.made(remainders, controller, replace(found.recipe, pieces=pieces))
    boxes = _fixed_point(found, report)
    if (several := _in_stages(found)) is not None:
        many = _fixed_point(several, report)
        if (many.W[-1] < _STEADY * many.W.max(axis=0)).any():
            found, boxes = several, many
    for share in _SHORTER:
        fewer = _shorter(found, max(1, int(share * lags)))
        if _within(fewer.of(boxes), boxes, 1 + _SETTLED):
            found, boxes = fewer, _fixed_point(fewer, report)
            break
    return found, _stages(loop, boxes, found.starts)


def _fewest(loop: Loop) -> int:
    """Parts of a sample that last no longer than the fastest mode may take: chords miss e^(|A| s) of what acts."""
    fastest = float(np.max(np.abs(np.linalg.eigvals(np.abs(loop.A))), initial=0.0)) * float(loop.sample_time)
    return next((p for p in _PARTS if 3 * fastest <= p), _PARTS[-1])


def _pieces(found: Inequalities, boxes: Boxes) -> int:
    """As many as it takes for what chords miss, which falls with their square, to be worth no more."""
    _, _, spread = found.terms(boxes)
    missed = np.max(spread / np.maximum(boxes.W[0], 1e-300))
    few = found.recipe.pieces
    wanted = (p for p in _PARTS if p >= few and 0.75 * missed * (few / p) ** 2 < _SETTLED)
    return max(few, min(next(wanted, _ENOUGH), _ENOUGH))


def _shorter(found: Inequalities, lags: int) -> Inequalities:
    cuts = tuple(tuple(min(cut, lags) for cut in row) for row in found.recipe.cuts)
    return replace(found, recipe=replace(found.recipe, lags=lags, cuts=cuts))


def _in_stages(found: Inequalities) -> Inequalities | None:
    """Narrower and narrower stages, where a start or an h that begins at 0 has something to forget."""
    loop, lags = found.loop, found.recipe.lags
    last = np.inf if loop.samples is None else loop.samples
    starts = sorted({0, *(lags // part for part in _STAGES if loop.whole < lags // part < last)})
    if len(starts) == 1 or not (loop.start.reach.any() or loop.matched):
        return None
    return replace(found, starts=tuple(starts))


def _lags(loop: Loop, controller: Tables) -> int:
    """After how many samples nothing is left of xi; all samples of a plan that ends before."""
    own = Dynamics(loop, controller)
    core = own.width - loop.H.shape[1]
    slowest = float(np.max(np.abs(np.linalg.eigvals(own.step().mid[:core, :core])), initial=0.0))
    most = MOST_LAGS if loop.samples is None else max(1, loop.samples)
    if slowest >= 1:
        return min(most, MOST_LAGS)
    wanted = np.log(_FORGOTTEN) / np.log(max(slowest, 1e-3))
    return int(min(most, max(_FEWEST, np.ceil(wanted) + 2 * (loop.whole + 2))))


def _cuts(inequalities: Inequalities) -> tuple[tuple[int, ...], ...]:
    """The lag from which on eta's size costs less than its rate, for every output and component."""
    n, own = inequalities.loop.states, inequalities.responses
    sizes = inequalities.remainders.sizes(np.zeros(n))
    rate, eta, size = (each[:, n * (len(own.nodes) - 1) :] for each in (own.rate, own.eta, own.size))
    cost = rate * sizes.rate + np.abs(eta) * sizes.size - size * sizes.size  # of e at the end, delta and zeta
    with np.errstate(all="ignore"):
        best = np.argmin(np.where(np.isfinite(cost), cost, np.inf), axis=0)
    return tuple(map(tuple, best.tolist()))


def _fixed_point(inequalities: Inequalities, report: Report | None) -> Boxes:
    """Boxes that the inequalities map inside themselves: a little more than what follows, from nothing on."""
    loop, stages = inequalities.loop, len(inequalities.starts)
    boxes = Boxes(*(np.zeros((stages, k)) for k in (loop.states, loop.inputs, inequalities.controller.size)))
    widest = np.array([float(high - low) for low, high in loop.spec.safe_set])
    with np.errstate(all="ignore"):
        for step in range(_STEPS):
            found = inequalities.of(boxes)
            if report is not None:
                report(step, found.W[-1])
            if not np.isfinite(found.W).all() or (widest < found.W).any():
                break
            if step and _within(found, boxes, _INSIDE):
                return boxes
            boxes = Boxes(
                *(np.maximum(old, _WIDER * new + 1e-30) for old, new in zip(boxes, found, strict=True))
            )
    worst, nothing = int(np.argmax(found.W[0] / widest)), Boxes(*map(np.zeros_like, boxes))
    linear = float(inequalities.of(nothing).W[0][worst])
    raise NoDesign("no_fixed_point", worst, allowed=linear if np.isfinite(linear) else None)


def _within(inner: Boxes, outer: Boxes, share: float) -> bool:
    """Whether boxes lie in a share of others."""
    return all(bool((a <= share * b).all()) for a, b in zip(inner, outer, strict=True))


def _stages(loop: Loop, boxes: Boxes, starts: Sequence[int]) -> tuple[Stage, ...]:
    """As decimals; what is later feeds on what is before, and has to be wider by more than that was rounded."""
    found = []
    for g, (start, *own) in enumerate(zip(starts, *boxes, strict=True)):
        wider = (1 + 2e-6) ** (g + 1)
        W, U, Z = ([Fraction(up(float(x) * wider, _DIGITS)) for x in each] for each in own)
        widths = dict(zip(loop.model.states, W, strict=True))
        deviations = dict(zip(loop.model.inputs, U, strict=True))
        found.append(Stage(start=start, half_widths=widths, deviations=deviations, memory=tuple(Z)))
    return tuple(found)


def explain(inequalities: Inequalities, stages: Sequence[Stage], evaluations: int) -> Notes:
    """Shares of the first and the last stage and of the inputs, and points of the plan."""
    loop, model = inequalities.loop, inequalities.loop.model
    boxes = Boxes.of(stages, model, above=True)
    with np.errstate(all="ignore"):
        first, last = (_causes(inequalities, boxes, stage) for stage in (0, len(stages) - 1))
    n, responses, missed = loop.states, inequalities.responses, np.zeros(inequalities.responses.passing)
    missed[-n - loop.inputs : -loop.inputs] = inequalities.remainders.defect
    past = responses.past[inequalities.recipe.lags, n * (len(responses.nodes) - 1) :][:n]
    widened = total(past + responses.direct[-1, :, : len(missed)], missed) / boxes.W.max(axis=0)
    return replace(
        _points(loop.plan),
        missed=fitting(loop) if (widened > _NOTABLE).any() else None,
        start=dict(zip(model.states, first, strict=False)),
        long_run=dict(zip(model.states, last, strict=False)),
        deviations=dict(zip(model.inputs, first[n:], strict=False)),
        evaluations=evaluations,
    )


def fitting(loop: Loop) -> str | None:
    """What to write for a plan at rest that misses its own equations, empty for others; None for a family."""
    if loop.plan.allowance is not None:
        return None
    return held_by(loop.spec) if loop.spec.trajectory.kind == "equilibrium" else ""


def _causes(inequalities: Inequalities, boxes: Boxes, stage: int) -> list[Shares]:
    """What fills every e_i, then every delta_j and zeta, at the worst sample of a stage."""
    own, loop, n = inequalities.responses, inequalities.loop, inequalities.loop.states
    (b, direct, spread), eta = inequalities.terms(boxes), inequalities.phases(boxes)[2]
    last, lag = n * (len(own.nodes) - 1), np.minimum(np.arange(len(b)), inequalities.recipe.lags)
    held = np.zeros(own.passing)
    held[own.passing - loop.inputs :] = inequalities.remainders.held
    during = slice(inequalities.starts[stage], [*inequalities.starts, len(b)][stage + 1])
    noise, wind = own.now[:, 0] + own.past[lag, :, 0], own.past[lag, :, 1]
    slow, start = inequalities.slow(eta), inequalities.first(np.arange(len(b)))
    parts = np.stack([noise, total(own.past, held)[lag], slow, wind, start])[:, during, last:]
    within, whole = own.direct[-1], b[during, last:].copy()  # of e at the end of a sample, delta, zeta
    rates = within[:, within.shape[1] - len(eta.rate) :]
    acted = total(within[:, : own.passing], held), total(rates, eta.rate), within[:, 1]
    parts[1:4, :, :n] += np.stack(acted)[:, None]
    whole[:, :n] += direct[during, -1] + np.max(spread[during], axis=1)
    found = parts[:, np.argmax(whole, axis=0), np.arange(whole.shape[1])]
    rest = np.maximum(whole.max(axis=0) - found.sum(axis=0), 0.0)
    names = [item.name for item in fields(Shares)]
    return [Shares(**dict(zip(names, own, strict=True))) for own in np.vstack([found, rest]).T.tolist()]


def _points(plan: Plan) -> Notes:
    """Times, states and inputs of the plan, to be drawn; none of a family."""
    if plan.allowance is not None:
        return Notes()
    end = 0.0 if plan.horizon is None else float(plan.horizon)
    t = np.linspace(0.0, end, _POINTS if end else 1)
    x, u = (tuple(map(tuple, side.mid.tolist())) for side in plan.enclose(t, t))
    return Notes(samples_t=tuple(t.tolist()), samples_x=x, samples_u=u)
