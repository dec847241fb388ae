"""The plan as exported code has it: x* at every sample, u* as it is held while that sample's command acts.

Implements: theory of the sampled loop, section 1. Command k acts over [k Ts + delay, (k + 1) Ts + delay); u* is that of
its middle, or of its beginning. A time beyond the end of a finite plan is its end; one that is repeated begins again,
or goes on where it is a formula.
"""

from __future__ import annotations

import re
import struct
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Final

from flint import ctx

from tubecert.recheck.balls import Ball, exact, floor
from tubecert.recheck.program import Program
from tubecert.recheck.sampled_loop.windows import Course
from tubecert.recheck.terms import Term, number, operation, variable

HEX: Final = r"-?0x[01](?:\.[0-9a-f]+)?p[-+]\d{1,4}"
_ACCURACY: Final = Fraction(1, 2**24)  # of a plan in the computer, of its largest size
_EVER: Final = 2**30  # samples of a formula
_LOOKED_AT: Final = 256  # samples of a formula, among the first ones
_ROWS: Final = re.compile(
    r"static const float XS\[STEPS\]\[NX\] = ([^;]*);\nstatic const float US\[STEPS\]\[NU\] = ([^;]*);"
)
_NAMES: Final = "sin|cos|tan|asin|acos|atan|sinh|cosh|tanh|exp|log|sqrt"
_HEAD: Final = "static inline void plan(uint32_t k, real xs[NX], real us[NU]) {"
_CLOCK: Final = re.compile(rf"  const double (t_[xu]s) = \(double\)k \* SAMPLE_TIME \+ ({HEX});")
_LINE: Final = re.compile(
    rf"  const double (\w+) = (?:({HEX})|(\w+) ([+*/]) (\w+)|pow\((\w+), (-?\d+)\.0\)|({_NAMES})\((\w+)\));"
)
_OUT: Final = re.compile(r"  ([xu]s)\[(\d+)\] = \(real\)(\w+);")
Rows = list[list[float]]


def single(value: float) -> float:
    """The number of single precision next to one."""
    return float(struct.unpack("f", struct.pack("f", value))[0])


