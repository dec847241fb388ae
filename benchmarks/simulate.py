"""Simulation against scipy, as ratios measured in one run; see benchmarks/README.md.

Usage: python benchmarks/simulate.py [three] [two] [lanes] [geodesics] [start]
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
W0 = np.array([[0.20365, 0.00015, -0.00566], [0.00015, 0.21671, -0.00566], [-0.00566, -0.00566, 0.21607]])
W1 = np.array([[0, -0.4073, -0.00133], [-0.4073, -0.00061, 0.00998], [-0.00133, 0.00998, 0.06785]])
W2 = np.array([[0, 0, 0.00053], [0, 0.81459, 0.00308], [0.00053, 0.00308, 0.00343]])
FLAT = np.linalg.inv(np.array([[4.25828, -0.93423], [-0.93423, 3.76692]]))


def seconds(work: Callable[[], Any], runs: int = 3) -> tuple[float, Any]:
    """Median processor time and the last value: what else the machine does shall not count."""
    times, value = [], None
    for _ in range(runs):
        start = time.process_time()
        value = work()
        times.append(time.process_time() - start)
    return statistics.median(times), value


def curved(degree: int = 5) -> Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]:
    """E, M gamma_s at both ends from 0 to x for the three-state metric, in plain numpy: Newton with exact Hessian."""
    from tubecert.simulate.geodesic import _polynomials

    s, weight, *rest = _polynomials(degree)
    phi, slope = np.array(rest[: degree - 1]), np.array(rest[degree - 1 :])
    memory = {"a": np.zeros((degree - 1, 3))}

    def solve(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        a = memory["a"]
        for _ in range(20):
            g = np.outer(s, x) + phi.T @ a
            v = x + slope.T @ a
            p = g[:, 0, None, None]
            M = np.linalg.inv(W0 + p * W1 + p * p * W2)
            dW, ddW = W1 + 2 * p * W2, 2 * W2
            m = np.einsum("qij,qj->qi", M, v)
            q = np.einsum("qij,qj->qi", dW, m)
            r = np.einsum("qij,qj->qi", M, q)
            by_x = -np.einsum("qi,qi->q", m, q)
            gradient = 2 * np.einsum("q,kq,qi->ki", weight, slope, m)
            gradient[:, 0] += phi @ (weight * by_x)
            H = 2 * np.einsum("q,kq,lq,qij->kilj", weight, slope, slope, M)
            mixed = -2 * np.einsum("q,kq,lq,qj->klj", weight, phi, slope, r)
            H[:, 0] += mixed
            H[:, :, :, 0] += np.transpose(mixed, (1, 2, 0))
            second = 2 * np.einsum("qi,qi->q", q, r) - np.einsum("qi,ij,qj->q", m, ddW, m)
            H[:, 0, :, 0] += np.einsum("q,kq,lq->kl", weight * second, phi, phi)
            size = gradient.size
            step = np.linalg.solve(H.reshape(size, size), gradient.ravel())
            energy = weight @ np.einsum("qi,qi->q", v, m)
            if gradient.ravel() @ step <= 1e-20 * energy:
                break
            a = a - step.reshape(a.shape)
        memory["a"] = a
        return float(energy), m[0], m[-1]

    return solve


def loop_rate(
    f: Callable[[np.ndarray], np.ndarray],
    B: np.ndarray,
    rate: float,
    covector: Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]],
    h: Callable[[float, np.ndarray], float],
    *,
    gains: tuple[float, float],
) -> Callable[[float, np.ndarray], np.ndarray]:
    """The L1 loop around the plan 0 in numpy, A_m = -I: z = (x, xtilde, sigma_hat, u_a)."""
    omega, Gamma = gains
    n = len(B)

    def derivative(t: float, z: np.ndarray) -> np.ndarray:
        x, xt, s, u = z[:n], z[n : 2 * n], z[2 * n], z[2 * n + 1]
        energy, _, end = covector(x)
        fx = f(x)
        phi0, phi1 = 2 * end @ fx + 2 * rate * energy, 2 * B @ end
        k = -phi0 / phi1 if phi0 > 0 else 0.0
        d = h(t, x)
        out = np.empty_like(z)
        out[:n] = fx + B * (k + u + d)
        out[n : 2 * n] = -xt + B * (s - d)
        out[2 * n] = -Gamma * (B @ xt)
        out[2 * n + 1] = -omega * (u + s)
        return out

    return derivative


def three_drift(x: np.ndarray) -> np.ndarray:
    """f of the three-state system."""
    return np.array([-x[0] + x[2], x[0] ** 2 - 2 * x[0] * x[2] - x[1] + x[2], -x[1]])


def two_drift(x: np.ndarray) -> np.ndarray:
    """f of the two-state system."""
    return np.array([-x[0] + 2 * x[1], -0.25 * x[1] ** 3 - 3 * x[0] + 4 * x[1]])


def straight(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """The same for the two-state metric."""
    m = FLAT @ x
    return float(x @ m), m, m


def case(name: str, Gamma: float, omega: float, horizon: float) -> tuple[Any, Any, np.ndarray]:
    """Problem, disturbance of one lane and start; the plan is the origin, as in the numpy loops."""
    from tubecert.model import build
    from tubecert.simulate.problem import Disturbance, LoopGains, LoopProblem
    from tubecert.spec import load
    from tubecert.trajectory import constant_plan

    model = build(load(str(ROOT / "configs" / f"{name}.yaml")))
    gains = LoopGains(bandwidth=omega, projection_radius=100.0, adaptation_rate=Gamma)
    n = len(model.states)
    problem = LoopProblem(
        model=model,
        plan=constant_plan([0] * n, [0], None),
        controller="l1",
        horizon=horizon,
        times=np.linspace(0, horizon, 51),
        gains=gains,
    )
    start = np.array([[0.01, -0.01, 0.01] if n == 3 else [0.4, -0.3]])
    return problem, Disturbance.from_expressions(model.h, model, 1), start


def against_scipy(
    title: str,
    built: tuple[Any, Any, np.ndarray],
    rate: Callable[..., np.ndarray],
    tolerance: float,
    most: float,
) -> None:
    """Our time and error beside those of scipy's stiff solvers, stopped after `most` seconds."""
    from scipy.integrate import solve_ivp

    from tubecert.simulate.integrator import integrate, ladder

    problem, disturbance, start = built
    integrate(problem, start, disturbance, tolerance=1.0)  # compiles

    def whole() -> Any:
        ladder.cache_clear()
        return integrate(problem, start, disturbance, tolerance=tolerance)

    ours, found = seconds(whole)
    exact = integrate(problem, start, disturbance, tolerance=tolerance * 1e-3)
    own = np.abs(found.x - exact.x).max()
    print(f"{title}: {ours:.3f} s, {found.steps[0]} steps, estimate {found.error[0]:.1e}, error {own:.1e}")
    z0 = np.concatenate([start[0], np.zeros(start.shape[1] + 2)])
    for method in ("Radau", "LSODA"):
        begin = time.process_time()

        def watched(t: float, z: np.ndarray, begin: float = begin) -> np.ndarray:
            if time.process_time() - begin > most:
                raise TimeoutError(t)
            return rate(t, z)

        try:
            done = solve_ivp(
                watched, (0, problem.horizon), z0, method=method, t_eval=problem.times, rtol=1e-4, atol=1e-6
            )
            theirs = time.process_time() - begin
            wrong = np.abs(done.y[: start.shape[1]].T - exact.x[0]).max()
            print(f"  {method} {theirs:.2f} s, error {wrong:.1e}: {theirs / ours:.0f} x")
        except TimeoutError as late:
            reached = float(late.args[0]) / problem.horizon
            print(
                f"  {method} stopped after {most:.0f} s at {reached:.1%} of the time: over {most / ours:.0f} x"
            )


