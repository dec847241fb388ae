"""Certificates of small sampled loops for tests of the checker: tables by hand, the producer's fixed point."""

import copy
import json
from functools import cache

import numpy as np
from rechecked import digest, failing
from small_loops import SCALAR, result_of

from tubecert.errors import TubecertError
from tubecert.recheck.run import Recheck, recheck
from tubecert.sampled_loop.record import Notes, Tables, certificate_text, seal
from tubecert.spec import load_text

CART = """
tubecert: 1
name: cart
system: {states: [p, v], inputs: [F], f: [v, "0.1*p**2"], B: [[0], [1]], outputs: {far: "p + v"}}
safe_set: {p: [-9, 9], v: [-9, 9]}
uncertainty: {h: ["0.2*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
initial_state: {box: {p: [-0.1, 0.1], v: [-0.1, 0.1]}}
hardware: {rate: 20, delay: 0.12, noise: 0.001}
disturbance: {E: [[0], [1]], bound: 0.1}
tube: {half_widths: {p: 1, far: 2}}
obstacles:
  - {states: [p, v], disc: {center: [2, 2], radius: 0.5}}
  - {states: [p, v], polygon: [[2, -1], [3, -1], [3, 1]]}
"""
SWING = """
tubecert: 1
name: swing
system: {states: [q], inputs: [u], parameters: {c: [0.9, 1.1]}, f: ["-c*q"], B: [["1 + 0.1*q"]]}
safe_set: {q: [-2, 2]}
uncertainty: {h: ["0.05*sin(3*t) + 0.02*q"]}
trajectory:
  kind: expressions
  x: ["sin(t)"]
  u: ["(cos(t) + sin(t))/(1 + 0.1*sin(t))"]
  horizon: 6.3
  afterwards: repeat
initial_state: {at: [0]}
hardware: {rate: 10, delay: one sample, hold: left, arithmetic: single}
"""
FAMILY = """
tubecert: 1
name: family
system: {states: [y, v], inputs: [a], f: [v, "-0.1*v**3"], B: [[0], [1]]}
safe_set: {y: [-9, 9], v: [-2, 2]}
trajectory: {kind: any, x: {y: [-5, 5], v: [-1, 1]}, u: {a: [-1, 1]}, defect: 0.01, input_rate: {a: 2}}
initial_state: {within: 0.1}
uncertainty: {bounds: {h: 0.1}}
hardware: {rate: 20, noise: 0.001}
"""
FAR = """
tubecert: 1
name: far
system: {states: [x], inputs: [u], f: ["-x"], B: [[1]]}
safe_set: {x: [900, 1100]}
trajectory: {kind: equilibrium, at: [1000], input: [1000]}
initial_state: {at: [1000]}
hardware: {rate: 10, delay: 0.05, arithmetic: single}
"""
SPRING = """
tubecert: 1
name: spring
system: {states: [x, v], inputs: [F], parameters: {m: [0.9, 1.1]}, f: [v, "-10*x/m"], B: [[0], [1/m]]}
safe_set: {x: [-1, 1], v: [-3, 3]}
trajectory: {kind: equilibrium, at: [0.1, 0], input: [1]}
hardware: {rate: 200, noise: {x: 0.001, v: 0.01}}
"""
PAIR = """
tubecert: 1
name: pair
system:
  states: [p, q]
  inputs: [a, b]
  parameters: {c: [0.98, 1.02]}
  f: ["-0.2*q", "0.1*p - 0.1*q**3"]
  B: [[1, 0.1], [0, "c"]]
safe_set: {p: [-3, 3], q: [-3, 3]}
uncertainty: {h: ["0.1*sin(2*t)", "0.05*p"]}
disturbance: {E: [[1, 0], [0.5, 1]], bound: 0.05}
trajectory: {kind: equilibrium, at: [0, 0], input: [0, 0.1]}
initial_state: {within: 0.05}
hardware: {sample_time: 0.1, delay: 0.14, noise: 0.002, arithmetic: single}
"""


def tables(N, F=(), G=(), M=()) -> Tables:
    N = np.atleast_2d(np.array(N, dtype=np.float32).astype(float))
    (m, n), z = N.shape, len(F)
    shaped = ((F, (z, z)), (G, (z, n)), (M, (m, z)))
    own = [np.array(np.float32(value), dtype=float).reshape(shape) for value, shape in shaped]
    return Tables(*own, N)


@cache
def _proven(text: str, gain: tuple, slow: bool) -> str:
    name = load_text(text).name
    return certificate_text(seal(result_of(text, *MATRICES[name], tables(*gain), slow=slow), Notes(), {}))


MATRICES = {
    "scalar": ([0.5], [1], [1]),
    "cart": ([0, 1, 0, 0], [0, 1], [0, 1]),
    "swing": ([-1], [1], []),
    "family": ([0, 1, 0, -0.1], [0, 1], []),
    "far": ([-1], [1], []),
    "spring": ([0, 1, -10, 0], [0, 1], []),
    "pair": ([0, -0.2, 0.1, 0], [1, 0.1, 0, 1], [1, 0, 0.5, 1]),
}
GAINS = {
    SCALAR: ([[-3]],),
    CART: ([[-1.5, -2]], [[0.5]], [[0, 0.1]], [[-0.1]]),
    SWING: ([[-2]],),
    FAMILY: ([[-4, -4]],),
    FAR: ([[-1]],),
    SPRING: ([[-50, -12]],),
    PAIR: ([[-2, 0], [0, -2]], [[0.25]], [[0.5, 0.25]], [[0.5], [-0.25]]),
}


def made(text: str, *, base: str | None = None, slow: bool = True) -> dict:
    """A certificate, as JSON; `base`: whose tables and matrices it has."""
    gain = json.loads(json.dumps(GAINS[base or text]), object_hook=dict)
    frozen = tuple(tuple(map(tuple, value)) for value in gain)
    return json.loads(_proven(text, frozen, slow))


def changed(document: dict, *path, to) -> dict:
    """With another value at a place (or what a function makes of the one that is there), hashes made right again."""
    found = copy.deepcopy(document)
    place = found["result"]
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = to(place[path[-1]]) if callable(to) else to
    return resealed(found)


def resealed(document: dict) -> dict:
    spec = document["result"].get("spec", {})
    if {"effective", "effective_hash"} <= spec.keys():
        spec["effective_hash"] = digest(spec["effective"])
    return {**document, "hash": digest(document["result"])}


def examine(document: dict, **options) -> Recheck:
    return recheck(json.dumps(document), "certificate", **options)


def why_not(document: dict) -> list[str]:
    """The claims that do not hold; or the code with which reading ends."""
    return [code] if (code := code_of(document)) else [name for name, _ in failing(examine(document))]


def code_of(document: dict) -> str:
    """Of the error with which reading ends, or nothing."""
    try:
        examine(document, seconds=0, to_first_failure=True)
    except TubecertError as error:
        return error.findings[0].code
    return ""
