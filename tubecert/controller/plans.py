"""What the computer knows of a plan: x* at every sample and u* as it is held while that sample's command acts.

In: a certificate. Out: rows of single precision, and a formula of t in C where the plan goes on for ever, both within
2^-24 of the size of the plan, which the certificate allows for. Command k acts from k Ts + delay on for Ts; what is
held is u* in the middle of that time, or at its beginning. For a family a planner hands x* and u* in.
"""

from __future__ import annotations

import ast
import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.errors import TubecertError
from tubecert.expression import FUNCTIONS
from tubecert.findings import Finding
from tubecert.model import build
from tubecert.sampled_loop.record import Result
from tubecert.spec import Hardware, Spec, load_text
from tubecert.trajectory.hermite import intervals
from tubecert.trajectory.make import plan_of
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan
from tubecert.trajectory.plan import Plan

_FOR_EVER: Final = 2**30  # samples of a formula: up to there its time in double is that of the sample
_EVERY: Final = 4096  # of them one in the self-test: as in selftest.c
_MOST_ROWS: Final = 1_000_000
_SIGNS: Final = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}


@dataclass(frozen=True, slots=True)
class Planned:
    """The plan of a computer: `kind` is the macro of the C code.

    After `steps` samples sample `after` is next: `steps` itself is the end. `lead`, s: from a sample to the u* that is
    held for it. `at` is the plan of some samples, (N, n) and (N, m), None where it is handed in; `rows` is that of all
    samples, of a formula that of some, of a family 0. `formula`: lines of C that set xs, and those for us.
    """

    kind: str
    steps: int
    after: int
    lead: Fraction
    rows: tuple[Array, Array]
    at: Callable[[Sequence[int]], tuple[Array, Array]] | None
    formula: tuple[str, str] = ("", "")


def refused(message: str, help: str = "") -> TubecertError:
    """The error for a certificate that no code can be written for."""
    return TubecertError([Finding(code="TC710", message=message, help=help)])


def question(result: Result) -> Spec:
    """The specification of a certificate; at rest where the plan is a curve through knots."""
    effective = result.spec.effective
    if result.planned is None:
        return load_text(effective.text, "certificate")
    unused = ("initial_state", "obstacles", "simulation", "expect", "tube")
    return load_text(effective.at_rest(unused), "certificate")


def planned(result: Result, spec: Spec, hardware: Hardware) -> Planned:
    """What the computer of a certificate knows of its plan. Raises TC710 for a plan that cannot be written down."""
    horizon, afterwards = spec.trajectory.horizon, result.claim.afterwards
    period, goes_on = hardware.sample_time, spec.trajectory.kind == "expressions" and afterwards == "repeat"
    lead = hardware.delayed + (period / 2 if result.claim.hold == "middle" else 0)
    steps, after = 1, 0
    if goes_on:
        steps = after = _FOR_EVER
    elif horizon is not None:
        steps = math.ceil(horizon / period) + (afterwards == "rest")
        after = {"nothing": steps, "rest": steps - 1, "repeat": 0}[afterwards]
    if spec.trajectory.bundle is not None:
        rows = np.zeros((1, len(spec.states))), np.zeros((1, len(spec.inputs)))
        return Planned("PLAN_HANDED", steps, after, lead, rows, None)
    if not goes_on and steps > _MOST_ROWS:
        message = f"the plan has {steps:,} samples; a table has at most {_MOST_ROWS:,}"
        raise refused(message, "certify a shorter plan")
    plan = _plan(result, spec)

    def during(t: Fraction) -> Fraction:
        if goes_on or horizon is None:
            return t
        return t % horizon if afterwards == "repeat" else min(t, horizon)

    def at(samples: Sequence[int]) -> tuple[Array, Array]:
        now, then = ([during(k * period + later) for k in samples] for later in (Fraction(0), lead))
        return _values(plan, now)[0], _values(plan, then)[1]

    if goes_on:
        rows = at(range(0, 16 * _EVERY, _EVERY))
        own = result.spec.effective.part("trajectory")
        formula = _formula("xs", own["x"]), _formula("us", own["u"])
        return Planned("PLAN_FORMULA", steps, after, lead, rows, at, formula)
    return Planned("PLAN_TABLE", steps, after, lead, at(range(steps)), at)


def _plan(result: Result, spec: Spec) -> Plan:
    model, knots = build(spec), result.planned
    return plan_of(spec, model) if knots is None else piecewise_plan(model, knots, spec.trajectory.horizon)


def _values(plan: Plan, times: Sequence[Fraction]) -> tuple[Array, Array]:
    """x* (N, n) and u* (N, m) at exact times; where u* jumps, what it jumps to."""
    window, span = intervals(times), None
    if isinstance(plan, PiecewisePlan) and plan.spans is not None:
        last = len(plan.pieces) - 1
        span = np.array([min(bisect_right(plan.data.t, t) - 1, last) for t in times], dtype=float)
    x, u = plan.enclose(window.lo, window.hi, span)
    return x.mid.astype(np.float32).astype(float), u.mid.astype(np.float32).astype(float)


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