@dataclass(frozen=True)
class HeldPlan:
    """The plan of a certificate, as a computer has it."""

    course: Course

    @property
    def kind(self) -> str:
        """How it is written in C: what goes on as it is, is a formula."""
        course = self.course
        if course.family is not None:
            return "PLAN_HANDED"
        goes_on = course.knots is None and course.curve.moves and course.spec.afterwards == "repeat"
        return "PLAN_FORMULA" if goes_on else "PLAN_TABLE"

    @property
    def counts(self) -> tuple[int, int]:
        """Samples of the plan, and which one comes after the last; the same number is the end."""
        spec = self.course.spec
        horizon, afterwards = spec.trajectory.horizon, spec.afterwards
        count = 1 if horizon is None else ceil(horizon / spec.hardware.sample_time)
        if self.kind == "PLAN_FORMULA":
            return _EVER, _EVER
        if self.kind == "PLAN_HANDED" or not self.course.curve.moves:
            return (count, count) if horizon is not None and afterwards == "nothing" else (1, 0)
        steps = count + (afterwards == "rest")
        return steps, {"nothing": steps, "rest": steps - 1, "repeat": 0}[afterwards]

    def _at(self, t: Fraction) -> list[Ball]:
        """x* and u* at a time, (n + m); where u* jumps, what it jumps to."""
        curve, knots = self.course.curve, self.course.knots
        if knots is None:
            return curve.field.at([exact(t)] if curve.field.variables else [])
        k = min(bisect_right(knots.t, t), len(curve.parts)) - 1
        return curve.field.with_values(curve.parts[k].values).at([exact(t - knots.t[k])])

    def row(self, k: int) -> list[Ball]:
        """x* and u* of sample k, (n + m)."""
        machine, n = self.course.spec.hardware, len(self.course.curve.x)
        lead = machine.delay + (machine.sample_time / 2 if machine.hold == "middle" else 0)
        now, later = (self._during(k * machine.sample_time + more) for more in (Fraction(0), lead))
        return [*self._at(now)[:n], *self._at(later)[n:]]

    def _during(self, t: Fraction) -> Fraction:
        horizon = self.course.spec.trajectory.horizon
        if self.kind == "PLAN_FORMULA" or horizon is None:
            return t
        return t % horizon if self.course.spec.afterwards == "repeat" else min(t, horizon)

    def agrees(self, text: str, period: float, read: Callable[[str], Rows]) -> tuple[str, list[float]]:
        """What is wrong with the text of a plan, nothing if that is ""; and the largest |x*_i| that was seen, (n,)."""
        n = len(self.course.curve.x)
        if self.kind == "PLAN_FORMULA":
            samples = [*range(_LOOKED_AT), *(2**j - 1 for j in range(9, 31))]
            found = self._evaluated(text, samples, period)
        else:
            if (rows := _ROWS.fullmatch(text)) is None:
                return "the plan is no table of x* and u*", []
            samples = list(range(self.counts[0]))
            pairs = zip(read(rows[1]), read(rows[2]), strict=True)
            found = [[Ball(value) for value in (*x, *u)] for x, u in pairs if len(x) == n]
        if len(found) != len(samples):
            return "the plan does not have a row for every sample", []
        with ctx.workprec(128):
            wanted = [self.row(k) for k in samples]
        sizes = [max(floor(abs(row[i]).lower()) for row in wanted) for i in range(len(wanted[0]))]
        most = [exact(_ACCURACY * Fraction(max(size, 0.0))) for size in sizes]
        for k, row, own in zip(samples, found, wanted, strict=True):
            if len(row) != len(own) or not all(
                abs(a - b) <= c for a, b, c in zip(row, own, most, strict=True)
            ):
                return f"the plan of sample {k} is not that of the certificate", []
        return "", sizes[:n]

    def _evaluated(self, text: str, samples: Sequence[int], period: float) -> list[list[Ball]]:
        """What a formula in C gives at some samples; nothing if it is not what is written here for one.

        In balls of 53 bits, whose operations lose no less than those of a double.
        """
        known: dict[str, Term] = {}
        out: list[tuple[str, Term]] = []
        late: dict[str, float] = {}
        lines = text.split("\n")
        for line in lines[2:-1]:
            if said := _CLOCK.fullmatch(line):
                late[said[1]], known[said[1]] = float.fromhex(said[2]), variable(said[1])
            elif said := _LINE.fullmatch(line):
                if (term := _term(said, known)) is None:
                    return []
                known[said[1]] = term
            elif (said := _OUT.fullmatch(line)) and said[3] in known:
                out.append((f"{said[1]}{said[2]}", known[said[3]]))
            elif line not in ("  (void)t_xs;", "  (void)t_us;"):
                return []
        n, m = len(self.course.curve.x), len(self.course.curve.u)
        order = [*(f"xs{i}" for i in range(n)), *(f"us{j}" for j in range(m))]
        if [*lines[:2], lines[-1]] != ["#include <math.h>", _HEAD, "}"] or [name for name, _ in out] != order:
            return []
        with ctx.workprec(53):
            program = Program([term for _, term in out], tuple(late))
            clock, rounds = exact(Fraction(period)), Ball(1, 2.0**-53)
            found = [
                program.run([(clock * k * rounds + lag) * rounds for lag in late.values()]) for k in samples
            ]
        if self.course.spec.hardware.arithmetic == "double":
            return found
        return [[Ball(single(float(value.mid()))) for value in row] for row in found]


def _term(line: re.Match[str], known: dict[str, Term]) -> Term | None:
    """The right side of a line, of what is known above it."""
    _, literal, left, sign, right, base, power, function, argument = line.groups()
    if literal is not None:
        return number(Fraction(float.fromhex(literal)))
    used = [name for name in (left, right, base, argument) if name is not None]
    if any(name not in known for name in used):
        return None
    if sign is not None:
        a, b = known[left], known[right]
        return a + b if sign == "+" else a * b if sign == "*" else a / b
    return known[base].raised(int(power)) if base is not None else operation(function, known[argument])
