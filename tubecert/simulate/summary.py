"""A campaign as data: what was simulated, with which gains, what it used of every bound, and what broke.

The words are chosen with care: a simulation that finds nothing has not falsified anything, and that is all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from tubecert.records import to_json
from tubecert.simulate.campaign import Attack, Campaign, Drawn
from tubecert.simulate.clearance import Clearance
from tubecert.simulate.compare import Comparison, Use
from tubecert.simulate.setting import Loop, Setting

FORMAT: Final = "tubecert-simulation/1"

Data = dict[str, Any]


def outcome(campaign: Campaign) -> str:
    """The outcome in a word or two: falsified, tube left, no result, interrupted, not falsified, or nothing claimed."""
    if campaign.falsified:
        return "falsified"
    if campaign.left:
        return "tube left"
    if campaign.unreliable:
        return "no result"
    if campaign.interrupted:
        return "interrupted"
    return "not falsified" if any(loop.promise for loop, _ in campaign.comparisons) else "nothing claimed"


def summary(campaign: Campaign, certificate: str) -> Data:
    """JSON-ready data; `certificate` is the hash of the certificate that was compared with."""
    setting = campaign.setting
    return {
        "format": FORMAT,
        "name": setting.spec.name,
        "outcome": outcome(campaign),
        "certificate": certificate,
        "horizon": setting.horizon,
        "rho": setting.rho,
        "dbar": setting.reach,
        "uncertainty": campaign.uncertainty,
        "class": {name: getattr(setting.uncertainty, name) for name in ("h", "h_x", "h_t", "h_initial")},
        "seed": campaign.seed,
        "loops": [_drawn(item) for item in campaign.drawn],
        "attacks": [_attack(item, setting) for item in campaign.attacks],
        "obstacles": {
            "plan": [_clearance(item) for item in campaign.plan_clearance],
            "tube": [_clearance(item) for item in campaign.tube_clearance],
        },
    }


def _loop(loop: Loop) -> Data:
    gains, machine = loop.problem.gains, loop.problem.machine
    data: Data = {"controller": loop.controller, "gains_are": loop.origin}
    if loop.problem.control_rate is not None:
        data["control_rate"] = loop.problem.control_rate
    if gains is not None:
        predictor = np.asarray(gains.predictor_gain)
        data["gains"] = {
            "bandwidth": gains.bandwidth,
            "adaptation_rate": gains.adaptation_rate,
            "sample_time": gains.sample_time,
            "projection_radius": gains.projection_radius,
            "predictor_gain": predictor.tolist(),
        }
    if machine is not None:
        data["gains"] = {
            "bandwidth": _finite(machine.bandwidth),
            "adaptation_rate": None,
            "sample_time": machine.sample_time,
            "delay": machine.delay,
            "feedback_time": machine.feedback_time,
            "projection_radius": _finite(machine.radius),
            "predictor_gain": None,
        }
    if loop.caution:
        data["caution"] = loop.caution
    return data | {"covered": loop.promise is not None, "tested": loop.tested}


def _drawn(item: Drawn) -> Data:
    return {
        **_loop(item.loop),
        **_comparison(item.comparison),
        "obstacles": [_clearance(found) for found in item.clearance],
    }


def _attack(item: Attack, setting: Setting) -> Data:
    data = _loop(item.loop) | {"largest_distance_over_dbar": _finite(item.greatest / setting.reach)}
    if item.sample is not None and item.comparison is not None:
        data["random"] = {"asked": item.sample.asked, **_comparison(item.comparison)}
    if item.case is not None and item.worst_comparison is not None:
        member = item.case.member
        data["adversary"] = {
            **_comparison(item.worst_comparison),
            "start": item.case.start.tolist(),
            "h": {
                "amplitude": member.amplitude.tolist(),
                "frequency": member.frequency.tolist(),
                "wave": (member.wave @ setting.S).tolist(),
                "phase": member.phase.tolist(),
                "push": member.push,
            },
        }
        if member.beside is not None:
            beside = member.beside._asdict().items()
            data["adversary"]["beside"] = {name: part[0].tolist() for name, part in beside if name != "most"}
    return data


def _comparison(found: Comparison) -> Data:
    data: Data = {
        "runs": found.count,
        "left_the_tube": len(found.outside),
        "first_outside": list(found.outside[:20]),
        "first_exit": None if found.first_exit is None else _run_at(*found.first_exit),
        "no_result": len(found.unreliable),
        "unresolved": [_run_at(lane, t) for lane, t in found.unresolved[:20]],
        "stopped": [
            {"run": lane, "t": _finite(t), "reason": reason} for lane, t, reason in found.failures[:20]
        ],
        "worst": {name: _use(use) for name, use in found.uses.items()},
        "violations": [
            {
                "bound_of": item.name,
                "run": item.lane,
                "t": _finite(item.time),
                "value": _finite(item.value),
                "bound": item.bound,
            }
            for item in found.violations
        ],
        "settled": found.settled,
        "final_deviation": None if found.final is None else _finite(found.final),
        "error_estimate": found.error,
    }
    return data | ({"inputs": to_json(found.inputs)} if found.inputs else {})


def _run_at(lane: int, t: float) -> Data:
    return {"run": lane, "t": _finite(t)}


def _use(use: Use) -> Mapping[str, Any]:
    share = use.share
    return {
        "value": _finite(use.value),
        "bound": use.bound,
        "share": None if share is None else _finite(share),
        "run": use.lane,
        "t": _finite(use.time),
    }


def _clearance(item: Clearance) -> Data:
    return {
        "obstacle": item.obstacle,
        "clearance": _finite(item.value),
        "t": item.time,
        "collides": item.collides,
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
