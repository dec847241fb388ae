"""Certificates of small loops, made by hand: what is proven of them is not true, and code does not care."""

import hashlib
from fractions import Fraction

import numpy as np

from tubecert.certificate.effective import Effective
from tubecert.certificate.file import digest
from tubecert.expression import number_text
from tubecert.sampled_loop.record import (
    Certificate,
    Claim,
    InputUse,
    Nominal,
    Notes,
    Recipe,
    Result,
    Source,
    Stage,
    Tables,
    seal,
)
from tubecert.spec import Knots, canonical, load_text
from tubecert.verdict import Verdict

REST = "{kind: equilibrium, at: [0.5, 0], input: [0.5]}"
WAVE = "{kind: expressions, x: [sin(t), cos(t)], u: [cos(t)/3 + 0.1*sin(2*t)**2], horizon: 1.01%s}"
ANY = "{kind: any, x: {p: [-1, 1], v: [-1, 1]}, u: {F: [-1, 1]}, defect: 0, horizon: 1}"
SPEC = """
tubecert: 1
name: cart
system: {states: [p, v], inputs: [F], f: [v, "-v"], B: [[0], [1]]}
safe_set: {p: [-2, 2], v: [-2, 2]}
trajectory: TRAJECTORY
hardware: {sample_time: 0.02, delay: 0.005, noise: {p: 0.001, v: 0.002}, arithmetic: ARITHMETIC, hold: HOLD}
initial_state: START
limits: {F: [-8, 8]}
"""


def source(data: dict[str, object], text: str = "", **changes: object) -> Source:
    """Where a canonical specification comes from."""
    file_hash = f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"
    return Source(effective=Effective.of(data), effective_hash=digest(data), file_hash=file_hash, **changes)


def tables(z: int, seed: int = 0, n: int = 2, m: int = 1) -> Tables:
    """Tables of single precision of a controller with z states, n measured ones, m inputs."""
    draw = np.random.default_rng(seed)
    sizes = {"F": (z, z), "G": (z, n), "M": (m, z), "N": (m, n)}
    drawn = {name: draw.uniform(-1, 1, size).astype(np.float32) for name, size in sizes.items()}
    drawn["F"] /= np.float32(2 * z + 1)  # stable
    return Tables(**{name: matrix.astype(float) for name, matrix in drawn.items()})


def no_controller() -> Tables:
    """Tables that add nothing."""
    own = tables(0)
    own.N[:] = 0
    return own


def certificate(
    trajectory: str = REST,
    *,
    z: int = 2,
    arithmetic: str = "double",
    hold: str = "middle",
    afterwards: str = "nothing",
    planned: Knots | None = None,
    controller: Tables | None = None,
    **changes: object,
) -> Certificate:
    """The certificate of a cart along a trajectory; `changes` are further fields of the result."""
    start = "{within: 0.1}" if "any" in trajectory else "{at: [0, 1]}"
    words = {"TRAJECTORY": trajectory, "ARITHMETIC": arithmetic, "HOLD": hold, "START": start}
    text = SPEC
    for word, value in words.items():
        text = text.replace(word, value)
    data = canonical(load_text(text))
    if planned is not None:  # through knots, as from a planner
        data["trajectory"] = {"kind": "csv", "file": "plan.csv", "interpolation": planned.interpolation}
        data["trajectory"] |= {"horizon": number_text(planned.t[-1]), "afterwards": afterwards}
    stages = [(0, "0.3", "0.5"), (40, "0.2", "0.6")]
    fields = {
        "verdict": Verdict.CERTIFIED,
        "spec": source(data),
        "claim": Claim(horizon=None, afterwards=afterwards, hold=hold),
        "planned": planned,
        "nominal": Nominal(**{name: np.zeros((2, size)) for name, size in (("A", 2), ("B", 1), ("E", 0))}),
        "recipe": Recipe(lags=1, cuts=((),) * (3 + z), pieces=1, panels=1, windows=1, parameters="slow"),
        "controller": tables(z) if controller is None else controller,
        "tube": tuple(
            Stage(
                start=start,
                half_widths={"p": Fraction(p), "v": Fraction(v)},
                deviations={"F": Fraction(4)},
                memory=(Fraction("0.3"),) * z,
            )
            for start, p, v in stages
        ),
        "inputs": (InputUse(input="F", range=(Fraction("-3.1"), Fraction("3.3"))),),
    }
    return seal(Result(**(fields | changes)), Notes(), {})


def held_knots() -> Knots:
    """u* jumps at t = .1 and .2; x* is at rest at the knots."""
    rest = (Fraction(0), Fraction(0))
    t, u = (Fraction(0), Fraction("0.1"), Fraction("0.2")), ((Fraction(1),), (Fraction(2),), (Fraction(3),))
    return Knots(t=t, x=(rest,) * 3, u=u, interpolation="hold")
