"""Straight-line programs: expression graphs compiled once, run on batches of floats or intervals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from tubecert.enclosure import interval as iv
from tubecert.enclosure import lookup
from tubecert.enclosure.interval import Array, Interval
from tubecert.expression import Expression, Lookup, topological

# operation, target slot, argument slots, exponent, index or table
Step = tuple[str, int, tuple[int, ...], int]


class Tape:
    """The values of `outputs` as functions of `inputs`.

    Slots are reused after their last use, so that memory stays small for large batches.
    """

    def __init__(self, outputs: Sequence[Expression], inputs: Sequence[str]) -> None:
        order = topological(outputs)
        names = {name: index for index, name in enumerate(inputs)}
        last_use = {arg: place for place, node in enumerate(order) for arg in node.args}
        last_use.update(dict.fromkeys(outputs, len(order)))
        constants: list[tuple[int, Interval]] = []
        self._symbols: list[tuple[int, int]] = []
        self._steps: list[Step] = []
        self._tables: list[Lookup] = []
        slot: dict[Expression, int] = {}
        free: list[int] = []
        size = 0
        for place, node in enumerate(order):
            slot[node] = target = size
            if node.op in ("const", "pi"):
                constants.append((target, _constant(node)))
                size += 1
            elif node.op == "symbol":
                if str(node.value) not in names:
                    raise ValueError(f"{node.value} is not an input of the tape")
                self._symbols.append((target, names[str(node.value)]))
                size += 1
            else:
                arguments = tuple(slot[arg] for arg in node.args)
                slot[node] = target = free.pop() if free else size
                size += target == size
                exponent = node.value if isinstance(node.value, int) else 0
                if node.op == "table":
                    exponent = len(self._tables)
                    self._tables.append(node.lookup)
                self._steps.append((node.op, target, arguments, exponent))
                free.extend(
                    slot[arg]
                    for arg in dict.fromkeys(node.args)
                    if last_use[arg] == place and arg.op not in ("const", "pi", "symbol")
                )
        self._outputs = tuple(slot[node] for node in outputs)
        self.inputs = tuple(inputs)
        self._memory = [_NOTHING] * size
        for target, value in constants:
            self._memory[target] = value
        self._floats = [value.lo for value in self._memory]

    def run_floats(self, values: Sequence[Array], shape: tuple[int, ...]) -> Array:
        """Float values of the outputs, shape (outputs, *shape); rounded, hence for proposals only."""
        with np.errstate(all="ignore"):
            return self.run_floats_silenced(values, shape)

    def run_floats_silenced(self, values: Sequence[Array], shape: tuple[int, ...]) -> Array:
        """The same for whoever has silenced numpy for many runs."""
        memory = self._floats.copy()
        for target, index in self._symbols:
            memory[target] = values[index]
        for op, target, arguments, exponent in self._steps:
            if op == "mul":  # nearly all steps are of these two: without a list and a call
                memory[target] = memory[arguments[0]] * memory[arguments[1]]
            elif op == "add":
                memory[target] = memory[arguments[0]] + memory[arguments[1]]
            elif op == "table":
                memory[target] = lookup.values(self._tables[exponent], memory[arguments[0]])
            else:
                memory[target] = _FLOATS[op]([memory[i] for i in arguments], exponent)
        result = np.empty((len(self._outputs), *shape))
        for row, index in enumerate(self._outputs):
            result[row] = memory[index]
        return result

    def run(self, values: Sequence[Interval], shape: tuple[int, ...]) -> Interval:
        """Enclosures of the outputs, shape (outputs, *shape); unknown values are unbounded."""
        memory = self._memory.copy()
        for target, index in self._symbols:
            memory[target] = values[index]
        with np.errstate(all="ignore"):
            for op, target, arguments, exponent in self._steps:
                if op == "table":
                    memory[target] = lookup.enclosure(self._tables[exponent], memory[arguments[0]])
                else:
                    memory[target] = _INTERVALS[op]([memory[i] for i in arguments], exponent)
        lo, hi = np.empty((len(self._outputs), *shape)), np.empty((len(self._outputs), *shape))
        for row, index in enumerate(self._outputs):
            lo[row], hi[row] = memory[index].lo, memory[index].hi
        return Interval(lo, hi).sanitised()


_NOTHING = Interval.exact(np.nan)


@cache
def _fraction(numerator: int, denominator: int) -> Interval:
    from fractions import Fraction

    return Interval.of(Fraction(numerator, denominator))


def _constant(node: Expression) -> Interval:
    if node.op == "pi":
        return iv.PI
    return _fraction(node.fraction.numerator, node.fraction.denominator)


_FLOATS: Mapping[str, Callable[[list[Array], int], Array]] = {
    "div": lambda a, _: a[0] / a[1],
    "pow": lambda a, n: np.power(a[0], n) if n > 0 else 1.0 / np.power(a[0], -n),
    "sqrt": lambda a, _: np.sqrt(a[0]),
    "sin": lambda a, _: np.sin(a[0]),
    "cos": lambda a, _: np.cos(a[0]),
    "tan": lambda a, _: np.tan(a[0]),
    "asin": lambda a, _: np.arcsin(a[0]),
    "acos": lambda a, _: np.arccos(a[0]),
    "atan": lambda a, _: np.arctan(a[0]),
    "sinh": lambda a, _: np.sinh(a[0]),
    "cosh": lambda a, _: np.cosh(a[0]),
    "tanh": lambda a, _: np.tanh(a[0]),
    "exp": lambda a, _: np.exp(a[0]),
    "log": lambda a, _: np.log(a[0]),
    "norm": lambda a, _: np.sqrt(sum((x * x for x in a), start=np.zeros(()))),
    "direction": lambda a, i: a[i] / np.sqrt(sum((x * x for x in a), start=np.zeros(()))),
}

_INTERVALS: Mapping[str, Callable[[list[Interval], int], Interval]] = {
    "add": lambda a, _: a[0] + a[1],
    "mul": lambda a, _: a[0] * a[1],
    "div": lambda a, _: a[0] / a[1],
    "pow": lambda a, n: a[0] ** n,
    "sqrt": lambda a, _: iv.sqrt(a[0]),
    "sin": lambda a, _: iv.sin(a[0]),
    "cos": lambda a, _: iv.cos(a[0]),
    "tan": lambda a, _: iv.tan(a[0]),
    "asin": lambda a, _: iv.asin(a[0]),
    "acos": lambda a, _: iv.acos(a[0]),
    "atan": lambda a, _: iv.atan(a[0]),
    "sinh": lambda a, _: iv.sinh(a[0]),
    "cosh": lambda a, _: iv.cosh(a[0]),
    "tanh": lambda a, _: iv.tanh(a[0]),
    "exp": lambda a, _: iv.exp(a[0]),
    "log": lambda a, _: iv.log(a[0]),
    "norm": lambda a, _: iv.norm(a),
    "direction": iv.direction,
}
