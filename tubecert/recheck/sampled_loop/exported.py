"""A folder of exported code against the certificate of a sampled loop: nothing of what wrote it is believed.

The runtime is files of tubecert that a reader can judge, compared byte by byte. Data and README are written again from
the certificate, and compared byte by byte as well; only the numbers of the plan are read, and compared with the curve
of this room at the times that the theorem has (section 1): x* at a sample, u* at the middle or the beginning of the
time in which that sample's command acts, from k Ts + delay to (k + 1) Ts + delay. A time beyond the end of a finite
plan is its end; a plan that is repeated begins again, or goes on where it is a formula.
"""

from __future__ import annotations

import ast
import math
import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from string import Template
from typing import Final

from flint import arb, ctx

from tubecert.recheck.balls import Ball, floor, power
from tubecert.recheck.certificate import opened
from tubecert.recheck.cover import Outcome, stated
from tubecert.recheck.document import Node
from tubecert.recheck.program import Program
from tubecert.recheck.sampled_loop.record import Proven, read_result, single
from tubecert.recheck.sampled_loop.remainders import Course, course_of
from tubecert.recheck.specification import SampledSpecification
from tubecert.recheck.specified.trajectory import Expressed, Resting
from tubecert.recheck.terms import operation, variable

_SHIPPED: Final = Path(__file__).parents[2] / "controller"
_DATA: Final = "controller_data.h"
_OWN: Final = (_DATA, "README.txt")
_RUNTIME: Final = ("controller.c", "controller.h", "selftest.c")
_ROUNDING: Final = Fraction(1, 2**21)  # of |x| and a width: more than rounding makes of a sample
_PLAN: Final = re.compile(r"XS\[ROWS\]\[NX\] = ([^;]*);.*\n.* US\[ROWS\]\[NU\] = ([^;]*);")
_ACCURACY: Final = 2.0**-24  # of a plan in the computer, of its largest size
_EVER: Final = 2**30  # samples of a formula,
_EVERY: Final = 4096  # ... of them one for the self-test,
_LOOKED_AT: Final = (*range(256), *(2**j - 1 for j in range(9, 31)))  # ... and of them here
_SIGNS: Final = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_APPLIED: Final = {"+": arb.__add__, "-": arb.__sub__, "*": arb.__mul__, "/": arb.__truediv__}
Rows = list[list[float]]


def exported(document: Node, folder: str) -> list[tuple[str, Outcome]]:
    """The claims of a folder of exported code; one that cannot be read contradicts the only one."""
    try:  # no link is followed, and no pipe opened
        found = [(path, stat.S_ISREG(path.lstat().st_mode)) for path in sorted(Path(folder).iterdir())]
        files = {path.name: path.read_bytes() if regular else b"" for path, regular in found}
    except (OSError, ValueError) as error:
        return [("controller: the folder can be read", stated(False, str(error)))]
    return list(compared(document, files))


def compared(document: Node, files: Mapping[str, bytes]) -> Iterator[tuple[str, Outcome]]:
    """The claims of files by their names, up to the first that is not so."""
    node, _, sealed = opened(document)
    result = read_result(node)
    why = _changed(files)
    yield "controller: the runtime is that of tubecert", stated(not why, why)
    if why:
        return
    spec, proven = result.specification, result.proven
    effective = document.value["result"]["spec"]["effective"]
    name, texts = effective["name"], effective["trajectory"]
    try:
        if proven is None:
            raise ValueError("nothing is certified")
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name):
            raise ValueError("the specification has no name")
        if spec.hardware.hold == "continuous" and not isinstance(spec.trajectory, Resting):
            raise ValueError("u* is proven to change within a sample, and code holds it")
        held = HeldPlan(course_of(spec, proven.plan), texts.get("x", ()), texts.get("u", ()))
        found = _PLAN.search(files[_DATA].decode("ascii"))
        xs, us = map(_rows, found.groups() if found else ())
        own = _texts({"name": name, "hash": sealed}, proven, held, xs, us)
        changed = [file for file in _OWN if files[file] != _marked(own[file].encode())]
        same = not changed
        why = held.wrong(xs, us) if same else f"{changed[0]} is not what tubecert writes for it"
    except (ValueError, OverflowError, KeyError, SyntaxError, RecursionError, MemoryError) as error:
        same, why = False, f"{_DATA} is not as tubecert writes it ({error})"
    yield f"controller: {' and '.join(_OWN)} are those of the certificate", stated(same, why)
    if same:
        yield "controller: the plan is that of the certificate when its commands act", stated(not why, why)


