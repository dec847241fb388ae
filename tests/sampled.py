"""Certificates of sampled loops with everything that can be shown, made by hand: no proof of anything."""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

import handmade

from tubecert.sampled_loop.record import (
    Certificate,
    Claim,
    Cleared,
    InputUse,
    Lack,
    Notes,
    Result,
    Shares,
    Stage,
    seal,
)
from tubecert.spec import canonical, load_text
from tubecert.verdict import Verdict

SPEC = """
tubecert: 1
name: cart
system: {states: [p, v], inputs: [F], units: {p: m, v: m/s, F: N}, f: [v, "-v"], B: [[0], [1]]}
safe_set: {p: [-1, 1], v: [-2, 2]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
initial_state: {at: [0.1, 0]}
hardware: {rate: 500, delay: 0.0005, noise: {p: 0.001, v: 0.002}}
disturbance: {E: [[0], [1]], bound: 0.05}
limits: {F: [-8, 8]}
tube: {half_widths: {p: 0.15}}
obstacles: [{states: [p, v], disc: {center: [0.9, 1.8], radius: 0.1}}]
"""
POINT = "{kind: equilibrium, at: [0, 0], input: [0]}"
FAMILY = SPEC.replace(
    POINT,
    "{kind: any, x: {p: [-0.2, 0.2], v: [0, 0]}, u: {F: [-1, 1]}, input_rate: 2}",
).replace("{at: [0.1, 0]}", "{within: 0.1}")
DRONE = """
tubecert: 1
name: drone
system:
  states: [px, pz, phi, vx, vz, rate]
  inputs: [left, right]
  units: {px: m, pz: m, phi: rad, vx: m/s, vz: m/s, rate: rad/s, left: N, right: N}
  f: [vx, vz, rate, -10*phi, 0, 0]
  B: [[0, 0], [0, 0], [0, 0], [0, 0], [1, 1], [3, -3]]
safe_set: {px: [-9, 9], pz: [-9, 9], phi: [-1, 1], vx: [-9, 9], vz: [-9, 9], rate: [-9, 9]}
trajectory: {kind: equilibrium, at: [0, 0, 0, 0, 0, 0], input: [0, 0]}
initial_state: {box: {px: [-0.1, 0.1], pz: [-0.1, 0.1], phi: [0, 0], vx: [0, 0], vz: [0, 0], rate: [0, 0]}}
hardware: {rate: 200, delay: one sample, noise: {px: 0.005, pz: 0.005, phi: 0.005, vx: 0.02, vz: 0.02, rate: 0.02}}
limits: {left: [-5, 5], right: [-5, 5]}
tube: {half_widths: {px: 0.5, pz: 0.5}}
obstacles: [{states: [px, pz], disc: {center: [5, 5], radius: 0.1}}]
"""
WIDE = Shares(noise=0.01, holding=0.002, uncertainty=0.0, wind=0.02, start=0.1, remainder=0.0)
NARROW = Shares(noise=0.011, holding=0.002, uncertainty=0.0, wind=0.02, start=0.0, remainder=0.001)
PUSH = Shares(noise=0.7, holding=0.1, uncertainty=0.0, wind=0.4, start=1.9, remainder=0.0)


def certificate(text: str = SPEC, settings: Mapping[str, str] | None = None, **changes: Any) -> Certificate:
    """The certificate of a specification: 0.13201 wide at the start, .034 in the long run; `changes` of its result."""
    spec = load_text(text)
    (states, inputs), ends = (spec.states, spec.inputs), (Fraction("-3.1"), Fraction("3.1"))

    def stage(start: int, wide: str, push: str) -> Stage:
        sizes = {"half_widths": dict.fromkeys(states, Fraction(wide))}
        sizes["deviations"] = dict.fromkeys(inputs, Fraction(push))
        return Stage(start=start, **sizes, memory=(Fraction("0.3"),))

    result = Result(
        verdict=Verdict.CERTIFIED,
        spec=handmade.source(canonical(spec), text, settings=settings or {}),
        claim=Claim(horizon=None, afterwards="nothing", hold="middle"),
        controller=handmade.tables(1, n=len(states), m=len(inputs)),
        tube=(stage(0, "0.13201", "3.1"), stage(800, "0.034", "1.2")),
        inputs=tuple(InputUse(input=name, range=ends, limits=own) for name, own in spec.limits),
        clearance=tuple(Cleared(index=i, verdict=Verdict.CERTIFIED) for i in range(len(spec.obstacles))),
    )
    points = {"samples_t": (0.0,), "samples_x": ((0.0,) * len(states),), "samples_u": ((0.0,) * len(inputs),)}
    notes = Notes(
        start=dict.fromkeys(states, WIDE),
        long_run=dict.fromkeys(states, NARROW),
        deviations=dict.fromkeys(inputs, PUSH),
        evaluations=4_000,
        **(points if spec.trajectory.bundle is None else {}),
    )
    return seal(replace(result, **changes), notes, {"command": "tubecert certify cart.yaml"})


def undecided(*lacks: Lack, **changes: Any) -> Certificate:
    """The same where nothing is certified, though a tube was proposed."""
    return certificate(verdict=Verdict.UNDECIDED, lacks=lacks, **changes)
