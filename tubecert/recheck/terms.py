"""Expressions of this room: hash-consed terms with derivative rules of their own, evaluated on balls.

A term is built by `grammar` from a text. Derivatives are sums over the arguments of a node of its partial
derivative times theirs; the partial derivatives stand in one table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import count
from weakref import WeakValueDictionary

from tubecert.recheck.lookup import Table

Value = Fraction | str | int | Table | None
Rows = Sequence[Sequence["Term"]]
Matrix = list[list["Term"]]

_known: WeakValueDictionary[tuple[object, ...], Term] = WeakValueDictionary()
_serial = count()


class Term:
    """An operation `op` on other terms; `value` is a number, a name, an exponent, an index or a table.

    The operations are `const`, `symbol`, `pi`, and those of `_PARTIAL`.
    """

    __slots__ = ("__weakref__", "args", "op", "serial", "value")

    op: str
    args: tuple[Term, ...]
    value: Value
    serial: int

    def __add__(self, other: Term) -> Term:
        if self.op == other.op == "const":
            return number(number_of(self) + number_of(other))
        if self is NOUGHT:
            return other
        if other is NOUGHT:
            return self
        return _make("add", *sorted((self, other), key=_age))

    def __mul__(self, other: Term) -> Term:
        if self.op == other.op == "const":
            return number(number_of(self) * number_of(other))
        if NOUGHT in (self, other):
            return NOUGHT
        if self is UNIT:
            return other
        if other is UNIT:
            return self
        for q, rest in ((self, other), (other, self)):  # one coefficient for a product
            if q.op == "const" and rest.op == "mul" and "const" in (own := [arg.op for arg in rest.args]):
                k = own.index("const")
                return number(number_of(q) * number_of(rest.args[k])) * rest.args[1 - k]
        return _make("mul", *sorted((self, other), key=_age))

    def __neg__(self) -> Term:
        return number(-1) * self

    def __sub__(self, other: Term) -> Term:
        return NOUGHT if self is other else self + (-other)

    def __truediv__(self, other: Term) -> Term:
        if other.op == "const" and number_of(other) != 0:
            return self * number(1 / number_of(other))
        return NOUGHT if self is NOUGHT else _make("div", self, other)

    def raised(self, exponent: int) -> Term:
        """An integer power."""
        if exponent in (0, 1):
            return self if exponent else UNIT
        if self.op == "const" and (exponent > 0 or self is not NOUGHT):
            return number(number_of(self) ** exponent)
        return _make("pow", self, value=exponent)


def _age(term: Term) -> int:
    return term.serial


def number_of(term: Term) -> Fraction:
    """The number that a constant term is."""
    assert isinstance(term.value, Fraction)
    return term.value


def table_of(term: Term) -> Table:
    """The table that a `table` reads."""
    assert isinstance(term.value, Table)
    return term.value


def _make(op: str, *args: Term, value: Value = None) -> Term:
    key = (op, value, *(id(arg) for arg in args))
    return _known.get(key) or _kept(key, op, args, value)


def _kept(key: tuple[object, ...], op: str, args: tuple[Term, ...], value: Value) -> Term:
    _known[key] = found = Term()
    found.op, found.args, found.value, found.serial = op, args, value, next(_serial)
    return found


def number(q: Fraction | int) -> Term:
    """A rational constant."""
    # the hash of a fraction costs as much as a product of polynomials
    key = ("const", q.numerator, q.denominator)
    return _known.get(key) or _kept(key, "const", (), q if isinstance(q, Fraction) else Fraction(q))


def variable(name: str) -> Term:
    """A variable."""
    return _make("symbol", value=name)


NOUGHT = number(0)
UNIT = number(1)


def function(op: str, *args: Term, value: int | None = None) -> Term:
    """A function of the grammar, `norm` or `direction` of terms."""
    return _make(op, *args, value=value)


def operation(op: str, *args: Term) -> Term:
    """An operation of the grammar on terms: `pi`, or a function; its value where that is known exactly."""
    return _known_value(op, args) or _make(op, *args)


def looked_up(table: Table, x: Term) -> Term:
    """The function of a table; of a number, its exact value if it has one."""
    known = table.value(number_of(x)) if x.op == "const" else None
    return _make("table", x, value=table) if known is None else number(known)


def remade(term: Term, args: tuple[Term, ...]) -> Term:
    """The operation of a term on other arguments."""
    match term.op:
        case "add":
            return args[0] + args[1]
        case "mul":
            return args[0] * args[1]
        case "div":
            return args[0] / args[1]
        case "pow":
            return args[0].raised(int(str(term.value)))
        case "table":
            return looked_up(table_of(term), args[0])
    return _known_value(term.op, args) or (_make(term.op, *args, value=term.value) if args else term)


def _known_value(op: str, args: tuple[Term, ...]) -> Term | None:
    """The value of a function at the constants 0 and 1, where it is a whole number."""
    if args and args[0] is NOUGHT and op in _AT_ZERO:
        return number(_AT_ZERO[op])
    return UNIT if op == "sqrt" and args[0] is UNIT else None


_AT_ZERO = {"sin": 0, "tan": 0, "asin": 0, "atan": 0, "sinh": 0, "tanh": 0, "cos": 1, "cosh": 1, "exp": 1}


def in_order(roots: Iterable[Term]) -> list[Term]:
    """Every term that the roots need, arguments first."""
    order: dict[Term, None] = {}
    stack = list(roots)
    while stack:
        term = stack[-1]
        waiting = [arg for arg in term.args if arg not in order]
        if waiting:
            stack.extend(waiting)
        else:
            order.setdefault(stack.pop())
    return list(order)


def names(roots: Iterable[Term]) -> set[str]:
    """The variables that occur."""
    return {str(term.value) for term in in_order(roots) if term.op == "symbol"}


def replaced(roots: Sequence[Term], values: Mapping[str, Term]) -> list[Term]:
    """The terms with variables replaced by terms, all at once."""
    new: dict[Term, Term] = {}
    for term in in_order(roots):
        if term.op == "symbol":
            new[term] = values.get(str(term.value), term)
        else:
            new[term] = remade(term, tuple(new[arg] for arg in term.args)) if term.args else term
    return [new[root] for root in roots]


def _leg(u: Term) -> Term:
    """sqrt(1 - u^2)."""
    return function("sqrt", UNIT - u.raised(2))


def _turning(e: Term, i: int) -> Term:
    """d(a_k/|a|)/da_i = (delta_ik - a_i a_k/|a|^2)/|a|; the sign of one argument does not turn."""
    if len(e.args) == 1:
        return NOUGHT
    other = function("direction", *e.args, value=i)
    return ((UNIT if e.value == i else NOUGHT) - e * other) / function("norm", *e.args)


_PARTIAL: Mapping[str, Callable[[Term, int], Term]] = {
    "add": lambda e, i: UNIT,
    "mul": lambda e, i: e.args[1 - i],
    "div": lambda e, i: UNIT / e.args[1] if i == 0 else -(e.args[0] / e.args[1].raised(2)),
    "pow": lambda e, i: number(int(str(e.value))) * e.args[0].raised(int(str(e.value)) - 1),
    "sqrt": lambda e, i: number(Fraction(1, 2)) / e,
    "sin": lambda e, i: function("cos", e.args[0]),
    "cos": lambda e, i: -function("sin", e.args[0]),
    "tan": lambda e, i: UNIT / function("cos", e.args[0]).raised(2),
    "asin": lambda e, i: UNIT / _leg(e.args[0]),
    "acos": lambda e, i: -(UNIT / _leg(e.args[0])),
    "atan": lambda e, i: UNIT / (UNIT + e.args[0].raised(2)),
    "sinh": lambda e, i: function("cosh", e.args[0]),
    "cosh": lambda e, i: function("sinh", e.args[0]),
    "tanh": lambda e, i: UNIT - e.raised(2),
    "exp": lambda e, i: e,
    "log": lambda e, i: UNIT / e.args[0],
    "table": lambda e, i: looked_up(table_of(e).slope, e.args[0]),
    "norm": lambda e, i: function("direction", *e.args, value=i),
    "direction": _turning,
}
"""The derivative of an operation by its i-th argument; of a norm and its directions where the norm is not 0.

