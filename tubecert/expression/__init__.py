"""Exact expressions: text in, hash-consed graph over Fractions out; derivatives by our own rules.

In: text of the specification. Out: `Expression`s and the obligations of their partial operations. Trusted: yes.
"""

from tubecert.expression.graph import (
    ONE,
    PI,
    ZERO,
    Expression,
    as_expression,
    constant,
    cos,
    derivative,
    derivatives,
    exp,
    free_symbols,
    norm,
    power,
    rebuild,
    sin,
    sqrt,
    substitute,
    symbol,
    tan,
    to_text,
    topological,
)

__all__ = [
    "ONE",
    "PI",
    "ZERO",
    "Expression",
    "as_expression",
    "constant",
    "cos",
    "derivative",
    "derivatives",
    "exp",
    "free_symbols",
    "norm",
    "power",
    "rebuild",
    "sin",
    "sqrt",
    "substitute",
    "symbol",
    "tan",
    "to_text",
    "topological",
]