def _changed(files: Mapping[str, bytes]) -> str:
    """What is not as it is shipped, missing, or compiled as well; nothing if that is "". Objects are none."""
    own = {*_RUNTIME, *_OWN}
    for name in sorted(own ^ {name for name in files if name in own or name.endswith((".c", ".h", ".gch"))}):
        return f"{name[:60]} is {'none of its files' if name in files else 'missing'}"
    for name in _RUNTIME:
        if files[name] != _marked((_SHIPPED / name).read_bytes()):
            return f"{name} is not what tubecert writes"
    return ""


def _marked(text: bytes) -> bytes:
    return b"/* tubecert export, sha256 of what follows: %s */\n" % sha256(text).hexdigest().encode() + text


def _rows(text: str) -> Rows:
    """The numbers of an array in C as it is written; raises `ValueError`."""
    rows = text.strip("{}").split("},\n{")
    return [[single(float.fromhex(word)) for word in row.split(", ")] for row in rows]


def _texts(told: Mapping[str, str], proven: Proven, held: HeldPlan, xs: Rows, us: Rows) -> dict[str, str]:
    """The files of what is proven, with the name and the hash that are told and the plan that was found."""
    spec = held.course.spec
    machine, n, m, z = spec.hardware, len(spec.plant.states), len(proven.ranges), proven.tables["F"].nrows()
    over = f"after {held.steps} samples: the last command is held from then on, and STATUS_END is told"
    matrices = {name: [list(map(float, row)) for row in own.tolist()] for name, own in proven.tables.items()}
    matrices |= {"xs": xs, "us": us}
    places: dict[str, object] = {
        **{name: "{" + ",\n".join(map(_array, rows or [[]])) + "}" for name, rows in matrices.items()},
        **{name: _array(own) for name, own in _limits(spec, proven).items()},
        **{**told, "n": n, "m": m, "z": z, "work": (z + m) * (z + n)},
        **{"period": float(machine.sample_time), "delay": float(machine.delay), "lead": float(held.lead)},
        **{"kind": held.kind, "steps": held.steps, "after": held.after},
        **{"rows": len(held.written), "formula_x": held.formula[0], "formula_u": held.formula[1]},
        "real": "float" if machine.arithmetic == "single" else "double",
        "handed": "xs, us, " if held.course.family else "",
        "end": over if held.after == held.steps else "never",
    }
    return {file: Template((_SHIPPED / f"{file}.in").read_text("utf-8")).substitute(places) for file in _OWN}


def _limits(spec: SampledSpecification, proven: Proven) -> dict[str, list[float]]:
    """The last numbers of the arithmetic within what is proven, and the first reach that is enough."""
    machine, boxes, stages = spec.hardware, spec.plant.safe_set, proven.stages
    noise = machine.noise if isinstance(machine.noise, tuple) else (machine.noise,) * len(boxes)
    widths = zip(*(own.half_widths for own in stages), strict=True)
    off = [(max(w) + v, max(map(abs, box))) for w, v, box in zip(widths, noise, boxes.values(), strict=True)]
    limits = {
        "reach": (1, [far + _ROUNDING * (far + size) for far, size in off]),
        "memory": (-1, [max(own) for own in zip(*(stage.memory for stage in stages), strict=True)]),
        "low": (1, [low for low, _ in proven.ranges]),
        "high": (-1, [high for _, high in proven.ranges]),
    }
    return {name: [_next(q, side, machine.arithmetic) for q in own] for name, (side, own) in limits.items()}