Where it is 0, a direction stands for any element of the generalised gradient, and has no derivative.
"""


def slopes(roots: Sequence[Term], name: str) -> list[Term]:
    """d(root)/d(name) for every root; raises `ValueError` where there is no derivative."""
    slope: dict[Term, Term] = {}
    for term in in_order(roots):
        total = UNIT if term.op == "symbol" and term.value == name else NOUGHT
        for i, arg in enumerate(term.args):
            if slope[arg] is not NOUGHT:
                if term.op not in _PARTIAL:
                    raise ValueError(f"{term.op} has no derivative")
                total = total + _PARTIAL[term.op](term, i) * slope[arg]
        slope[term] = total
    return [slope[root] for root in roots]


def matrix_slopes(a: Rows, name: str) -> Matrix:
    """Da/d(name), entry by entry."""
    flat = iter(slopes([e for row in a for e in row], name))
    return [[next(flat) for _ in row] for row in a]


def matrix_replaced(a: Rows, values: Mapping[str, Term]) -> Matrix:
    """A matrix with variables replaced."""
    flat = iter(replaced([e for row in a for e in row], values))
    return [[next(flat) for _ in row] for row in a]


def times(a: Rows, b: Rows) -> Matrix:
    """The product a b."""
    columns = list(zip(*b, strict=True))
    return [
        [sum((x * y for x, y in zip(row, column, strict=True)), start=NOUGHT) for column in columns]
        for row in a
    ]


def plus(a: Rows, b: Rows, scale: Fraction | int = 1) -> Matrix:
    """A + scale b."""
    q = number(scale)
    return [[x + q * y for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)]


def turned(a: Rows) -> Matrix:
    """A'."""
    return [list(column) for column in zip(*a, strict=True)]


def scaled(q: Fraction | int, a: Rows) -> Matrix:
    """A matrix q times another."""
    return [[number(q) * x for x in row] for row in a]


def unit_matrix(n: int) -> Matrix:
    """The identity."""
    return [[UNIT if i == j else NOUGHT for j in range(n)] for i in range(n)]


def all_zero(a: Rows) -> bool:
    """Whether every entry is the constant 0."""
    return all(e is NOUGHT for row in a for e in row)


def blocks(matrix: Rows) -> list[Matrix]:
    """The parts that are not 0, each with its rows and columns."""
    parts: list[tuple[set[int], set[int]]] = []
    for i, row in enumerate(matrix):
        columns = {j for j, e in enumerate(row) if e is not NOUGHT}
        if not columns:
            continue
        met = [part for part in parts if part[1] & columns]
        parts = [part for part in parts if part not in met]
        parts.append(({i}.union(*(rows for rows, _ in met)), columns.union(*(own for _, own in met))))
    return [_part(matrix, sorted(rows), sorted(columns)) for rows, columns in parts]


def _part(matrix: Rows, rows: Sequence[int], columns: Sequence[int]) -> Matrix:
    return [[matrix[i][j] for j in columns] for i in rows]
