"""The controller of a certificate C in Python: one file that needs numpy only."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.export.continuous.vectors import Vectors
from tubecert.export.continuous.words import PROMISE, calls, heading
from tubecert.export.controller import Continuous
from tubecert.export.listing import decimal
from tubecert.export.python import entries, functions, plan_in_python


def python(c: Continuous, vectors: Vectors) -> str:
    """The text of the module."""
    return "\n".join(_module(c, vectors)) + "\n"


def _module(c: Continuous, vectors: Vectors) -> Iterator[str]:
    yield f'"""{heading(c)}'
    yield ""
    yield from (*PROMISE, "", *calls(c))
    yield '"""'
    yield ""
    yield "import math"
    yield "import sys"
    yield ""
    yield "import numpy as np"
    yield ""
    yield f'CERTIFICATE = "{c.hash}"'
    yield f"STATES = {entries([repr(name) for name in c.states])}"
    yield f"INPUTS = {entries([repr(name) for name in c.inputs])}"
    yield f"SAMPLE_TIME = {decimal(c.sample_time)}  # s, of the adaptation"
    yield f"HORIZON = {'math.inf' if c.horizon is None else decimal(c.horizon)}  # s"
    yield f"REACH = {decimal(c.reach)}  # d(x*, x) stays below it"
    yield from functions(c)
    yield from plan_in_python(c)
    yield from _class(c)
    yield from _test(c, vectors)


def _class(c: Continuous) -> Iterator[str]:
    n, m, family = len(c.states), len(c.inputs), c.boxes is not None
    if not family:
        yield ""
        yield ""
        yield "def feedforward(t):"
        yield '    """u*(t), (m,), t in s since the start."""'
        yield "    return np.array(on_plan(t)[1])"
    yield ""
    yield ""
    yield "class Controller:"
    yield '    """The controller: `start` at t = 0, `step` at later samples, `law` and `predictor` at every instant.'
    yield ""
    yield "    `status` is 0, or a sum of: 1, the horizon is over; 2, the state is not in the tube;"
    yield f"    4, no feedback can contract there{'; 8, the plan is not in its boxes' if family else ''}."
    yield '    """'
    yield ""
    yield "    def __init__(self):"
    yield "        self.sample = 0"
    yield "        self.status = 0"
    yield f"        self.s_hat = (0.0,) * {n}"
    yield f"        self.sigma_hat = self.u_a = (0.0,) * {m}"
    yield ""
    yield "    def start(self, x):"
    yield '        """Forgets everything; where the predictor starts, xhat (n,), for the state (n,) at t = 0."""'
    yield "        self.__init__()"
    yield "        return np.array(x, dtype=float)"
    yield ""
    yield "    def step(self, x, xhat):"
    yield '        """The adaptation at a sample, from the state and xhat (n,) of that instant."""'
    yield "        self.u_a = filtered((SAMPLE_TIME,), self.u_a, self.sigma_hat)"
    yield "        self.s_hat, _, self.sigma_hat = estimator(tuple(map(float, x)), tuple(map(float, xhat)))"
    yield "        self.sample += 1"
    yield ""
    yield f"    def law(self, since, x{', xs, us' if family else ''}):"
    yield '        """u (m,) for the state (n,), `since` s after the last sample."""'
    yield "        x, t = tuple(map(float, x)), self.sample * SAMPLE_TIME + since"
    yield f"        xs, us = {'tuple(map(float, xs)), tuple(map(float, us))' if family else 'on_plan(t)'}"
    yield "        kappa, (square, excess, size) = law(x, drift(x), xs, flow(xs, us), us)"
    yield "        self.status = 1 if t > HORIZON else 0"
    yield "        self.status += 0 if square < REACH * REACH else 2"
    yield "        self.status += 4 if excess > 0.0 and not size > 0.0 else 0"
    if family:
        yield "        self.status += 8 if strays(xs, us) else 0"
    yield "        u_a = filtered((since,), self.u_a, self.sigma_hat)"
    yield "        return np.array([(k + p) + q for k, p, q in zip(kappa, us, u_a)])"
    yield ""
    yield "    def predictor(self, x, xhat, u):"
    yield '        """xhat\' (n,), u (m,) being the input that acts."""'
    yield "        x, xhat, u = (tuple(map(float, each)) for each in (x, xhat, u))"
    yield "        return np.array(observer(flow(x, u), x, xhat, self.s_hat))"


def _test(c: Continuous, vectors: Vectors) -> Iterator[str]:
    n = len(c.states)
    yield ""
    yield ""
    yield "# Time since the last sample (0: a sample), state and xhat; u and xhat' by the producer: the self-test."
    for name, rows in (("GIVEN", vectors.given), ("EXPECTED", vectors.expected)):
        yield f"{name} = ("
        for row in rows:
            yield f"    {entries([repr(value) for value in row])},"
        yield ")"
    yield f"TOLERANCE = {vectors.tolerance!r}"
    yield ""
    yield ""
    yield "def answers():"
    yield '    """What is answered to GIVEN: rows of u and xhat\'."""'
    yield "    controller, found = Controller(), []"
    yield "    for k, row in enumerate(GIVEN):"
    yield f"        since, x, xhat = row[0], row[1:{1 + n}], row[{1 + n}:{1 + 2 * n}]"
    yield "        if k == 0:"
    yield "            if tuple(controller.start(x)) != x:"
    yield '                raise ValueError("the predictor starts elsewhere")'
    yield "        elif since == 0.0:"
    yield "            controller.step(x, xhat)"
    plan = "" if c.boxes is None else f", row[{1 + 2 * n}:{1 + 3 * n}], row[{1 + 3 * n}:]"
    yield f"        u = controller.law(since, x{plan})"
    yield "        found.append([*u, *controller.predictor(x, xhat, u)])"
    yield "    return np.array(found)"
    yield ""
    yield ""
    yield "def self_test():"
    yield '    """The largest difference to what the producer computed; ValueError where it is too large."""'
    yield "    worst = float(np.max(np.abs(answers() - np.array(EXPECTED))))"
    yield "    if not worst <= TOLERANCE:"
    yield '        raise ValueError(f"the self-test fails: the largest difference is {worst}")'
    yield "    return worst"
    yield ""
    yield ""
    yield 'if __name__ == "__main__":'
    yield '    sys.stdout.write(f"the self-test passes: the largest difference is {self_test():.3g}\\n")'