def _next(q: Fraction, side: int, arithmetic: str) -> float:
    """The number next to an exact one: not below it (side 1), or not above it (-1)."""
    rounded, unit = (single, 2.0**-24) if arithmetic == "single" else (float, 2.0**-53)
    near = rounded(float(q))
    return near if side * Fraction(near) >= side * q else rounded(near + side * 1.1 * unit * abs(near))


def _array(values: Sequence[float]) -> str:
    """An array of C; a 0 where it would be empty, which C does not allow."""
    return "{" + ", ".join(x.hex() for x in values or [0.0]) + "}"


class HeldPlan:
    """The plan of a certificate, as a computer has it: what is written of it in C, at which samples.

    After `steps` samples sample `after` is next: `steps` itself is the end. `lead`, s: from a sample to the u* that is
    held for it. `formula`: the lines that set xs, and those that set us.
    """

    def __init__(self, course: Course, x: Sequence[str], u: Sequence[str]) -> None:
        """`x` and `u` are texts of t, where the plan is given by such."""
        self.course, spec, machine = course, course.spec, course.spec.hardware
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

    def _compute(self, x: Sequence[str], u: Sequence[str]) -> tuple[tuple[str, ...], list[list[Ball]]]:
        """The formula, and what it gives where it is looked at."""
        machine, rounds = self.course.spec.hardware, Ball(1, 2.0**-53)
        with ctx.workprec(53):
            now = [arb(float(machine.sample_time)) * k * rounds for k in _LOOKED_AT]
            then = [(t + float(self.lead)) * rounds for t in now]
            xs = [_in_c(ast.parse(text, mode="eval").body, now) for text in x]
            us = [_in_c(ast.parse(text, mode="eval").body, then) for text in u]
        rows = [list(row) for row in zip(*(values for _, values in (*xs, *us)), strict=True)]
        if machine.arithmetic == "single":
            rows = [[Ball(single(float(v.mid())), v.rad()) for v in row] for row in rows]
        said = ((name, enumerate(own)) for name, own in (("xs", xs), ("us", us)))
        lines = ("\n".join(f"  {name}[{i}] = (real){text};" for i, (text, _) in own) for name, own in said)
        return tuple(lines), rows

    def _at(self, t: Fraction) -> tuple[list[Ball], list[Ball]]:
        """x* (n) and u* (m) at a time; of a family 0."""
        curve, horizon = self.course.curve, self.course.spec.trajectory.horizon
        if self.course.family:
            return [arb(0)] * len(curve.x), [arb(0)] * len(curve.u)
        if horizon is not None and not self._goes_on:
            t = t % horizon if self.course.spec.afterwards == "repeat" else min(t, horizon)
        return curve.at(t)

    def wrong(self, xs: Rows, us: Rows) -> str:
        """What is wrong with rows of the samples that are written, or with the formula; nothing if that is ""."""
        if len(xs) != len(self.written):
            return "the plan does not have a row for every sample"
        found = [*([Ball(v) for v in (*x, *u)] for x, u in zip(xs, us, strict=True)), *self._computed]
        samples = [*self.written, *(_LOOKED_AT if self._goes_on else ())]
        period = self.course.spec.hardware.sample_time
        with ctx.workprec(128):
            wanted = [[*self._at(k * period)[0], *self._at(k * period + self.lead)[1]] for k in samples]
        sizes = [max(0.0, *(floor(x.abs_lower()) for x in column)) for column in zip(*wanted, strict=True)]
        for k, row, own in zip(samples, found, wanted, strict=True):
            near = zip(row, own, sizes, strict=True)
            if not all(abs(a - b) <= size * _ACCURACY for a, b, size in near):
                return f"the plan of sample {k} is not that of the certificate"
        return ""


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
