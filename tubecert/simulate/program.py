"""Expressions as arrays: a straight-line program for one compiled interpreter, so that no system needs a compiler."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.expression import Expression, Lookup, topological
from tubecert.simulate.compiled import compiled

Index = NDArray[np.int64]
_ADD, _MUL, _DIV, _POW, _SQRT, _SIN, _COS, _TAN, _EXP = range(9)
_TANH, _ATAN, _LOG, _ASIN, _ACOS, _SINH, _COSH, _TABLE = range(9, 17)
_CODES = {
    "add": _ADD,
    "mul": _MUL,
    "div": _DIV,
    "pow": _POW,
    "sqrt": _SQRT,
    "sin": _SIN,
    "cos": _COS,
    "tan": _TAN,
    "exp": _EXP,
    "tanh": _TANH,
    "atan": _ATAN,
    "log": _LOG,
    "asin": _ASIN,
    "acos": _ACOS,
    "sinh": _SINH,
    "cosh": _COSH,
}


class Program(NamedTuple):
    """Memory is (inputs, constants, results), one result for each step.

    A step (S, 3) is an operation and the places of its operands (of a power, place and exponent; of a table, place and
    where its numbers begin, see `_numbers`); `outputs` are the places of the results asked for. The results of earlier
    outputs come first.
    """

    steps: Index
    outputs: Index


def assemble(outputs: Sequence[Expression], inputs: Sequence[str]) -> tuple[Program, Array]:
    """The program of the outputs, and a memory for it with the constants in place.

    ValueError if they depend on anything but the inputs.
    """
    order = topological(outputs)
    names = {name: index for index, name in enumerate(inputs)}
    constants = [node for node in order if node.op in ("const", "pi")]
    start = [0.0] * len(names) + [np.pi if e.op == "pi" else _float(e) for e in constants]
    place = {node: len(names) + i for i, node in enumerate(constants)}
    tables = {}
    for node in order:
        if node.op == "table" and node.lookup not in tables:
            tables[node.lookup] = len(start)
            start += _numbers(node.lookup)
    first = len(start)
    steps: list[tuple[int, int, int]] = []

    def emit(code: int, left: int, right: int = 0) -> int:
        steps.append((code, left, right))
        return first + len(steps) - 1

    def length(args: Sequence[int]) -> int:
        total = emit(_MUL, args[0], args[0])
        for arg in args[1:]:
            total = emit(_ADD, total, emit(_MUL, arg, arg))
        return emit(_SQRT, total)

    for node in order:
        args = [place[arg] for arg in node.args]
        if node.op == "symbol":
            if node.value not in names:
                raise ValueError(f"{node.value} is not an input of the program")
            place[node] = names[str(node.value)]
        elif node.op == "norm":
            place[node] = length(args)
        elif node.op == "direction":
            place[node] = emit(_DIV, args[int(str(node.value))], length(args))
        elif node.op == "pow":
            place[node] = emit(_POW, args[0], int(str(node.value)))
        elif node.op == "table":
            place[node] = emit(_TABLE, args[0], tables[node.lookup])
        elif node.op in _CODES:
            place[node] = emit(_CODES[node.op], args[0], args[-1])
    memory = np.array(start + [0.0] * len(steps))
    places = np.array([place[node] for node in outputs], dtype=np.int64)
    return Program(np.array(steps, dtype=np.int64).reshape(-1, 3), places), memory


_PIECE = 5  # numbers of a piece: where it begins, and four coefficients, ascending


def _numbers(table: Lookup) -> list[float]:
    """How many pieces a table has, where it begins and ends to be defined, and its pieces."""
    found = [float(len(table.pieces)), float(table.start), float(table.end)]
    for knot, piece in zip(table.knots[:-1], table.pieces, strict=True):
        found += [float(knot), *map(float, piece), *[0.0] * (_PIECE - 1 - len(piece))]
    return found


@compiled
def _looked_up(memory: Any, at: int, x: float) -> float:
    """The function of a table whose numbers begin at a place; NaN beyond its ends."""
    if not memory[at + 1] <= x <= memory[at + 2]:
        return np.nan
    low, high = 0, int(memory[at])  # the piece is in [low, high)
    while high - low > 1:
        middle = (low + high) // 2
        if x >= memory[at + 3 + _PIECE * middle]:
            low = middle
        else:
            high = middle
    own = at + 3 + _PIECE * low
    s = x - memory[own]
    total = 0.0
    for k in range(_PIECE - 1, 0, -1):
        total = total * s + memory[own + k]
    return total


def _float(node: Expression) -> float:
    try:
        return float(node.fraction)
    except OverflowError:
        return np.inf if node.fraction > 0 else -np.inf


@compiled
def execute(steps: Any, count: int, memory: Any) -> None:
    """Runs the first steps on a memory whose inputs and constants are in place."""
    target = memory.shape[0] - steps.shape[0]
    for i in range(count):
        code, right = steps[i, 0], steps[i, 2]
        x = memory[steps[i, 1]]
        if code == _MUL:
            value = x * memory[right]
        elif code == _ADD:
            value = x + memory[right]
        elif code == _POW:
            value = 1.0
            for _ in range(abs(right)):
                value *= x
            if right < 0:
                value = 1.0 / value
        elif code == _SIN:
            value = np.sin(x)
        elif code == _COS:
            value = np.cos(x)
        elif code == _DIV:
            value = x / memory[right]
        elif code == _SQRT:
            value = np.sqrt(x)
        elif code == _TAN:
            value = np.tan(x)
        elif code == _EXP:
            value = np.exp(x)
        elif code == _TANH:
            value = np.tanh(x)
        elif code == _ATAN:
            value = np.arctan(x)
        elif code == _LOG:
            value = np.log(x)
        elif code == _ASIN:
            value = np.arcsin(x)
        elif code == _ACOS:
            value = np.arccos(x)
        elif code == _SINH:
            value = np.sinh(x)
        elif code == _COSH:
            value = np.cosh(x)
        else:
            value = _looked_up(memory, right, x)
        memory[target + i] = value
