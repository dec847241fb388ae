"""Certifications of shipped systems for tests of simulation, each made once."""

from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from proven import barely
from shared import once

from tubecert import pipeline
from tubecert.certificate.result import Result
from tubecert.simulation.adaptive.engine import integrate
from tubecert.simulation.adaptive.problem import Batch, Disturbance, LoopProblem
from tubecert.simulation.adaptive.reading import adopted
from tubecert.simulation.adaptive.runs import Failure, Peak, Runs, Worst
from tubecert.simulation.adaptive.setting import Setting, setting_of
from tubecert.spec import Spec, load, load_text

CONFIGS = Path(__file__).parent.parent / "configs"

FLAT = """
tubecert: 1
name: flat
system: {states: [p, v], inputs: [u], f: [v, "-p - v"], B: [[0], [1]]}
safe_set: {p: [-2, 2], v: [-2, 2]}
uncertainty: {h: ["0.2*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], horizon: 4}
initial_state: {at: [0.05, 0]}
metric: {rate: 0.4, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.2, rho_a: 0.2}
"""


@lru_cache
def certified(name: str, epsilon: str | None = None) -> tuple[Spec, Result]:
    """A specification and its result."""
    spec = load_text(FLAT) if name == "flat" else load(str(CONFIGS / f"{name}.yaml"))
    options = pipeline.Options(epsilon=None if epsilon is None else Fraction(epsilon))

    def make() -> Result:
        with barely():
            return pipeline.certify(spec, options)

    result = once(make, "simulated", name, epsilon)
    return adopted(spec, result), result


@lru_cache
def setting(name: str, epsilon: str | None = None, duration: str | None = None) -> Setting:
    """The setting of a specification."""
    spec, result = certified(name, epsilon)
    return setting_of(spec, result, None if duration is None else Fraction(duration))


def alone(problem: LoopProblem, x0: np.ndarray, disturbance: Disturbance, *, tolerance: float) -> Runs:
    """The runs of one batch."""
    batch = Batch(problem=problem, x0=np.asarray(x0, dtype=float), disturbance=disturbance)
    return integrate([batch], tolerance=tolerance)[0]


def runs(t: np.ndarray, x: np.ndarray, distance: np.ndarray, m: int = 1, **changes: Any) -> Runs:
    """Runs by hand around a plan at 0: x (N, K, n), distance (N, K); peaks follow from these."""
    N, K, n = x.shape
    deviation = np.linalg.norm(x, axis=2)
    lanes = np.arange(N)

    def peak(values: np.ndarray) -> Peak:
        at = values.argmax(axis=1)
        return Peak(value=values[lanes, at], time=t[at])

    none = np.zeros((N, K))
    peaks = {name: peak(none) for name in ("u", "k", "xtilde", "sigma_error", "h", "speed")}
    worst = Worst(
        **(peaks | {"distance": peak(distance), "deviation": peak(deviation)} | changes.pop("peaks", {}))
    )
    zero = np.zeros((N, K, m))
    values: dict[str, Any] = {
        "t": t,
        "x": x,
        "slope": np.gradient(x, t, axis=1),
        "x_plan": np.zeros((K, n)),
        "u_plan": np.zeros((K, m)),
        "k": zero,
        "u_a": zero,
        "sigma_hat": zero,
        "h": zero,
        "xtilde": np.zeros((N, K, n)),
        "distance": distance,
        "worst": worst,
        "least": np.zeros((N, m)),
        "greatest": np.zeros((N, m)),
        "error": np.zeros(N),
        "unresolved": np.full(N, np.nan),
        "failures": (),
        "steps": np.ones(N),
    }
    return Runs(**(values | changes))


__all__ = ["FLAT", "Failure", "Peak", "certified", "runs", "setting"]
