"""Exact expressions: text in, hash-consed graph over Fractions out; derivatives by our own rules.

In: text of the specification. Out: `Expression`s and the obligations of their partial operations. Trusted: yes.

| module | what it does |
|---|---|
| `graph` | the hash-consed graph, exact folding |
| `calculus` | other variables put in, derivatives |
| `lookup` | functions given by tables; slopes of tables that have none |
| `matrix` | exact operations on matrices: determinant, null space, definiteness, rank |
| `text` | graph -> text in the grammar of the specification, with the obligations that folding dropped |
| `scan`, `parse` | text -> graph and obligations, or a located `ExpressionError` |
| `meant` | which known word a typing error, a word of other formats and languages, or a unit stands for |
| `balls` | values as balls; where expressions vanish, as a proposal |
| `number` | text -> rational number, pi and degrees rounded |
| `zero` | proves that an expression vanishes identically |
| `waves` | a common period in t, where one can be seen |
"""

from tubecert.expression.calculus import derivative, derivatives, free_symbols, rebuild, substitute
from tubecert.expression.graph import (
    ONE,
    PI,
    ZERO,
    Expression,
    as_expression,
    coefficient,
    constant,
    cos,
    exp,
    norm,
    power,
    sin,
    sqrt,
    symbol,
    tan,
    topological,
)
from tubecert.expression.lookup import UNKNOWN, Lookup
from tubecert.expression.meant import elsewhere, near, rates_of, suggestion
from tubecert.expression.number import Side, parse_constant, parse_number, root_above
from tubecert.expression.parse import Obligation, Parsed, parse
from tubecert.expression.scan import (
    FUNCTIONS,
    MAX_LENGTH,
    MAX_NAME_LENGTH,
    MAX_NUMBER_EXPONENT,
    RESERVED,
    ExpressionError,
    is_name,
)
from tubecert.expression.text import full_text, longest_text, number_text, to_text
from tubecert.expression.zero import is_zero

__all__ = [
    "FUNCTIONS", "MAX_LENGTH", "MAX_NAME_LENGTH", "MAX_NUMBER_EXPONENT", "ONE", "PI", "RESERVED", "UNKNOWN",
    "ZERO", "Expression", "ExpressionError", "Lookup", "Obligation", "Parsed", "Side", "as_expression",
    "coefficient", "constant", "cos", "derivative", "derivatives", "elsewhere", "exp", "free_symbols",
    "full_text", "is_name", "is_zero", "longest_text", "near", "norm", "number_text", "parse",
    "parse_constant", "parse_number", "power", "rates_of", "rebuild", "root_above", "sin", "sqrt",
    "substitute", "suggestion", "symbol", "tan", "to_text", "topological",
]  # fmt: skip
