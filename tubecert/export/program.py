"""Straight-line programs: the arithmetic of a controller, one operation for each step.

Every language is printed from the same program, and the numbers that exported code is compared with are computed by
it. So the operations, and their order, are the same everywhere.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Final, Literal, TypeAlias

from tubecert.expression import Expression, topological
from tubecert.expression.lookup import Lookup
from tubecert.expression.matrix import Matrix

Operation = Literal["input", "constant", "add", "sub", "mul", "div", "neg", "call", "choose"]
ADD: Final = "add"
FUNCTIONS: Final = (
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log",
)  # fmt: skip
TABLE: Final = "table_"  # begins the name of a function of a table
RATIO: Final = "ratio"  # a/b where a > 0 and b > 0, else 0
SHRINK: Final = "shrink"  # b/a where a > b, else 1
LEAST: Final = "least"
GREATEST: Final = "greatest"
PI: Final = Fraction("3.14159265358979323846264338327950288419716939937510582097494459")


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """An operation on earlier results, by their places; `name` of an input, a function or a choice."""

    operation: Operation
    places: tuple[int, ...] = ()
    value: Fraction = Fraction(0)
    name: str = ""
    index: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A vector that goes in or comes out, by the places of its entries."""

    name: str
    places: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Program:
    """Steps in their order, what goes in and what comes out; `marked`: what in between has a name in a proof.

    `tables`: those whose functions are called, by the names `table_NAME`.
    """

    name: str
    words: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    steps: tuple[Step, ...]
    marked: tuple[Port, ...] = ()
    tables: tuple[Lookup, ...] = ()

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """The constants as floats, by place; 0 elsewhere."""
        return tuple(float(step.value) for step in self.steps)

    def table(self, step: Step) -> Lookup:
        """The one whose function a step calls."""
        return next(own for own in self.tables if step.name == f"{TABLE}{own.name}")

    @property
    def operations(self) -> dict[str, int]:
        """How often each operation is done; every step counts once."""
        found: dict[str, int] = {}
        for step in self.steps:
            if step.operation not in ("input", "constant"):
                key = step.name or step.operation
                found[key] = found.get(key, 0) + 1
        return found


Place: TypeAlias = int
Names: TypeAlias = Mapping[str, Place]


