"""Exact expressions: an immutable, hash-consed graph over rational constants.

Structurally equal expressions are the same object, so a derivative of a large matrix shares its common parts
and `is` decides structural equality, also after copying or pickling. Constants are `Fraction`s and are folded exactly;
nothing is ever rounded here.

Simplification (0*e -> 0, e/e never) may forget that a part was undefined somewhere; the parser therefore
records every partial operation as an obligation *before* the graph is built (see `parse`), and the model
proves those.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from itertools import count
from math import isqrt
from typing import Final
from weakref import WeakValueDictionary

from tubecert.expression.lookup import Lookup

Number = int | Fraction
Value = Fraction | str | int | Lookup | None
_Row = tuple[str, Value, tuple[int, ...]]  # operation, value, places of the arguments

_table: WeakValueDictionary[tuple[object, ...], Expression]
_serial = count()


class Expression:
    """A node: an operation `op`, its arguments, and for some operations a `value`.

    | op | args | value |
    |---|---|---|
    | `const` | - | the `Fraction` |
    | `pi` | - | - |
    | `symbol` | - | its name |
    | `add`, `mul`, `div` | two | - |
    | `pow` | base | integer exponent, not 0 or 1 |
    | a name in `FUNCTIONS` (`sqrt`, `sin`, `tanh`, ...) | one | - |
    | `table` | one | the `Lookup` |
    | `norm` | one or more | - (Euclidean norm; of one argument: its absolute value) |
    | `direction` | those of a norm | i: component i of args/norm(args); where norm is 0, any in [-1, 1] |
    """

    __slots__ = ("__weakref__", "args", "op", "serial", "value")

    op: str
    args: tuple[Expression, ...]
    value: Value
    serial: int

    def __add__(self, other: Expression | Number) -> Expression:
        return add(self, as_expression(other))

    __radd__ = __add__

    def __mul__(self, other: Expression | Number) -> Expression:
        return mul(self, as_expression(other))

    __rmul__ = __mul__

    def __neg__(self) -> Expression:
        return mul(constant(-1), self)

    def __sub__(self, other: Expression | Number) -> Expression:
        return add(self, -as_expression(other))

    def __rsub__(self, other: Expression | Number) -> Expression:
        return add(as_expression(other), -self)

    def __truediv__(self, other: Expression | Number) -> Expression:
        return div(self, as_expression(other))

    def __rtruediv__(self, other: Expression | Number) -> Expression:
        return div(as_expression(other), self)

    def __pow__(self, exponent: int) -> Expression:
        return power(self, exponent)

    @property
    def is_constant(self) -> bool:
        """Whether this is a rational constant."""
        return self.op == "const"

    @property
    def fraction(self) -> Fraction:
        """The value of a rational constant."""
        if not isinstance(self.value, Fraction):
            raise TypeError(f"{self.op} is not a rational constant")
        return self.value

    @property
    def lookup(self) -> Lookup:
        """The table that a `table` reads."""
        if not isinstance(self.value, Lookup):
            raise TypeError(f"{self.op} is no table")
        return self.value

    def __copy__(self) -> Expression:
        return self

    def __deepcopy__(self, memo: object) -> Expression:
        return self

    def __reduce__(self) -> tuple[Callable[[tuple[_Row, ...]], Expression], tuple[tuple[_Row, ...]]]:
        """As a list of operations: what is unpickled is the one node that stands for it, in any process."""
        order = topological([self])
        place = {node: i for i, node in enumerate(order)}
        rows = tuple((node.op, node.value, tuple(place[arg] for arg in node.args)) for node in order)
        return _restored, (rows,)

    def __repr__(self) -> str:
        from tubecert.expression.text import to_text

        return to_text(self)


_table = WeakValueDictionary()


def _node(op: str, args: tuple[Expression, ...] = (), value: Value = None) -> Expression:
    key = (op, value, *(id(arg) for arg in args))
    found = _table.get(key)
    if found is None:
        found = Expression.__new__(Expression)
        found.op, found.args, found.value, found.serial = op, args, value, next(_serial)
        _table[key] = found
    return found


def _restored(rows: tuple[_Row, ...]) -> Expression:
    """The expression of `Expression.__reduce__`."""
    nodes: list[Expression] = []
    for op, value, places in rows:
        args = tuple(nodes[i] for i in places)
        if op == "add" or (op == "mul" and not args[0].is_constant):
            args = _ordered(*args)  # by the history of this process, not of the one that wrote it
        nodes.append(_node(op, args, value))
    return nodes[-1]


def constant(value: Number) -> Expression:
    """A rational constant."""
    return _node("const", (), Fraction(value))


def symbol(name: str) -> Expression:
    """A variable."""
    return _node("symbol", (), name)


ZERO: Final = constant(0)
ONE: Final = constant(1)
PI: Final = _node("pi")


def as_expression(value: Expression | Number) -> Expression:
    """`value` itself, or the constant it stands for."""
    return value if isinstance(value, Expression) else constant(value)


def add(a: Expression, b: Expression) -> Expression:
    """The sum a + b."""
    if a.is_constant and b.is_constant:
        return constant(a.fraction + b.fraction)
    if a is ZERO:
        return b
    if b is ZERO:
        return a
    if coefficient(a)[1] is coefficient(b)[1]:
        (p, rest), (q, _) = coefficient(a), coefficient(b)
        return mul(constant(p + q), rest)
    return _node("add", _ordered(a, b))


def mul(a: Expression, b: Expression) -> Expression:
    """The product a b; rational factors are collected in front, equal factors become powers."""
    if a is ONE or b is ONE:
        return b if a is ONE else a
    if a is ZERO or b is ZERO:
        return ZERO
    (p, a), (q, b) = coefficient(a), coefficient(b)
    factor = p * q
    if factor == 0:
        return ZERO
    if a is ONE:
        product = b
    elif b is ONE:
        product = a
    else:
        (a_base, m), (b_base, n) = _base(a), _base(b)
        product = power(a_base, m + n) if a_base is b_base else _node("mul", _ordered(a, b))
    if factor == 1:
        return product
    return constant(factor) if product is ONE else _node("mul", (constant(factor), product))


def div(a: Expression, b: Expression) -> Expression:
    """The quotient a / b; a constant zero divisor raises `ZeroDivisionError`."""
    if b.is_constant:
        if b.fraction == 0:
            raise ZeroDivisionError
        return mul(constant(1 / b.fraction), a)
    if a is ZERO:
        return ZERO
    p, numerator = coefficient(a)
    q, denominator = coefficient(b)
    return mul(constant(p / q), _node("div", (numerator, denominator)))


def power(base: Expression, exponent: int) -> Expression:
    """`base` to an integer power; 0 ** 0 is 1, 0 to a negative power raises `ZeroDivisionError`."""
    if exponent == 0:
        return ONE
    if exponent == 1:
        return base
    if base.is_constant:
        return constant(base.fraction**exponent)
    if base.op == "pow":
        return power(base.args[0], int(str(base.value)) * exponent)
    p, rest = coefficient(base)
    if p != 1:
        return mul(constant(p**exponent), power(rest, exponent))  # rest may be a power itself
    return _node("pow", (base,), exponent)


def sqrt(e: Expression) -> Expression:
    """Square root; of the square of a rational, that rational."""
    known = rational_root(e.fraction) if e.is_constant else None
    return _node("sqrt", (e,)) if known is None else constant(known)


def rational_root(q: Fraction) -> Fraction | None:
    """The square root of a number, if it is rational."""
    root = Fraction(isqrt(max(q.numerator, 0)), isqrt(q.denominator))
    return root if root * root == q else None


def _smooth(op: str, *known: Expression) -> Callable[[Expression], Expression]:
    """A smooth function; `known` are an argument and its exact value there."""

    def applied(e: Expression) -> Expression:
        return known[1] if known and e is known[0] else _node(op, (e,))

    return applied


sin: Final = _smooth("sin", ZERO, ZERO)
cos: Final = _smooth("cos", ZERO, ONE)
tan: Final = _smooth("tan", ZERO, ZERO)
exp: Final = _smooth("exp", ZERO, ONE)
log: Final = _smooth("log", ONE, ZERO)
asin: Final = _smooth("asin", ZERO, ZERO)
acos: Final = _smooth("acos")
atan: Final = _smooth("atan", ZERO, ZERO)
sinh: Final = _smooth("sinh", ZERO, ZERO)
cosh: Final = _smooth("cosh", ZERO, ONE)
tanh: Final = _smooth("tanh", ZERO, ZERO)
FUNCTIONS: Final[Mapping[str, Callable[[Expression], Expression]]] = {
    "sin": sin, "cos": cos, "tan": tan, "asin": asin, "acos": acos, "atan": atan, "sinh": sinh,
    "cosh": cosh, "tanh": tanh, "exp": exp, "log": log, "sqrt": sqrt,
}  # fmt: skip
"""The smooth functions of one argument, by name; asin in (-pi/2, pi/2), acos in (0, pi), atan in (-pi/2, pi/2)."""


def table(lookup: Lookup, e: Expression) -> Expression:
    """A table's function; of a number in its range, that exact number, unless it jumps there."""
    known = lookup.at(e.fraction) if e.is_constant else None
    return _node("table", (e,), lookup) if known is None else constant(known)


