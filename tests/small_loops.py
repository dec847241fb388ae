"""Small sampled loops, proven: tables by hand, stages by the theorem's own fixed point."""

import numpy as np
from handmade import source

from tubecert.loop_design.proposal import propose
from tubecert.model import build
from tubecert.sampled_loop.record import Claim, Nominal, Result, Tables
from tubecert.sampled_loop.remainders import Remainders
from tubecert.sampled_loop.setting import Loop
from tubecert.sampled_loop.theorem import check
from tubecert.spec import canonical, load_text
from tubecert.trajectory.make import plan_of

SCALAR = """
tubecert: 1
name: scalar
system: {states: [x], inputs: [u], f: ["0.5*x"], B: [[1]]}
safe_set: {x: [-5, 5]}
trajectory: {kind: equilibrium, at: [0], input: [0]}
initial_state: {at: [0.3]}
hardware: {sample_time: 0.1, delay: 0.04, noise: {x: 0.01}}
disturbance: {E: [[1]], bound: [0.2]}
limits: {u: [-3, 3]}
"""
POINT = "{kind: equilibrium, at: [0], input: [0]}"
WAVE = "{kind: expressions, x: ['sin(t)'], u: ['cos(t)'], horizon: 7, afterwards: repeat}"
AT_ONE = {"trajectory": "{kind: equilibrium, at: [1], input: [1]}", "initial_state": "{at: [1]}"}
RANGE = ", parameters: {p: [0.9, 1.1]}"
HOME = {
    "system": "{states: [x], inputs: [u], f: ['0'], B: [[1]]}",
    "safe_set": "{x: [-5000, 5000]}",
    "trajectory": POINT,
    "initial_state": "{at: [0]}",
    "hardware": "{sample_time: 0.1}",
}


def scalar(f: str = "0", B: str = "1", more: str = "") -> str:
    """The section `system` of x' = f + B u."""
    return f"{{states: [x], inputs: [u], f: ['{f}'], B: [['{B}']]{more}}}"


def text_of(**sections: str) -> str:
    """A specification: x' = u at rest, with some sections in place of those at home."""
    return "tubecert: 1\nname: a\n" + "\n".join(f"{k}: {v}" for k, v in {**HOME, **sections}.items())


def result_of(text: str, A: list, B: list, E: list, own: Tables, *, slow: bool = True) -> Result:
    """What is proven of a specification with these tables; the entries of its matrices in rows, one after another."""
    spec = load_text(text)
    n, m = len(spec.states), len(spec.inputs)
    shaped = (("A", A, n), ("B", B, m), ("E", E, len(E) // n))
    matrices = {name: np.array(value, dtype=float).reshape(n, size) for name, value, size in shaped}
    model = build(spec)
    loop = Loop(spec=spec, model=model, plan=plan_of(spec, model), knots=None, slow=slow, **matrices)
    inequalities, stages = propose(Remainders(loop, 64), own)
    found = check(loop, own, stages, inequalities.recipe)
    return Result(
        verdict=found.verdict,
        spec=source(canonical(spec)),
        claim=Claim(horizon=loop.horizon, afterwards=loop.afterwards, hold=loop.hold),
        nominal=Nominal(**matrices),
        controller=own,
        tube=stages,
        inputs=found.inputs,
        clearance=found.clearance,
        recipe=inequalities.recipe,
        lacks=found.lacks,
    )
