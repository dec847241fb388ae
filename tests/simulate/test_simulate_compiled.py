"""Compilation of the loops: told while it lasts, kept where there is a folder; runs end when the user interrupts."""

import signal
import threading
import time
from dataclasses import replace
from fractions import Fraction
from importlib import import_module
from pathlib import Path

import mpmath
import numba
import numpy as np
import pytest
from numba.core import caching
from scipy.interpolate import CubicHermiteSpline
from systems import matrix_of, plain_model

from tubecert.expression import Lookup, derivative, norm, parse, sin, symbol
from tubecert.expression.scan import SMOOTH
from tubecert.progress import Phase
from tubecert.simulate.compiled import KERNELS, compiled, entry, told
from tubecert.simulate.integrator import integrate
from tubecert.simulate.problem import Disturbance, LoopGains, LoopProblem
from tubecert.simulate.program import assemble, execute
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
    assert found - {"attack", "campaign", "engine"} <= set(KERNELS)


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


# compiled programs against mpmath: every function of the language has its own step

POINTS = (0.03, 0.4, 0.97)


@entry
def run(steps, count, memory):
    """Python cannot call a kernel that other kernels call."""
    execute(steps, count, memory)


@pytest.mark.parametrize("name", SMOOTH)
def test_every_function_is_its_own(name):
    e = parse(f"{name}(x) + 2*y", symbols={"x": symbol("x"), "y": symbol("y")}).expression
    program, memory = assemble([e, norm([e])], ["x", "y"])
    for x in POINTS:
        memory[:2] = x, -1.0
        run(program.steps, len(program.steps), memory)
        exact = float(getattr(mpmath, name)(mpmath.mpf(x)) - 2)
        assert memory[program.outputs[0]] == pytest.approx(exact, rel=1e-14)
        assert memory[program.outputs[1]] == pytest.approx(abs(exact), rel=1e-14)
    assert np.isfinite(memory).all()


def test_tables_are_looked_up():
    """Between knots, at them and at both ends; beyond nothing is known. The memory of two tables is not mixed up."""
    knots, values, slopes = (-1, 0, 2), (3, 1, 2), (0, -1, 5)
    one = Lookup("one", *(tuple(map(Fraction, row)) for row in (knots, values, slopes)))
    two = Lookup("two", *(tuple(map(Fraction, row)) for row in (knots, slopes, values)))
    e = parse("one(x) + 10*two(x)", symbols={"x": symbol("x")}, tables={"one": one, "two": two}).expression
    program, memory = assemble([e, derivative(e, "x")], ["x"])
    theirs = [CubicHermiteSpline(knots, *rows) for rows in ((values, slopes), (slopes, values))]
    for x in (-1, -0.7, 0, 1e-9, 0.3, 1.9, 2):
        memory[0] = x
        run(program.steps, len(program.steps), memory)
        for order, place in enumerate(program.outputs):
            exact = theirs[0](x, order) + 10 * theirs[1](x, order)
            assert memory[place] == pytest.approx(float(exact), rel=1e-12, abs=1e-12)
    memory[0] = 2.1
    run(program.steps, len(program.steps), memory)
    assert np.isnan(memory[program.outputs]).all()
