"""Certifications of shipped systems for tests of simulation, each made once."""

from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
from proven import barely
from shared import once
from systems import FLAT
from texts import CONFIGS

from tubecert import pipeline
from tubecert.certificate.result import Result
from tubecert.simulation.adaptive.continuous import DIVERGED
from tubecert.simulation.adaptive.engine import integrate
from tubecert.simulation.adaptive.loops import Cases, Disturbance, Found, Loop, Problem, Runs, Seen, Sizes
from tubecert.simulation.adaptive.setting import Setting, adopted, setting_of
from tubecert.spec import Spec, load, load_text


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


def alone(case: tuple[Problem, Loop], x0: np.ndarray, disturbance: Disturbance, *, tolerance: float) -> Runs:
    """Runs of a loop from x0 (N, n)."""
    cases = Cases(np.asarray(x0, dtype=float).T, disturbance)
    return integrate([(*case, cases)], tolerance=tolerance)[0]


def runs(
    t: np.ndarray,
    x: np.ndarray,
    distance: np.ndarray,
    m: int = 1,
    *,
    peaks: Any = None,
    least: Any = 0.0,
    greatest: Any = 0.0,
    ended: dict[int, float] | None = None,
    **changes: Any,
) -> Runs:
    """Runs by hand around a plan at 0: x (N, K, n), distance (N, K); other `peaks` (N,) with their times by name.

    `ended`: which lanes diverged, and when; `changes` of what else was found.
    """
    N, K, n = x.shape
    zero = np.zeros((N, K, m))
    sizes = {"distance": distance, "deviation": np.linalg.norm(x, axis=2)}
    sizes |= dict.fromkeys(("u", "k", "xtilde", "sigma_error", "speed"), np.zeros((N, K)))
    met = {name: (size.max(axis=1), t[size.argmax(axis=1)]) for name, size in sizes.items()}
    met |= {name: (np.array(value), np.array(time)) for name, (value, time) in (peaks or {}).items()}
    seen = {"x": x, "off": x, "slope": np.gradient(x, t, axis=1), "xtilde": 0 * x, "distance": distance}
    seen |= dict.fromkeys(("u", "k", "u_a", "sigma_hat", "h"), zero)
    over = {lane: (DIVERGED, t) for lane, t in (ended or {}).items()}
    why, when = zip(*(over.get(lane, (0, np.nan)) for lane in range(N)), strict=True)
    found = Found(
        seen=Seen(**{name: np.moveaxis(part, 0, -1).copy() for name, part in seen.items()}),
        peak=Sizes(**{name: value for name, (value, _) in met.items()}),
        peak_time=Sizes(**{name: time for name, (_, time) in met.items()}),
        least=np.zeros((m, N)) + least,
        greatest=np.zeros((m, N)) + greatest,
        stopped=np.array(why),
        ended=np.array(when),
        error=np.zeros(N),
        unresolved=np.full(N, np.nan),
        steps=np.ones(N, dtype=int),
    )
    return Runs(t=t, x_plan=np.zeros((K, n)), u_plan=np.zeros((K, m)), found=found._replace(**changes))