def norm(args: Iterable[Expression]) -> Expression:
    """Euclidean norm of the arguments; of one argument, its absolute value."""
    kept = tuple(arg for arg in args if arg is not ZERO)
    if not kept:
        return ZERO
    if len(kept) == 1 and kept[0].is_constant:
        return constant(abs(kept[0].fraction))
    return _node("norm", kept)


def direction(args: tuple[Expression, ...], index: int) -> Expression:
    """Entry `index` of a vector over its length: what the gradient of a norm is, where there is one."""
    return _node("direction", args, index)


def coefficient(e: Expression) -> tuple[Fraction, Expression]:
    """`(q, rest)` with e = q rest and rest free of a leading rational factor."""
    if e.is_constant:
        return e.fraction, ONE
    if e.op == "mul" and e.args[0].is_constant:
        return e.args[0].fraction, e.args[1]
    return Fraction(1), e


def _base(e: Expression) -> tuple[Expression, int]:
    return (e.args[0], int(str(e.value))) if e.op == "pow" else (e, 1)


def _ordered(a: Expression, b: Expression) -> tuple[Expression, Expression]:
    return (a, b) if a.serial <= b.serial else (b, a)


def topological(roots: Iterable[Expression]) -> list[Expression]:
    """Every node that `roots` need, arguments before their users; no recursion, any depth."""
    order: list[Expression] = []
    seen: set[Expression] = set()
    stack = [(root, False) for root in reversed(list(roots))]
    while stack:
        node, expanded = stack.pop()
        if expanded:
            order.append(node)
        elif node not in seen:
            seen.add(node)
            stack.append((node, True))
            stack.extend((arg, False) for arg in reversed(node.args) if arg not in seen)
    return order
