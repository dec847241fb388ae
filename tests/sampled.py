"""A certificate of a sampled loop, made by hand: what commands and pages are shown with, and no proof of anything."""

from dataclasses import replace
from fractions import Fraction

import numpy as np

from tubecert.certificate.effective import Effective
from tubecert.certificate.file import digest
from tubecert.sampled_loop.file import seal
from tubecert.sampled_loop.record import (
    Certificate,
    Claim,
    Cleared,
    HexMatrix,
    InputUse,
    Lack,
    Notes,
    Result,
    Shares,
    Source,
    Stage,
    Tables,
)
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
EFFECTIVE = {
    "tubecert": "1",
    "name": "cart",
    "system": {
        "states": ["p", "v"],
        "inputs": ["F"],
        "units": {"p": "m", "v": "m/s", "F": "N"},
        "parameters": {},
        "f": ["v", "-v"],
        "B": [["0"], ["1"]],
    },
    "safe_set": {"p": ["-1", "1"], "v": ["-2", "2"]},
    "uncertainty": {},
    "trajectory": {"kind": "equilibrium", "at": ["0", "0"], "input": ["0"]},
    "initial_state": {"at": ["0.1", "0"]},
    "tube": {"half_widths": {"p": "0.15"}},
    "obstacles": [{"states": ["p", "v"], "disc": {"center": ["0.9", "1.8"], "radius": "0.1"}}],
    "limits": {"F": ["-8", "8"]},
    "hardware": {
        "delay": "0.0005",
        "noise": {"p": "0.001", "v": "0.002"},
        "sample_time": "0.002",
        "arithmetic": "double",
        "hold": "middle",
    },
    "disturbance": {"E": [["0"], ["1"]], "bound": "0.05"},
    "controller": "auto",
}
WIDE = Shares(noise=0.01, holding=0.002, uncertainty=0.0, wind=0.02, start=0.1, remainder=0.0)
NARROW = Shares(noise=0.011, holding=0.002, uncertainty=0.0, wind=0.02, start=0.0, remainder=0.001)
PUSH = Shares(noise=0.7, holding=0.1, uncertainty=0.0, wind=0.4, start=1.9, remainder=0.0)


def matrix(*rows: list[float]) -> HexMatrix:
    return HexMatrix(np.array(rows, dtype=float).reshape(len(rows), -1))


def _stage(start: int, p: str, v: str, push: str) -> Stage:
    return Stage(
        start=start,
        half_widths={"p": Fraction(p), "v": Fraction(v)},
        deviations={"F": Fraction(push)},
        memory=(Fraction("0.3"),),
    )


def certificate(**changes: object) -> Certificate:
    """The certificate of the cart; `changes` are fields of its result."""
    result = Result(
        verdict=Verdict.CERTIFIED,
        spec=Source(
            effective=Effective.of(EFFECTIVE), effective_hash=digest(EFFECTIVE), file_hash="sha256:0"
        ),
        claim=Claim(horizon=None, afterwards="nothing", hold="middle"),
        controller=Tables(F=matrix([0.5]), G=matrix([1.0, 0.0]), M=matrix([-2.0]), N=matrix([-4.0, -3.0])),
        tube=(_stage(0, "0.13201", "0.5", "3.1"), _stage(800, "0.034", "0.2", "1.2")),
        inputs=(
            InputUse(
                input="F", range=(Fraction("-3.1"), Fraction("3.1")), limits=(Fraction(-8), Fraction(8))
            ),
        ),
        clearance=(Cleared(index=1, verdict=Verdict.CERTIFIED),),
    )
    notes = Notes(
        start={"p": WIDE, "v": WIDE},
        long_run={"p": NARROW, "v": NARROW},
        deviations={"F": PUSH},
        samples_t=(0.0,),
        samples_x=((0.0, 0.0),),
        samples_u=((0.0,),),
        evaluations=4_000,
    )
    return seal(replace(result, **changes), notes, {"command": "tubecert certify cart.yaml"})


def undecided(*lacks: Lack) -> Certificate:
    """The same where nothing was proven."""
    return certificate(
        verdict=Verdict.UNDECIDED, tube=(), inputs=(), clearance=(), controller=None, lacks=lacks
    )
