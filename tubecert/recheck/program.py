"""Terms as straight lines of steps on balls, and the kernels of the operations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import product

from flint import arb

from tubecert.recheck.balls import Ball, between, exact, length, power
from tubecert.recheck.lookup import over
from tubecert.recheck.terms import Term, in_order, number_of, table_of


class Program:
    """Terms as a straight line of steps, run on balls."""

    def __init__(self, outputs: Sequence[Term], inputs: Sequence[str], *, wide: bool = False) -> None:
        """`wide`: for wide balls, of which flint's own products and powers are wider than they can be."""
        order = in_order(outputs)
        place = {term: k for k, term in enumerate(order)}
        column = {name: k for k, name in enumerate(inputs)}
        self._start: list[arb] = [arb(0)] * len(order)
        self._inputs: list[tuple[int, int]] = []
        self._steps: list[tuple[int, Callable[[list[arb], int], arb] | str, list[int], int]] = []
        for k, term in enumerate(order):
            if term.op == "const":
                self._start[k] = exact(number_of(term))
            elif term.op == "pi":
                self._start[k] = arb.pi()
            elif term.op == "symbol":
                self._inputs.append((k, column[str(term.value)]))
            else:
                index = term.value if isinstance(term.value, int) else 0
                plain = term.op if term.op in ("add", "mul") else _kernel(term)
                kernel = _WIDE.get(term.op, plain) if wide else plain
                self._steps.append((k, kernel, [place[arg] for arg in term.args], index))
        self._outputs = [place[term] for term in outputs]

    def __len__(self) -> int:
        """The number of outputs."""
        return len(self._outputs)

    def run(self, values: Sequence[Ball]) -> list[Ball]:
        """Enclosures of the outputs."""
        memory = self._start.copy()
        for k, column in self._inputs:
            memory[k] = values[column]
        for k, kernel, args, index in self._steps:
            if kernel == "mul":
                memory[k] = memory[args[0]] * memory[args[1]]
            elif kernel == "add":
                memory[k] = memory[args[0]] + memory[args[1]]
            else:
                assert not isinstance(kernel, str)
                memory[k] = kernel([memory[i] for i in args], index)
        return [memory[k] for k in self._outputs]


def _kernel(term: Term) -> Callable[[list[Ball], int], Ball]:
    if term.op != "table":
        return _KERNELS[term.op]
    table = table_of(term)
    return lambda args, _: over(table, args[0])


def _direction(args: list[Ball], index: int) -> Ball:
    if len(args) == 1 and (args[0] > 0 or args[0] < 0):
        return arb(1) if args[0] > 0 else arb(-1)
    size = length(args)
    if not size > 0:
        return between(-1, 1)
    value = args[index] / size
    return value.intersection(between(-1, 1)) if value.overlaps(between(-1, 1)) else value


def _product(x: Ball, y: Ball) -> Ball:
    """x y, by the products of the ends."""
    if x.is_exact() or y.is_exact():
        return x * y
    return reduce(arb.union, (a * b for a, b in product((x.lower(), x.upper()), (y.lower(), y.upper()))))


def _power(x: Ball, n: int) -> Ball:
    """x^n, by its values at the ends where it is monotone between them."""
    return power(x, n) if x.contains(0) else power(x.lower(), n).union(power(x.upper(), n))


def _increasing(function: Callable[[Ball], Ball]) -> Callable[[list[Ball], int], Ball]:
    """An increasing function, by its values at the ends of a ball: flint's own are wide on wide balls."""
    return lambda args, _: between(function(args[0].lower()), function(args[0].upper()))


def _cosh(args: list[Ball], index: int) -> Ball:
    del index
    return between(args[0].abs_lower().cosh(), args[0].abs_upper().cosh())


def _known(kernel: Callable[[list[Ball], int], Ball]) -> Callable[[list[Ball], int], Ball]:
    """The kernel, which knows nothing of what is not a number: flint's asin and acos of it are thin balls."""
    return lambda args, index: arb("nan") if any(x.is_nan() for x in args) else kernel(args, index)


_KERNELS: Mapping[str, Callable[[list[Ball], int], Ball]] = {
    "div": lambda a, _: a[0] / a[1],
    "pow": lambda a, n: power(a[0], n),
    "sqrt": lambda a, _: a[0].sqrt(),
    "sin": lambda a, _: a[0].sin(),
    "cos": lambda a, _: a[0].cos(),
    "tan": lambda a, _: a[0].tan(),
    "asin": _known(_increasing(Ball.asin)),
    "acos": _known(lambda a, _: between(a[0].upper().acos(), a[0].lower().acos())),
    "atan": _increasing(Ball.atan),
    "sinh": _increasing(Ball.sinh),
    "cosh": _cosh,
    "tanh": _increasing(Ball.tanh),
    "exp": lambda a, _: a[0].exp(),
    "log": _increasing(Ball.log),
    "norm": lambda a, _: length(a),
    "direction": _direction,
}
_WIDE: Mapping[str, Callable[[list[Ball], int], Ball]] = {
    "mul": lambda a, _: _product(*a),
    "pow": lambda a, n: _power(a[0], n),
}
