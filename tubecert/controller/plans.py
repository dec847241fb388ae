"""What the computer knows of a plan: x* at every sample and u* as it is held while that sample's command acts.

In: a certificate. Out: rows of single precision, and a formula of t in C where the plan goes on for ever, both within
2^-24 of the size of the plan, which the certificate allows for. Command k acts from k Ts + delay on for Ts; what is
held is u* in the middle of that time, or at its beginning. For a family a planner hands x* and u* in.
"""

from __future__ import annotations

import ast
import math
from bisect import bisect_right
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.errors import ExitCode, TubecertError
from tubecert.expression import FUNCTIONS
from tubecert.findings import Finding
from tubecert.model import build
from tubecert.sampled_loop.record import Result
from tubecert.spec import Spec, load_text
from tubecert.trajectory.hermite import intervals
from tubecert.trajectory.make import plan_of
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan

_FOR_EVER: Final = 2**30  # samples of a formula: up to there its time in double is that of the sample
_EVERY: Final = 4096  # of them one in the self-test: as in selftest.c
_MOST_ROWS: Final = 1_000_000
_SIGNS: Final = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}


def refused(message: str, help: str, exit_code: ExitCode = ExitCode.INVALID) -> TubecertError:
    """The error for a certificate that no code can be written for."""
    return TubecertError([Finding(code="TC710", message=message, help=help)], exit_code)


def question(result: Result) -> Spec:
    """The specification of a certificate; at rest where the plan is a curve through knots."""
    effective, unused = result.spec.effective, ("initial_state", "obstacles", "simulation", "expect", "tube")
    return load_text(effective.text if result.planned is None else effective.at_rest(unused), "certificate")


class Planned:
    """The plan of a certificate's computer: `kind` is the macro of the C code; `handed`: a planner hands it in.

    After `steps` samples sample `after` is next: `steps` itself is the end. `lead`, s: from a sample to the u* that is
    held for it. `rows` (N, n) and (N, m) are those of all samples, of a formula those of some, of a family 0.
    `formula`: lines of C that set xs, and those for us. Raises TC710 for a plan that cannot be written down.
    """

    def __init__(self, result: Result, spec: Spec) -> None:
        own, machine, afterwards = spec.trajectory, spec.hardware, result.claim.afterwards
        assert machine is not None
        goes_on, self.handed = own.kind == "expressions" and afterwards == "repeat", own.bundle is not None
        self._period, self._end, self._again = machine.sample_time, own.horizon, afterwards == "repeat"
        self.lead = machine.delayed + (self._period / 2 if result.claim.hold == "middle" else 0)
        self.kind, self.steps, self.after, self.formula = "PLAN_TABLE", 1, 0, ("", "")
        if goes_on:
            texts = result.spec.effective.part("trajectory")
            self.kind, self.steps, self.after, self._end = "PLAN_FORMULA", _FOR_EVER, _FOR_EVER, None
            self.formula = _formula("xs", texts["x"]), _formula("us", texts["u"])
        elif own.horizon is not None:
            self.steps = math.ceil(own.horizon / self._period) + (afterwards == "rest")
            self.after = {"nothing": self.steps, "rest": self.steps - 1, "repeat": 0}[afterwards]
        if self.handed:
            self.kind = "PLAN_HANDED"
            self.rows = np.zeros((1, len(spec.states))), np.zeros((1, len(spec.inputs)))
            return
        if self.steps > _MOST_ROWS and not goes_on:
            message = f"the plan has {self.steps:,} samples; a table has at most {_MOST_ROWS:,}"
            raise refused(message, "certify a shorter plan")
        model, knots = build(spec), result.planned
        self._plan = plan_of(spec, model) if knots is None else piecewise_plan(model, knots, own.horizon)
        self.rows = self.at(range(0, 16 * _EVERY, _EVERY) if goes_on else range(self.steps))

    def at(self, samples: Sequence[int]) -> tuple[Array, Array]:
        """x* (N, n) at samples, and u* (N, m) as it is held for them."""
        now, then = ([k * self._period + later for k in samples] for later in (0, self.lead))
        return self._values(now)[0], self._values(then)[1]

    def _values(self, times: Sequence[Fraction]) -> tuple[Array, Array]:
        """x* and u* at exact times; where u* jumps, what it jumps to."""
        if (end := self._end) is not None:
            times = [t % end if self._again else min(t, end) for t in times]
        window, span, plan = intervals(times), None, self._plan
        if isinstance(plan, PiecewisePlan) and plan.spans is not None:
            last = len(plan.pieces) - 1
            span = np.array([min(bisect_right(plan.data.t, t) - 1, last) for t in times], dtype=float)
        x, u = (
            side.mid.astype(np.float32).astype(float) for side in plan.enclose(window.lo, window.hi, span)
        )
        return x, u


def _formula(names: str, texts: Any) -> str:
    """Lines of C that compute expressions of a double t."""
    roots = (ast.parse(text, mode="eval").body for text in texts)
    return "\n".join(f"  {names}[{i}] = (real){_in_c(root)};" for i, root in enumerate(roots))


def _in_c(node: ast.expr) -> str:
    """An expression of t in the grammar of specifications as one in C, all in double."""
    match node:
        case ast.Name(id="t"):
            return "t"
        case ast.Name(id="pi") | ast.Constant(value=int() | float()):
            return float(getattr(node, "value", math.pi)).hex()
        case ast.UnaryOp(operand=inner):
            return f"(-{_in_c(inner)})"
        case ast.BinOp(left=base, op=ast.Pow(), right=power):
            return f"pow({_in_c(base)}, {_in_c(power)})"
        case ast.BinOp(left=left, op=op, right=right):
            return f"({_in_c(left)} {_SIGNS[type(op)]} {_in_c(right)})"
        case ast.Call(func=ast.Name(id=name), args=[argument]) if name in FUNCTIONS:
            return f"{name}({_in_c(argument)})"
    message = f"the plan contains {ast.unparse(node)[:60]}, which C does not have"
    raise refused(message, "give the plan as a file (kind: csv)")
