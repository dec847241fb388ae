"""What fills the tube: of every half-width at the worst sample, by cause. Floats; it explains, and claims nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.record import Notes, Shares, Stage
from tubecert.sampled_loop.theorem import Boxes, Inequalities

_POINTS: Final = 401


def explain(inequalities: Inequalities, stages: Sequence[Stage], evaluations: int) -> Notes:
    """Shares of the first and the last stage and of the inputs, constants, and points of the plan."""
    model = inequalities.loop.model
    names = model.states, model.inputs
    boxes = Boxes.of(stages, names, above=True)
    with np.errstate(all="ignore"):
        first = inequalities.causes(boxes, 0)
        last = inequalities.causes(boxes, len(stages) - 1)
    n, m = len(model.states), len(model.inputs)
    sizes = inequalities.phases(boxes)[1]
    t, x, u = _points(inequalities)
    return Notes(
        start=dict(zip(model.states, _shares(first[:n]), strict=True)),
        long_run=dict(zip(model.states, _shares(last[:n]), strict=True)),
        deviations=dict(zip(model.inputs, _shares(first[n : n + m]), strict=True)),
        constants={
            name: tuple(map(float, values))
            for name, values in (
                ("eta_size", sizes.size),
                ("eta_rate", sizes.rate),
                ("eta_first", sizes.first),
            )
            if np.isfinite(values).all()
        },
        samples_t=t,
        samples_x=x,
        samples_u=u,
        evaluations=evaluations,
    )


def _shares(causes: Array) -> list[Shares]:
    return [
        Shares(
            noise=float(row[0]),
            holding=float(row[1]),
            uncertainty=float(row[2]),
            wind=float(row[3]),
            start=float(row[4]),
            remainder=float(row[5]),
        )
        for row in causes
    ]


def _points(
    inequalities: Inequalities,
) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...], tuple[tuple[float, ...], ...]]:
    """Times, states and inputs of the plan, to be drawn; none of a family."""
    plan = inequalities.loop.plan
    if plan.allowance is not None:
        return (), (), ()
    end = 0.0 if plan.horizon is None else float(plan.horizon)
    t = np.linspace(0.0, end, _POINTS if end else 1)
    x, u = (side.mid for side in plan.enclose(t, t))
    return (
        tuple(map(float, t)),
        tuple(tuple(map(float, row)) for row in x),
        tuple(tuple(map(float, row)) for row in u),
    )
