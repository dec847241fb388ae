"""Compilation of the loops: told while it lasts, kept where there is a folder; runs end when the user interrupts."""

import signal
import threading
import time
from dataclasses import replace
from fractions import Fraction
from importlib import import_module
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import caching
from systems import matrix_of, plain_model

from tubecert.expression import sin, symbol
from tubecert.progress import Phase
from tubecert.simulate.compiled import KERNELS, compiled, entry, told
from tubecert.simulate.integrator import integrate
from tubecert.simulate.problem import Disturbance, LoopGains, LoopProblem
from tubecert.trajectory.plan import constant_plan

T = symbol("t")


def fresh_kernel():
    """A kernel that no cache has, and that needs another one."""

    @compiled
    def doubled(x):
        return 2 * x

    @entry
    def kernel(x):
        return doubled(x) + 1

    return kernel


def nowhere(monkeypatch):
    """No folder can be written to: not the package's, not the user's."""
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    with pytest.raises(RuntimeError, match="cannot cache"):
        numba.njit(cache=True)(lambda x: x)


@pytest.mark.slow
def test_kernels_compile_where_nothing_can_be_kept(monkeypatch):
    nowhere(monkeypatch)
    kernel = fresh_kernel()
    assert kernel(20.0) == 41.0
    assert not kernel.stats.cache_path


@pytest.mark.slow
def test_compilation_is_told(monkeypatch):
    nowhere(monkeypatch)
    heard = []
    kernel = fresh_kernel()
    with told(heard.append):
        kernel(1.0)
        assert heard == []  # kernels of others do not count
        kernel.py_func.__module__ = f"{entry.__module__}.x"
        kernel(np.float32(1))
        kernel(1.0)
    assert [(step.phase, step.done) for step in heard] == [(Phase.COMPILATION, 1)]
    kernel(np.int8(1))
    assert len(heard) == 1
    with told(None):
        kernel(np.int16(1))


def test_every_file_with_a_kernel_counts_for_the_cache():
    package = Path(import_module("tubecert.simulate").__file__).parent
    found = {path.stem for path in package.glob("*.py") if "compiled import" in path.read_text("utf-8")}
    assert found - {"monte_carlo", "campaign"} <= set(KERNELS)


def _of_1000_seconds(adaptation_rate):
    W = matrix_of([["(2 + sin(x1))**2"]], ("x1",))
    model = replace(plain_model(("x1",), ("-x1",), [["2 + sin(x1)"]]), W=W, rate=Fraction(1))
    problem = LoopProblem(
        model=model,
        plan=constant_plan([Fraction(0)], [Fraction(0)], None),
        controller="l1",
        horizon=1000.0,
        times=np.linspace(0, 1000, 3),
        gains=LoopGains(bandwidth=5.0, projection_radius=50.0, adaptation_rate=adaptation_rate),
    )
    return problem, np.full((4, 1), 0.1), Disturbance.from_expressions((sin(T),), model, 4)


@pytest.mark.slow
def test_what_is_stopped_by_the_length_of_its_steps_is_given_shorter_ones():
    """Both of the first two levels, of 16 s and 8 s a step, left the metric's geodesics in their first step."""
    problem, starts, h = _of_1000_seconds(1e2)
    runs = integrate(problem, starts, h, tolerance=1.0)
    assert not runs.failures
    assert (runs.error < 1.0).all()


@pytest.mark.slow
def test_an_interruption_ends_runs_that_would_take_minutes():
    """The lanes resolve 2e4 rad/s over 1000 s; Ctrl-C comes after a moment."""
    problem, starts, h = _of_1000_seconds(1e8)
    short = replace(problem, horizon=1e-4, times=np.array([0.0, 1e-4]))
    integrate(short, starts, h, tolerance=1.0)  # compiles
    pressed = []

    def press():
        pressed.append(time.perf_counter())
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    timer = threading.Timer(0.5, press)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            integrate(problem, starts, h, tolerance=1e-8)
    finally:
        timer.cancel()
    assert time.perf_counter() - pressed[0] < 2.0
