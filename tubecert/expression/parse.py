"""Text -> exact expression, and an obligation for every operation that is not defined everywhere.

Python's `ast` supplies the structure; nothing is evaluated. Numbers are read from their source text.
Obligations are recorded before the graph simplifies: 0*tan(x) is 0 in the graph, and yet x must stay off the
poles.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, Literal

from tubecert.expression import graph
from tubecert.expression.graph import Expression
from tubecert.expression.lookup import Lookup
from tubecert.expression.scan import (
    ARITIES,
    ExpressionError,
    Kind,
    Vocabulary,
    is_name,
    normalise_spaces,
    scan,
)

MAX_EXPONENT: Final = 12
MAX_NESTED_EXPONENT: Final = 144
MAX_BITS: Final = 5_000

Duty = Literal["nonzero", "positive"]

_POSITIVE: Final[Mapping[str, Callable[[Expression], Expression]]] = {
    "sqrt": lambda u: u,
    "log": lambda u: u,
    "asin": lambda u: 1 - u**2,
    "acos": lambda u: 1 - u**2,
}
"""What must be positive for the function to be defined and C1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Obligation:
    """What must hold for an operation to be defined (and C1): `argument` is `nonzero`, or `positive`.

    A divisor and the base of a negative power must be nonzero, so must cos(u) for tan(u); the argument of
    sqrt and log must be positive (sqrt is not C1 at 0), so must 1 - u**2 for asin(u) and acos(u), and the distances to
    both ends of a table.
    `offset` and `width` locate the operation in its text, of which `text` is that part.
    """

    kind: Duty
    argument: Expression
    offset: int
    width: int
    text: str
    table: str = ""  # of a table: from where to where it goes


@dataclass(frozen=True, slots=True, kw_only=True)
class Parsed:
    """An expression with everything that must be proven before it may be used."""

    expression: Expression
    obligations: tuple[Obligation, ...]


def parse(
    text: str,
    *,
    symbols: Mapping[str, Expression],
    tables: Mapping[str, Lookup] | None = None,
    kinks: bool = False,
    refused: Mapping[str, str] | None = None,
    owed: Mapping[str, tuple[Obligation, ...]] | None = None,
) -> Parsed:
    """The expression that `text` stands for; raises `ExpressionError`.

    `symbols` are the names it may use (with what they stand for), `tables` functions beside those of the grammar,
    `kinks` allows abs and norm, and `refused`
    gives the reason why a name that exists elsewhere is not allowed here; `owed` is what the use of a name owes, which
    stands for more than a variable. A variable with the name of a constant, a
    function or a keyword (`pi`, `True`) would be read as that: no text is parsed with one.
    """
    tables = tables or {}
    for name in (*symbols, *tables):
        if not is_name(name):
            raise ExpressionError(f"{name[:60]!r} cannot be the name of a variable", kind="symbol")
    line = normalise_spaces(text)
    words = Vocabulary(symbols=symbols.keys(), tables=tables.keys(), kinks=kinks, refused=refused or {})
    scan(line, words)
    return _Lowering(line, symbols, tables, owed or {}).run(_tree(line))


def _tree(line: str) -> ast.expr:
    """Python's parse of the scanned text. The parentheses allow leading blanks and shift offsets by one."""
    try:
        return ast.parse(f"({line})", mode="eval").body
    except (RecursionError, MemoryError):
        raise ExpressionError("the expression is nested too deeply", help="split it", kind="limit") from None
    except (SyntaxError, ValueError) as error:
        offset = min(max((getattr(error, "offset", None) or 2) - 2, 0), len(line))
        raise ExpressionError("this is not an expression", offset=offset) from None


