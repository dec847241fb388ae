"""`Spec` -> plain data: the effective specification, defaults written out, decimals exact, texts canonical.

The same system written differently (spacing, order of commutative operands, 0.5 or 1/2) gives the same data; a system
that owes something else (x + 0/y in place of x) does not. The data is itself a specification: written as YAML or JSON
it loads to the same system.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

from tubecert.expression import ZERO, Lookup, constant, full_text, number_text, symbol, to_text
from tubecert.spec.hardware import ONE_SAMPLE
from tubecert.spec.load import VERSION
from tubecert.spec.lookup import SLOPES
from tubecert.spec.types import (
    Bundle,
    Hardware,
    Matrix,
    Obstacle,
    Output,
    Simulation,
    Spec,
    Synthesis,
    Task,
    Term,
    Tube,
)


def canonical(spec: Spec) -> dict[str, Any]:
    """JSON-ready data of the effective specification."""
    data: dict[str, Any] = {
        "tubecert": VERSION,
        "name": spec.name,
        "system": _system(spec),
        "safe_set": {name: _numbers(side) for name, side in zip(spec.states, spec.safe_set, strict=True)},
    }
    if not spec.lacks:  # else it is about a metric alone
        data |= _loop(spec)
    if spec.metric is not None:
        data["metric"] = _metric(spec)
    elif spec.synthesis is not None:
        data["metric"] = {"synthesise": synthesis_data(spec.synthesis)}
    if spec.expect is not None:
        data["expect"] = _nested({name: _numbers(limits) for name, limits in spec.expect.ranges})
        if spec.expect.verdict is not None:
            data["expect"]["verdict"] = spec.expect.verdict
        if spec.expect.metric is not None:
            data["expect"]["metric"] = spec.expect.metric
    if spec.obstacles:
        data["obstacles"] = [_obstacle(obstacle) for obstacle in spec.obstacles]
    if spec.limits:
        data["limits"] = {name: _numbers(ends) for name, ends in spec.limits}
    if spec.simulation is not None:
        data["simulation"] = _simulation(spec.simulation)
    if spec.hardware is not None:
        data["hardware"] = _hardware(spec, spec.hardware)
        data["controller"] = spec.controller
    if (wind := spec.disturbance) is not None:
        data["disturbance"] = {
            "E": [_texts(row) for row in wind.E],
            "bound": _numbers(wind.bound) if isinstance(wind.bound, tuple) else number_text(wind.bound),
            **_given(rate=wind.rate),
        }
    return data


def _loop(spec: Spec) -> dict[str, Any]:
    """What every certificate is about, beside a system and its metric."""
    if spec.hardware is not None:
        return _sampled_loop(spec)
    return {
        "uncertainty": _uncertainty(spec),
        "trajectory": _trajectory(spec),
        "initial_state": _initial_state(spec),
        "tube": _tube(spec.tube),
        "adaptation": {
            "A_m": "auto" if (g := spec.adaptation.predictor_gain) is None else number_text(-g),
            "projection": "hard" if spec.adaptation.smooth is None else _given(smooth=spec.adaptation.smooth),
        },
        "conditions": {} if spec.decides is None else {"decides": spec.decides},
    }


def _sampled_loop(spec: Spec) -> dict[str, Any]:
    """The same of a loop that a computer closes: nothing of a metric, and what holds after the plan."""
    plan, wishes = spec.trajectory, spec.tube.half_widths
    after = {} if plan.horizon is None else {"afterwards": plan.afterwards}
    return {
        "uncertainty": _uncertainty(spec),
        "trajectory": _trajectory(spec) | after,
        "initial_state": _initial_state(spec),
        "tube": {"half_widths": _given(**dict(wishes))} if wishes else {},
    }


def _system(spec: Spec) -> dict[str, Any]:
    data: dict[str, Any] = {
        "states": list(spec.states),
        "inputs": list(spec.inputs),
        "units": dict(spec.units),
        "parameters": {name: number_text(value) for name, value in spec.parameters}
        | {name: _numbers(ends) for name, ends in spec.ranges},
        "f": _texts(spec.drift or spec.f),
        "B": [_texts(row) for row in spec.gained or spec.B],
    }
    if spec.outputs:
        data["outputs"] = {output.name: _combination(spec.states, output) for output in spec.outputs}
    if spec.tables:
        data["tables"] = {table.name: _lookup(table) for table in spec.tables}
    return data


def _combination(states: Iterable[str], output: Output) -> str:
    terms = (constant(factor) * symbol(state) for state, factor in zip(states, output.row, strict=True))
    return to_text(sum(terms, start=ZERO))


def _lookup(table: Lookup) -> dict[str, Any]:
    """The function itself: however its slopes were found, they are what counts."""
    rows = zip(table.knots, table.values, table.slopes, strict=True)
    return {"interpolation": SLOPES, "points": [_numbers(row) for row in rows]}


def _uncertainty(spec: Spec) -> dict[str, Any]:
    data: dict[str, Any] = {}
    if spec.uncertainty.h is not None:
        data["h"] = _texts(spec.uncertainty.h)
    if (bounds := spec.uncertainty.bounds) is not None:
        data["bounds"] = _given(h=bounds.h, h_x=bounds.h_x, h_t=bounds.h_t)
    return data


def _initial_state(spec: Spec) -> dict[str, Any]:
    if spec.within is not None:
        return _given(within=spec.within)
    if not spec.start_box:
        return {"at": _numbers(spec.x0)}
    return {"box": {name: _numbers(side) for name, side in zip(spec.states, spec.start_box, strict=True)}}


def _trajectory(spec: Spec) -> dict[str, Any]:
    plan = spec.trajectory
    if plan.table is not None:
        knots = plan.table.knots
        shown = {"kind": plan.kind, "file": plan.table.file, "interpolation": knots.interpolation}
        return {**shown, **_given(horizon=plan.horizon)}
    if plan.task is not None:
        return _task(plan.task, plan.horizon)
    if plan.bundle is not None:
        return _bundle(spec, plan.bundle)
    x, u = ("at", "input") if plan.kind == "equilibrium" else ("x", "u")
    return {"kind": plan.kind, x: _texts(plan.x), u: _texts(plan.u), **_given(horizon=plan.horizon)}


def _bundle(spec: Spec, bundle: Bundle) -> dict[str, Any]:
    x, u = (
        {name: _numbers(ends) for name, ends in zip(names, box, strict=True)}
        for names, box in ((spec.states, bundle.x), (spec.inputs, bundle.u))
    )
    return {
        "kind": "any",
        "x": x,
        "u": u,
        **_given(defect=bundle.defect, horizon=spec.trajectory.horizon),
        **_rates(spec, bundle),
    }


def _rates(spec: Spec, bundle: Bundle) -> dict[str, Any]:
    rates = bundle.input_rate
    return {} if rates is None else {"input_rate": _given(**dict(zip(spec.inputs, rates, strict=True)))}


def _task(task: Task, horizon: Fraction | None) -> dict[str, Any]:
    data: dict[str, Any] = {
        "kind": "ilqr",
        "start": _numbers(task.start),
        "target": _numbers(task.target),
        "knots": str(task.knots),
        "Q": _matrix(task.Q),
        "R": _matrix(task.R),
        "goal": "true" if task.goal else "false",
        "interpolation": task.interpolation,
        **_given(horizon=horizon),
    }
    return data if task.input is None else {**data, "input": _numbers(task.input)}


def _metric(spec: Spec) -> dict[str, Any]:
    assert spec.metric is not None
    data: dict[str, Any] = {
        "dual_metric": [_texts(row) for row in spec.metric.dual_metric],
        "rate": number_text(spec.metric.rate),
    }
    if spec.metric.lower is not None:
        data["bounds"] = _given(lower=spec.metric.lower, upper=spec.metric.upper)
    return data


def synthesis_data(wanted: Synthesis) -> dict[str, Any]:
    """What metric is asked for."""
    data: dict[str, Any] = {
        "objective": wanted.objective,
        "degree": "auto" if wanted.degree is None else str(wanted.degree),
        "variables": "auto" if wanted.variables is None else list(wanted.variables),
        "coordinates": wanted.coordinates,
        "route": wanted.route,
        "solver": wanted.solver,
    }
    if wanted.outputs:
        data["outputs"] = list(wanted.outputs)
    return data | _given(rate=wanted.rate, condition_number=wanted.condition_number)


def _tube(tube: Tube) -> dict[str, Any]:
    data: dict[str, Any] = _given(epsilon=tube.epsilon, rho_a=tube.rho_a)
    if tube.auto:
        data["coordinates"] = "auto"
    if tube.half_widths:
        data["half_widths"] = _given(**dict(tube.half_widths))
    if tube.gap is not None:
        data["gap"] = tube.gap
    return data


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    shown: dict[str, Any] = {"states": list(obstacle.states)}
    if not obstacle.decides:
        shown["decide"] = False
    if obstacle.radius is None:
        return shown | {"polygon": _matrix(obstacle.polygon)}
    return shown | {"disc": {"center": _numbers(obstacle.center), **_given(radius=obstacle.radius)}}


def _hardware(spec: Spec, own: Hardware) -> dict[str, Any]:
    return {
        "delay": ONE_SAMPLE if own.delay is None else number_text(own.delay),
        "noise": _given(**dict(zip(spec.states, own.noise, strict=True)))
        if isinstance(own.noise, tuple)
        else number_text(own.noise),
        "sample_time": number_text(own.sample_time),
        "arithmetic": own.arithmetic,
        "hold": own.hold,
    }


def _simulation(wanted: Simulation) -> dict[str, Any]:
    data: dict[str, Any] = {
        "controllers": list(wanted.controllers),
        "gains": wanted.gains,
        "plane": list(wanted.plane or ()),
        "h": _texts(wanted.h or ()),
        "runs": None if wanted.runs is None else str(wanted.runs),
        "seed": None if wanted.seed is None else str(wanted.seed),
        **_given(duration=wanted.duration),
    }
    return {key: value for key, value in data.items() if value}


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Keys `a.b` as a mapping within `a`."""
    data: dict[str, Any] = {}
    for path, value in flat.items():
        section, _, key = path.partition(".")
        data |= {section: {**data.get(section, {}), key: value} if key else value}
    return data


def _texts(terms: Iterable[Term]) -> list[str]:
    return [full_text(term.expression, term.obligations) for term in terms]


def _numbers(values: Iterable[Fraction]) -> list[str]:
    return [number_text(value) for value in values]


def _matrix(matrix: Matrix) -> list[list[str]]:
    return [_numbers(row) for row in matrix]


def _given(**values: Fraction | None) -> dict[str, str]:
    return {name: number_text(value) for name, value in values.items() if value is not None}
