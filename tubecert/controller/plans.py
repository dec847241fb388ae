"""What the computer knows of a plan: x* at every sample and u* as it is held while that sample's command acts.

In: a certificate. Out: a table of single precision, a formula of t in C, or nothing where a planner hands x* and u* in.
Both are within 2^-24 of the size of the plan, which the certificate allows for. Command k acts from k Ts + delay on for
Ts; what is held is u* in the middle of that time, or at its beginning.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Any, Final, TypeAlias

import numpy as np

from tubecert.certificate.file import dump
from tubecert.enclosure.interval import Array
from tubecert.errors import TubecertError
from tubecert.expression import FUNCTIONS, Expression, symbol
from tubecert.expression.graph import topological
from tubecert.findings import Finding
from tubecert.model import TIME, build
from tubecert.sampled_loop.record import Result
from tubecert.spec import Knots, Spec, load_text
from tubecert.trajectory.hermite import intervals
from tubecert.trajectory.pieces import PiecewisePlan, piecewise_plan
from tubecert.trajectory.plan import Plan

FOR_EVER: Final = 2**30  # samples of a formula: up to there its time in double is that of the sample
_MOST_ROWS: Final = 1_000_000
At: TypeAlias = Callable[[Sequence[int]], tuple[Array, Array]]
_WINDOWS: Final = 256  # of the plan, in which its size is looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """The plan of a computer: `kind` is the macro of the C code, `text` its definitions.

    After `steps` samples sample `after` is next: `steps` itself is the end. `sizes` (n,) bounds |x*|; `at` is the plan
    of some samples, (N, n) and (N, m), in numbers of the computer; None where it is handed in.
    """

    kind: str
    text: str
    steps: int
    after: int
    sizes: Array
    at: At | None


def refused(message: str, help: str = "") -> TubecertError:
    """The error for a certificate that no code can be written for."""
    return TubecertError([Finding(code="TC710", message=message, help=help)])


def question(result: Result) -> Spec:
    """The specification of a certificate; at rest where the plan is a curve through knots."""
    effective = result.spec.effective
    if result.planned is None:
        return load_text(dump(effective.data), "certificate")
    unused = ("initial_state", "obstacles", "simulation", "expect", "tube")
    return load_text(effective.at_rest(unused), "certificate")


def planned(result: Result, spec: Spec, real: type[np.floating[Any]]) -> Planned:
    """What the computer of a certificate knows of its plan. Raises TC710 for a plan that cannot be written down."""
    hardware, horizon, afterwards = spec.hardware, spec.trajectory.horizon, result.claim.afterwards
    assert hardware is not None
    period = hardware.sample_time
    lead = hardware.delayed + (period / 2 if result.claim.hold == "middle" else 0)
    count = 1 if horizon is None else ceil(horizon / period)
    steps, after = (count, count) if horizon is not None and afterwards == "nothing" else (1, 0)
    if spec.trajectory.bundle is not None:
        sizes = np.array([max(map(abs, ends)) for ends in spec.trajectory.bundle.x], dtype=float)
        return Planned(kind="PLAN_HANDED", text="", steps=steps, after=after, sizes=sizes, at=None)
    plan = _plan(result, spec)
    again, known = afterwards == "repeat", isinstance(plan, PiecewisePlan)
    formula = again and not known and not plan.is_constant
    if formula:
        steps = after = FOR_EVER
    elif not plan.is_constant:
        steps = count + (afterwards == "rest")
        after = {"nothing": steps, "rest": steps - 1, "repeat": 0}[afterwards]

    def during(t: Fraction) -> Fraction:
        if formula or horizon is None:
            return t
        return t % horizon if again else min(t, horizon)

    def at(samples: Sequence[int]) -> tuple[Array, Array]:
        x = _values(plan, [during(k * period) for k in samples])[0]
        u = _values(plan, [during(k * period + lead) for k in samples])[1]
        digits = real if formula else np.float32
        return x.astype(digits).astype(float), u.astype(digits).astype(float)

    edges = np.linspace(0.0, float(horizon or 0), _WINDOWS + 1)
    return Planned(
        kind="PLAN_FORMULA" if formula else "PLAN_TABLE",
        text=_formula(plan, lead) if formula else _table(steps, at),
        steps=steps,
        after=after,
        sizes=plan.enclose(edges[:-1], edges[1:])[0].magnitude.max(axis=0),
        at=at,
    )


def _table(steps: int, at: At) -> str:
    if steps > _MOST_ROWS:
        message = f"the plan has {steps:,} samples; a table has at most {_MOST_ROWS:,}"
        raise refused(message, "certify a shorter plan")
    x, u = (braces("float", own) for own in at(range(steps)))
    return f"static const float XS[STEPS][NX] = {x};\nstatic const float US[STEPS][NU] = {u};"


def _plan(result: Result, spec: Spec) -> Plan:
    own, trajectory = result.planned, spec.trajectory
    if own is not None:
        knots = Knots(t=own.t, x=own.x, u=own.u, interpolation=own.interpolation)
        return piecewise_plan(build(spec), knots, trajectory.horizon)
    x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
    return Plan(x, u, trajectory.horizon)


def _values(plan: Plan, times: Sequence[Fraction]) -> tuple[Array, Array]:
    """x* (N, n) and u* (N, m) at exact times; where u* jumps, what it jumps to."""
    window, span = intervals(times), None
    if isinstance(plan, PiecewisePlan) and plan.spans is not None:
        last = len(plan.pieces) - 1
        span = np.array([min(bisect_right(plan.data.t, t) - 1, last) for t in times], dtype=float)
    x, u = plan.enclose(window.lo, window.hi, span)
    return x.mid, u.mid


def braces(kind: str, rows: Array) -> str:
    """An array of C, of one or two dimensions, digit for digit; a 0 where it would be empty, which C does not allow."""
    if rows.size == 0:
        return "{{0}}" if rows.ndim == 2 else "{0}"
    if rows.ndim == 1:
        return f"{{{', '.join(literal(kind, x) for x in rows)}}}"
    return "{\n" + "".join(f"  {braces(kind, row)},\n" for row in rows) + "}"


def literal(kind: str, value: float) -> str:
    """A float as a literal of its type: exactly that number, in hexadecimal digits."""
    digits, power = float(value).hex().split("p")
    return f"{digits.rstrip('0').removesuffix('.')}p{power}{'f' if kind == 'float' else ''}"


def _formula(plan: Plan, lead: Fraction) -> str:
    """x* of the sample's time, u* of that and `lead`: a function in C, one operation a line, all in double."""
    lines = ["#include <math.h>", "static inline void plan(uint32_t k, real xs[NX], real us[NU]) {"]
    for target, roots, later in (("xs", plan.x, 0.0), ("us", plan.u, float(lead))):
        names: dict[Expression, str] = {symbol(TIME): f"t_{target}"}
        lines.append(f"  const double t_{target} = (double)k * SAMPLE_TIME + {literal('double', later)};")
        lines.append(f"  (void)t_{target};")
        for node in topological(roots):
            if node.op != "symbol":
                names[node] = f"{target}_{len(names)}"
                made = _operation(node, [names[arg] for arg in node.args])
                lines.append(f"  const double {names[node]} = {made};")
        lines += [f"  {target}[{i}] = (real){names[root]};" for i, root in enumerate(roots)]
    return "\n".join([*lines, "}"])


def _operation(node: Expression, args: Sequence[str]) -> str:
    match node.op:
        case "const":
            return literal("double", node.fraction.numerator / node.fraction.denominator)
        case "pi":
            return literal("double", np.pi)
        case "add" | "mul" | "div":
            return {"add": " + ", "mul": " * ", "div": " / "}[node.op].join(args)
        case "pow":
            return f"pow({args[0]}, {node.value}.0)"
        case op if op in FUNCTIONS:
            return f"{op}({args[0]})"
    raise refused(
        f"the plan contains {node.op}, which C does not have", "give the plan as a file (kind: csv)"
    )