class _Lowering:
    """Builds the graph bottom-up, without recursion, and collects obligations on the way."""

    def __init__(
        self,
        line: str,
        symbols: Mapping[str, Expression],
        tables: Mapping[str, Lookup],
        owed: Mapping[str, tuple[Obligation, ...]],
    ) -> None:
        self.line, self.symbols, self.tables, self.owed = line, symbols, tables, dict(owed)
        self.obligations: list[Obligation] = []
        self.values: dict[ast.expr, Expression] = {}
        self.growth: dict[ast.expr, int] = {}  # the product of the exponents above a leaf

    def run(self, root: ast.expr) -> Parsed:
        """Every node after its operands, the leftmost first."""
        stack, order = [root], []
        while stack:
            node = stack.pop()
            order.append(node)
            stack.extend(self._operands(node))
        for node in reversed(order):
            operands = self._operands(node)
            self.growth[node] = max((self.growth[operand] for operand in operands), default=1)
            try:
                self.values[node] = self._lower(node)
            except ZeroDivisionError:
                raise self._error(node, *self._nothing_below(node), kind="value") from None
            self._bound(node)
        self.obligations.sort(key=lambda item: (item.offset, item.width))
        return Parsed(expression=self.values[root], obligations=tuple(self.obligations))

    def _nothing_below(self, node: ast.expr) -> tuple[str, str]:
        """That there is a division by zero, and what is zero; names are constants, or they would not be."""
        below = node.right if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div) else None
        if below is None or not any(isinstance(each, ast.Name) for each in ast.walk(below)):
            return "division by zero", ""
        return f"division by zero: {self._source(below)[:60]} is 0", "give its parameters other values"

    def _operands(self, node: ast.expr) -> list[ast.expr]:
        match node:
            case ast.BinOp(left, ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow(), right):
                return [left, right]
            case ast.UnaryOp(ast.UAdd() | ast.USub(), operand):
                return [operand]
            case ast.Call(ast.Name(name), args, []) if name in ARITIES or name in self.tables:
                return list(args)
            case ast.Name():
                return []
            case ast.Constant(value) if type(value) in (int, float):  # True is an int, too
                return []
        raise self._error(node, "this is not part of the grammar of expressions")

    def _lower(self, node: ast.expr) -> Expression:
        match node:
            case ast.BinOp(left, ast.Pow(), _):
                return self._power(node, left)
            case ast.BinOp(left, ast.Div(), right):
                self._owe("nonzero", self.values[right], node)
                return self.values[left] / self.values[right]
            case ast.BinOp(left, operator, right):
                a, b = self.values[left], self.values[right]
                return (
                    a + b
                    if isinstance(operator, ast.Add)
                    else a - b
                    if isinstance(operator, ast.Sub)
                    else a * b
                )
            case ast.UnaryOp(operator, operand):
                value = self.values[operand]
                return -value if isinstance(operator, ast.USub) else value
            case ast.Call(ast.Name(name), args):
                return self._call(node, name, [self.values[arg] for arg in args])
            case ast.Name("pi"):
                return graph.PI
            case ast.Name(name):
                offset, width = self._place(node)
                for item in self.owed.pop(name, ()):  # once is enough
                    self.obligations.append(replace(item, offset=offset, width=width))
                return self.symbols[name]
        return graph.constant(Fraction(self._source(node)))

    def _call(self, node: ast.expr, name: str, args: list[Expression]) -> Expression:
        arity = ARITIES.get(name, 1)
        if not args or (arity is not None and len(args) != arity):
            wanted = "one argument" if arity else "at least one argument"
            raise self._error(node, f"{name} takes {wanted}, not {len(args)}")
        if name in ("abs", "norm"):
            return graph.norm(args)
        if name in self.tables:
            return self._table(node, self.tables[name], args[0])
        if name == "tan":
            self._owe("nonzero", graph.cos(args[0]), node)
        if name in _POSITIVE:
            argument, at_zero = (
                _POSITIVE[name](args[0]),
                "is not real" if name == "log" else "is not differentiable",
            )
            if argument.is_constant and argument.fraction <= 0:
                reason = "is not real" if argument.fraction < 0 else at_zero
                raise self._error(node, f"{self._source(node)[:60]} {reason}", kind="value")
            self._owe("positive", argument, node)
        return graph.FUNCTIONS[name](args[0])

    def _table(self, node: ast.expr, lookup: Lookup, argument: Expression) -> Expression:
        if argument.is_constant and lookup.at(argument.fraction) is None:
            message = f"{self._source(node)[:60]} lies outside of the table, which goes {_ends(lookup)}"
            raise self._error(node, message, kind="value")
        for distance in within(lookup, argument):
            self._owe("positive", distance, node, _ends(lookup))
        return graph.table(lookup, argument)

    def _power(self, node: ast.BinOp, left: ast.expr) -> Expression:
        base, n = self.values[left], self._exponent(node)
        self.growth[node] = self.growth[left] * max(1, abs(n))
        if self.growth[node] > MAX_NESTED_EXPONENT:
            raise self._error(node, f"nested powers exceed {MAX_NESTED_EXPONENT} in total", kind="limit")
        if _bits(base) * abs(n) > MAX_BITS:
            raise self._too_big(node)
        if n < 0:
            self._owe("nonzero", base, node)
        return graph.power(base, n)

    def _exponent(self, node: ast.BinOp) -> int:
        value, words = self.values[node.right], self._source(node.right)[:40]
        if not value.is_constant or value.fraction.denominator != 1:
            help = "exponents are integers; sqrt and exp are functions: a**x is exp(x*log(a))"
            if value.is_constant:
                base, known = self._source(node.left), isinstance(node.left, ast.Name | ast.Call)
                help = _root(base, value.fraction) if known and len(base) <= 20 else ""
                help = help or f"{_root('x', value.fraction)} in place of x**({value.fraction})"
            raise self._error(node.right, f"the exponent {words} is not an integer", help=help)
        if abs(value.fraction) > MAX_EXPONENT:
            raise self._error(
                node.right,
                f"the exponent {words} is beyond {MAX_EXPONENT}",
                help="write a product such as x**12*x",
                kind="limit",
            )
        return value.fraction.numerator

    def _owe(self, kind: Duty, argument: Expression, node: ast.expr, table: str = "") -> None:
        if argument.is_constant and argument.fraction != 0:
            return  # holds: a nonzero divisor, or an argument of sqrt that was seen to be positive
        offset, width = self._place(node)
        text = self.line[offset : offset + width]
        self.obligations.append(
            Obligation(kind=kind, argument=argument, offset=offset, width=width, text=text, table=table)
        )

    def _bound(self, node: ast.expr) -> None:
        """Neither the constants nor the powers that folding creates may grow without end."""
        value = self.values[node]
        if _bits(value) > MAX_BITS:
            raise self._too_big(node)
        _, rest = graph.coefficient(value)
        if rest.op == "pow" and abs(int(str(rest.value))) > MAX_NESTED_EXPONENT:
            raise self._error(node, f"powers exceed {MAX_NESTED_EXPONENT} in total", kind="limit")

    def _too_big(self, node: ast.expr) -> ExpressionError:
        return self._error(
            node,
            "a constant in this part is too long",
            help=f"at most {MAX_BITS} bits are kept",
            kind="limit",
        )

    def _place(self, node: ast.expr) -> tuple[int, int]:
        offset = max(node.col_offset - 1, 0)
        return offset, max(1, (node.end_col_offset or node.col_offset + 1) - 1 - offset)

    def _source(self, node: ast.expr) -> str:
        offset, width = self._place(node)
        return self.line[offset : offset + width]

    def _error(self, node: ast.expr, message: str, help: str = "", kind: Kind = "syntax") -> ExpressionError:
        offset, width = self._place(node)
        return ExpressionError(message, help=help, offset=offset, width=width, kind=kind)