class Writer:
    """Collects steps; equal ones become one, and constants are folded exactly."""

    def __init__(self) -> None:
        self._steps: list[Step] = []
        self._known: dict[Step, Place] = {}
        self._inputs: list[Port] = []
        self._outputs: list[Port] = []
        self._marked: list[Port] = []
        self._tables: dict[str, Lookup] = {}

    def input(self, name: str, size: int) -> list[Place]:
        """A vector that goes in."""
        places = [self._put(Step(operation="input", name=name, index=i)) for i in range(size)]
        self._inputs.append(Port(name=name, places=tuple(places)))
        return places

    def output(self, name: str, places: Sequence[Place]) -> None:
        """A vector that comes out."""
        self._outputs.append(Port(name=name, places=tuple(places)))

    def mark(self, name: str, places: Sequence[Place]) -> None:
        """A vector in between."""
        self._marked.append(Port(name=name, places=tuple(places)))

    def finished(self, name: str, words: str) -> Program:
        """The program: only the steps that something needs."""
        needed, steps = set(), self._steps
        ports = (*self._inputs, *self._outputs, *self._marked)
        waiting = [place for port in ports for place in port.places]
        while waiting:
            place = waiting.pop()
            if place not in needed:
                needed.add(place)
                waiting += steps[place].places
        kept = sorted(needed)
        moved = {old: new for new, old in enumerate(kept)}
        return Program(
            name=name,
            words=words,
            inputs=_moved(self._inputs, moved),
            outputs=_moved(self._outputs, moved),
            marked=_moved(self._marked, moved),
            tables=tuple(
                self._tables[name] for name in sorted({steps[old].name for old in kept} & self._tables.keys())
            ),
            steps=tuple(
                Step(
                    operation=steps[old].operation,
                    places=tuple(moved[place] for place in steps[old].places),
                    value=steps[old].value,
                    name=steps[old].name,
                    index=steps[old].index,
                )
                for old in kept
            ),
        )

    def constant(self, value: Fraction | int) -> Place:
        """A number."""
        return self._put(Step(operation="constant", value=Fraction(value)))

    def add(self, a: Place, b: Place) -> Place:
        """a + b."""
        p, q = self._value(a), self._value(b)
        if p is not None and q is not None:
            return self.constant(p + q)
        if p == 0 or q == 0:
            return b if p == 0 else a
        if self._steps[b].operation == "neg":
            return self.sub(a, self._steps[b].places[0])
        if self._steps[a].operation == "neg":
            return self.sub(b, self._steps[a].places[0])
        return self._put(Step(operation="add", places=(a, b)))

    def sub(self, a: Place, b: Place) -> Place:
        """a - b."""
        p, q = self._value(a), self._value(b)
        if p is not None and q is not None:
            return self.constant(p - q)
        if p == 0 or q == 0:
            return self.neg(b) if p == 0 else a
        if self._steps[b].operation == "neg":
            return self.add(a, self._steps[b].places[0])
        return self._put(Step(operation="sub", places=(a, b)))

    def neg(self, a: Place) -> Place:
        """-a."""
        p, step = self._value(a), self._steps[a]
        if p is not None:
            return self.constant(-p)
        return step.places[0] if step.operation == "neg" else self._put(Step(operation="neg", places=(a,)))

    def mul(self, a: Place, b: Place) -> Place:
        """a b."""
        p, q = self._value(a), self._value(b)
        if p is not None and q is not None:
            return self.constant(p * q)
        for value, other in ((p, b), (q, a)):
            if value == 0:
                return self.constant(0)
            if value is not None and value < 0:
                return self.neg(self.mul(self.constant(-value), other))
            if value == 1:
                return other
        return self._put(Step(operation="mul", places=(a, b)))

    def div(self, a: Place, b: Place) -> Place:
        """a/b; a divisor that is a number is one that is multiplied with."""
        q = self._value(b)
        if q:
            return self.mul(self.constant(1 / q), a)
        if self._value(a) == 0:
            return a
        return self._put(Step(operation="div", places=(a, b)))

    def call(self, name: str, a: Place) -> Place:
        """A function of one argument."""
        return self._put(Step(operation="call", places=(a,), name=name))

    def choose(self, name: str, a: Place, b: Place) -> Place:
        """RATIO, SHRINK, LEAST or GREATEST of two."""
        return self._put(Step(operation="choose", places=(a, b), name=name))

    def total(self, terms: Sequence[Place]) -> Place:
        """A sum, from the left."""
        found = self.constant(0)
        for term in terms:
            found = self.add(found, term)
        return found

    def dot(self, a: Sequence[Place], b: Sequence[Place]) -> Place:
        """a'b, from the left."""
        return self.total([self.mul(p, q) for p, q in zip(a, b, strict=True)])

    def expressions(self, roots: Sequence[Expression], names: Names) -> list[Place]:
        """Expressions of named places. ValueError if they contain any other name.

        Operands of sums and products are in an order of their own: that of an expression depends on what the process
        did before.
        """
        order = topological(roots)
        keys = _keys(order)
        done: dict[Expression, Place] = {}
        for node in sorted(order, key=lambda node: keys[node]):  # shallow ones first
            done[node] = self._node(node, names, done, keys)
        return [done[root] for root in roots]

    def matrix(self, rows: Matrix, names: Names) -> list[list[Place]]:
        """The same of a matrix."""
        return [self.expressions(row, names) for row in rows]

    def _node(
        self, node: Expression, names: Names, done: Mapping[Expression, Place], keys: Mapping[Expression, Key]
    ) -> Place:
        args = [done[arg] for arg in node.args]
        if node.op in ("add", "mul"):
            args = [done[arg] for arg in sorted(node.args, key=lambda arg: keys[arg])]
            return self.add(*args) if node.op == ADD else self.mul(*args)
        if node.op == "const":
            return self.constant(node.fraction)
        if node.op == "pi":
            return self.constant(PI)
        if node.op == "symbol":
            if node.value not in names:
                raise ValueError(f"{node.value} is not known to a controller")
            return names[str(node.value)]
        if node.op == "div":
            return self.div(*args)
        if node.op == "pow":
            return self._power(args[0], int(str(node.value)))
        if node.op == "norm":
            return self.call("sqrt", self.dot(args, args))
        if node.op in FUNCTIONS:
            return self.call(node.op, args[0])
        if node.op == "table" and node.lookup.order == 0:
            name = f"{TABLE}{node.lookup.name}"
            self._tables[name] = node.lookup
            return self.call(name, args[0])
        raise ValueError(f"{node.op} is not exported")

    def _power(self, base: Place, exponent: int) -> Place:
        """By products, from the left."""
        found = base
        for _ in range(abs(exponent) - 1):
            found = self.mul(found, base)
        return found if exponent > 0 else self.div(self.constant(1), found)

    def _put(self, step: Step) -> Place:
        found = self._known.get(step)
        if found is None:
            found = self._known[step] = len(self._steps)
            self._steps.append(step)
        return found

    def _value(self, place: Place) -> Fraction | None:
        step = self._steps[place]
        return step.value if step.operation == "constant" else None


def _moved(ports: Sequence[Port], moved: Mapping[Place, Place]) -> tuple[Port, ...]:
    return tuple(Port(name=port.name, places=tuple(moved[place] for place in port.places)) for port in ports)


Key: TypeAlias = tuple[int, str]


def _keys(order: Sequence[Expression]) -> dict[Expression, Key]:
    """Depth and a digest of what an expression says: the same in every process."""
    keys: dict[Expression, Key] = {}
    for node in order:
        below = [keys[arg] for arg in node.args]
        if node.op in ("add", "mul"):
            below.sort()
        said = f"{node.op} {node.value} {' '.join(digest for _, digest in below)}"
        depth = 1 + max((depth for depth, _ in below), default=0 if node.is_constant else 1)
        keys[node] = depth, hashlib.sha256(said.encode()).hexdigest()
    return keys
