"""What fills the tube: of every half-width at the worst sample, by cause. Floats; it explains, and claims nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np

from tubecert.sampled_loop.matrices import total
from tubecert.sampled_loop.record import Notes, Shares, Stage
from tubecert.sampled_loop.theorem import Boxes, Inequalities
from tubecert.trajectory.plan import Plan

_POINTS: Final = 401


def explain(inequalities: Inequalities, stages: Sequence[Stage], evaluations: int) -> Notes:
    """Shares of the first and the last stage and of the inputs, and points of the plan."""
    model = inequalities.loop.model
    boxes = Boxes.of(stages, model, above=True)
    with np.errstate(all="ignore"):
        first, last = (_causes(inequalities, boxes, stage) for stage in (0, len(stages) - 1))
    n = len(model.states)
    return replace(
        _points(inequalities.loop.plan),
        start=dict(zip(model.states, first, strict=False)),
        long_run=dict(zip(model.states, last, strict=False)),
        deviations=dict(zip(model.inputs, first[n:], strict=False)),
        evaluations=evaluations,
    )


def _causes(inequalities: Inequalities, boxes: Boxes, stage: int) -> list[Shares]:
    """What fills every e_i, then every delta_j and zeta, at the worst sample of a stage."""
    own, loop, n = inequalities.responses, inequalities.loop, inequalities.loop.states
    (b, direct, spread), eta = inequalities.terms(boxes), inequalities.phases(boxes)[2]
    last, lag = n * (len(own.nodes) - 1), np.minimum(np.arange(len(b)), own.lags)
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