def within(lookup: Lookup, argument: Expression) -> tuple[Expression, Expression]:
    """What must be positive for a table to be read: the distances of the argument to its ends."""
    return argument - lookup.start, graph.constant(lookup.end) - argument


def _ends(lookup: Lookup) -> str:
    return f"from {float(lookup.knots[0]):g} to {float(lookup.knots[-1]):g}"


def _root(base: str, exponent: Fraction) -> str:
    """What to write for a power that is not whole: halves and quarters by square roots, others by exp and log."""
    whole, rest = divmod(abs(exponent), 1)
    if 4 % rest.denominator:
        return f"write exp({exponent}*log({base})), for {base} > 0"
    root = f"sqrt({base})"
    powers = [base if whole == 1 else f"{base}**{whole}"] if whole else []
    powers += [root] * (rest >= Fraction(1, 2)) + [f"sqrt({root})"] * (rest.denominator == 4)
    product = "*".join(powers)
    if exponent < 0:
        product = f"1/({product})" if len(powers) > 1 else f"1/{product}"
    return f"write {product}"


def _bits(e: Expression) -> int:
    """Size of the rational factor of `e`."""
    q, _ = graph.coefficient(e)
    return max(q.numerator.bit_length(), q.denominator.bit_length()) if abs(q) != 1 else 0