def three() -> None:
    """The three-state system, T = 10, Gamma 5e6, a geodesic in every evaluation."""
    B = np.array([0.0, 0.0, 1.0])
    rate = loop_rate(
        three_drift, B, 0.9999, curved(), lambda t, x: 0.1 * float(np.sin(2 * t)), gains=(50.0, 5e6)
    )
    for tolerance in (1e-4, 1e-6):
        against_scipy(
            f"three-state, to {tolerance:g}", case("three_state", 5e6, 50.0, 10.0), rate, tolerance, 10.0
        )


def two() -> None:
    """The two-state system, T = 5, at two adaptation rates."""
    B = np.array([0.5, -2.0])

    def h(t: float, x: np.ndarray) -> float:
        return float(-2 * np.sin(2 * t) - 0.1 * np.sqrt(x @ x))

    for Gamma, omega in ((4e7, 90.0), (2e9, 51.0)):
        rate = loop_rate(two_drift, B, 1.74, straight, h, gains=(omega, Gamma))
        against_scipy(
            f"two-state, Gamma {Gamma:g}", case("two_state_orbit", Gamma, omega, 5.0), rate, 1e-5, 10.0
        )


def lanes() -> None:
    """Monte Carlo: runs per second at gains of the distance certificate, to a thousandth of its rho."""
    from tubecert.simulate.integrator import integrate
    from tubecert.simulate.problem import Disturbance

    for name, Gamma, omega, horizon, N, rho in (
        ("two_state_orbit", 6e4, 26.0, 5.0, 512, 0.7),
        ("three_state", 9e4, 10.0, 10.0, 128, 0.04),
    ):
        problem, _, start = case(name, Gamma, omega, horizon)
        n = start.shape[1]
        rng = np.random.default_rng(0)
        size = 0.1 if n == 3 else 2.0
        waves = Disturbance(
            base=None,
            amplitude=rng.normal(size=(N, 3, 1)) * size / 4,
            frequency=rng.uniform(0, 4, (N, 3)),
            wave=rng.normal(size=(N, 3, n)) * 0.1,
            phase=rng.uniform(0, 6.3, (N, 3)),
            push=np.zeros(N),
            radius=np.full(N, size),
            centre=np.zeros(n),
        )
        starts = np.repeat(start, N, axis=0)
        integrate(problem, starts[:2], waves.of(np.arange(2)), tolerance=1e-3 * rho)
        begin, busy = time.perf_counter(), time.process_time()
        found = integrate(problem, starts, waves, tolerance=1e-3 * rho)
        spent, used = time.perf_counter() - begin, time.process_time() - busy
        print(
            f"{name}: {N / used:.0f} runs of {horizon:g} s per second of processor time, {N / spent:.0f} per second on "
            f"all cores as busy as they are; {len(found.failures)} failed, "
            f"largest error estimate {found.error.max():.1e}"
        )


