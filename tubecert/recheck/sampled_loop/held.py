"""The plan as exported code has it: x* at every sample, u* as it is held while that sample's command acts.

Implements: theory of the sampled loop, section 1. Command k acts over [k Ts + delay, (k + 1) Ts + delay); u* is that of
its middle, or of its beginning. A time beyond the end of a finite plan is its end; one that is repeated begins again,
or goes on where it is a formula.
"""

from __future__ import annotations

import ast
import math
import operator
import struct
from bisect import bisect_right
from collections.abc import Sequence
from fractions import Fraction
from typing import Final

from flint import arb, ctx

from tubecert.recheck.balls import Ball, exact, floor, power
from tubecert.recheck.program import Program
from tubecert.recheck.sampled_loop.windows import Course
from tubecert.recheck.specified.trajectory import Expressed
from tubecert.recheck.terms import operation, variable

_ACCURACY: Final = 2.0**-24  # of a plan in the computer, of its largest size
_EVER: Final = 2**30  # samples of a formula,
_EVERY: Final = 4096  # ... of them one for the self-test,
_LOOKED_AT: Final = (*range(256), *(2**j - 1 for j in range(9, 31)))  # ... and of them here
_SIGNS: Final = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_APPLIED: Final = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}
Rows = list[list[float]]


def single(value: float) -> float:
    """The number of single precision next to one."""
    return float(struct.unpack("f", struct.pack("f", value))[0])


class HeldPlan:
    """The plan of a certificate, as a computer has it: what is written of it in C, at which samples.

    After `steps` samples sample `after` is next: `steps` itself is the end. `lead`, s: from a sample to the u* that is
    held for it. `formula`: the lines that set xs, and those that set us.
    """

    def __init__(self, course: Course, x: Sequence[str], u: Sequence[str]) -> None:
        """`x` and `u` are texts of t, where the plan is given by such."""
        self._course, spec, machine = course, course.spec, course.spec.hardware
        self._goes_on = isinstance(spec.trajectory, Expressed) and spec.afterwards == "repeat"
        self.kind = "PLAN_FORMULA" if self._goes_on else "PLAN_HANDED" if course.family else "PLAN_TABLE"
        self.lead = machine.delay + (machine.sample_time / 2 if machine.hold == "middle" else 0)
        self.steps, self.after = 1, 0
        if self._goes_on:
            self.steps = self.after = _EVER
        elif (horizon := spec.trajectory.horizon) is not None:
            self.steps = math.ceil(horizon / machine.sample_time) + (spec.afterwards == "rest")
            self.after = {"nothing": self.steps, "rest": self.steps - 1, "repeat": 0}[spec.afterwards]
        self.written = (
            range(0, 16 * _EVERY, _EVERY) if self._goes_on else range(1 if course.family else self.steps)
        )
        self.formula, self._computed = self._compute(x, u) if self._goes_on else (("", ""), [])

    def _compute(self, x: Sequence[str], u: Sequence[str]) -> tuple[tuple[str, str], list[list[Ball]]]:
        """The formula, and what it gives where it is looked at."""
        machine, rounds = self._course.spec.hardware, Ball(1, 2.0**-53)
        with ctx.workprec(53):
            now = [arb(float(machine.sample_time)) * k * rounds for k in _LOOKED_AT]
            then = [(t + float(self.lead)) * rounds for t in now]
            xs = [_in_c(ast.parse(text, mode="eval").body, now) for text in x]
            us = [_in_c(ast.parse(text, mode="eval").body, then) for text in u]
        rows = [list(row) for row in zip(*(values for _, values in (*xs, *us)), strict=True)]
        if machine.arithmetic == "single":
            rows = [[Ball(single(float(v.mid())), v.rad()) for v in row] for row in rows]
        return (_lines("xs", xs), _lines("us", us)), rows

    def _at(self, t: Fraction) -> list[Ball]:
        """x* and u* at a time, (n + m); where u* jumps, what it jumps to; of a family 0."""
        curve, knots, horizon = self._course.curve, self._course.knots, self._course.spec.trajectory.horizon
        if self._course.family:
            return [arb(0)] * (len(curve.x) + len(curve.u))
        if horizon is not None and not self._goes_on:
            t = t % horizon if self._course.spec.afterwards == "repeat" else min(t, horizon)
        if knots is None:
            return curve.field.at([exact(t)] if curve.field.variables else [])
        k = min(bisect_right(knots.t, t), len(curve.parts)) - 1
        return curve.field.with_values(curve.parts[k].values).at([exact(t - knots.t[k])])

    def wrong(self, xs: Rows, us: Rows) -> str:
        """What is wrong with rows of the samples that are written, or with the formula; nothing if that is ""."""
        if len(xs) != len(self.written):
            return "the plan does not have a row for every sample"
        found = [*([Ball(v) for v in (*x, *u)] for x, u in zip(xs, us, strict=True)), *self._computed]
        samples = [*self.written, *(_LOOKED_AT if self._goes_on else ())]
        n, period = len(self._course.curve.x), self._course.spec.hardware.sample_time
        with ctx.workprec(128):
            wanted = [[*self._at(k * period)[:n], *self._at(k * period + self.lead)[n:]] for k in samples]
        sizes = [max(0.0, *(floor(x.abs_lower()) for x in column)) for column in zip(*wanted, strict=True)]
        for k, row, own in zip(samples, found, wanted, strict=True):
            near = zip(row, own, sizes, strict=True)
            if not all(abs(a - b) <= size * _ACCURACY for a, b, size in near):
                return f"the plan of sample {k} is not that of the certificate"
        return ""


def _lines(name: str, said: Sequence[tuple[str, list[Ball]]]) -> str:
    return "\n".join(f"  {name}[{i}] = (real){text};" for i, (text, _) in enumerate(said))


def _in_c(node: ast.expr, t: list[Ball]) -> tuple[str, list[Ball]]:
    """An expression of t in C, and its values at some t, in balls of 53 bits: a double loses no more."""
    match node:
        case ast.Name(id="t"):
            return "t", t
        case ast.Name(id="pi") | ast.Constant(value=int() | float()):
            value = float(getattr(node, "value", math.pi))
            return value.hex(), [arb(value)] * len(t)
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            text, x = _in_c(inner, t)
            return f"(-{text})", [-v for v in x]
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            (text, x), n = _in_c(base, t), ast.literal_eval(exponent)
            return f"pow({text}, {_in_c(exponent, t)[0]})", [power(v, n) for v in x]
        case ast.BinOp(left=left, op=op, right=right) if sign := _SIGNS.get(type(op)):
            (a, x), (b, y) = _in_c(left, t), _in_c(right, t)
            return f"({a} {sign} {b})", list(map(_APPLIED[sign], x, y))
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            (text, x), program = _in_c(argument, t), Program([operation(name, variable("t"))], ("t",))
            return f"{name}({text})", [program.run([v])[0] for v in x]
    raise ValueError(f"{ast.unparse(node)[:60]} in the plan")