def geodesics() -> None:
    """Geodesics per second on one core, cold and warm, against numpy."""
    from tubecert.model import build
    from tubecert.simulate.geodesic import metric, solve_all
    from tubecert.spec import load

    space, memory = metric(build(load(str(ROOT / "configs" / "three_state.yaml"))))
    rng = np.random.default_rng(0)
    N = 20_000
    status, energy = np.zeros(N, dtype=np.int64), np.zeros(N)
    far = rng.uniform(-0.1, 0.1, (N, 3))
    near = np.array([0.05, -0.05, 0.05]) + 1e-4 * np.cumsum(rng.normal(size=(N, 3)), axis=0)
    origin = np.zeros((N, 3))
    solve_all(space, memory, origin[:2], far[:2], status, energy)
    plain = curved()
    slow, _ = seconds(lambda: [plain(x) for x in near[:300]])
    for title, ends in (("random ends", far), ("warm starts", near)):
        spent, _ = seconds(lambda: solve_all(space, memory, origin, ends, status, energy))  # noqa: B023
        print(
            f"geodesics, {title}: {N / spent:.0f}/s, {spent / N * 1e6:.1f} us ({np.sum(status != 0)} refused); "
            f"numpy {slow / 300 * 1e6:.0f} us: {slow / 300 * N / spent:.0f} x"
        )


def start() -> None:
    """What a user waits for: the first simulation after the installation, and every later one."""
    import os
    import tempfile

    script = (
        "import sys, time; sys.path.insert(0, 'benchmarks'); import simulate;"
        "from tubecert.simulate.integrator import integrate;"
        "p, d, x = simulate.case(sys.argv[1], 5e6, 50.0, 1.0); integrate(p, x, d, tolerance=1e-4);"
        "print(time.process_time())"
    )
    for name in ("two_state_orbit", "three_state"):
        with tempfile.TemporaryDirectory() as folder:
            for title in ("first", "later"):
                done = subprocess.run(
                    [sys.executable, "-c", script, name],
                    capture_output=True,
                    text=True,
                    check=True,
                    cwd=ROOT,
                    env={**os.environ, "NUMBA_CACHE_DIR": folder},
                )
                print(f"{name}, {title} start: {float(done.stdout):.1f} s of processor time")


if __name__ == "__main__":
    parts = {"three": three, "two": two, "lanes": lanes, "geodesics": geodesics, "start": start}
    for part in sys.argv[1:] or parts:
        parts[part]()
