"""Graph -> text in the grammar of the specification.

The text parses back to the same expression, and depends on the expression alone (not on what else the process
has built before), so that it may be hashed.
"""

from __future__ import annotations

from fractions import Fraction

from tubecert.expression.graph import Expression, topological

_SUM, _PRODUCT, _POWER, _ATOM = range(4)  # how strongly the outermost operation of a text binds
_LARGEST_EXPONENT = 12  # of one `**` in the grammar
_PLAIN_DIGITS = 25


def number_text(q: Fraction) -> str:
    """A rational exactly: as an integer or decimal where that is short, else as `p/q`."""
    scale, digits = q.denominator, 0
    while scale % 10 == 0:
        scale, digits = scale // 10, digits + 1
    while scale % 2 == 0:
        scale, digits = scale // 2, digits + 1
    while scale % 5 == 0:
        scale, digits = scale // 5, digits + 1
    if scale != 1 or digits > 300:
        return f"{q.numerator}/{q.denominator}"
    mantissa = str(abs(q.numerator) * 10**digits // q.denominator)
    sign = "-" if q < 0 else ""
    if digits == 0:
        short = mantissa.rstrip("0")
        zeros = len(mantissa) - len(short)
        plain = mantissa if len(mantissa) <= _PLAIN_DIGITS or zeros < 4 else f"{short}e{zeros}"
    elif digits <= _PLAIN_DIGITS:
        whole = mantissa.zfill(digits + 1)
        plain = f"{whole[:-digits]}.{whole[-digits:]}"
    else:
        plain = f"{mantissa}e-{digits}"
    return sign + plain


def to_text(e: Expression) -> str:
    """Text in the specification's grammar that parses back to the same expression."""
    text: dict[Expression, tuple[str, int]] = {}
    for node in topological([e]):
        text[node] = _node_text(node, text)
    return text[e][0]


def _node_text(e: Expression, text: dict[Expression, tuple[str, int]]) -> tuple[str, int]:
    match e.op:
        case "const":
            return _constant_text(e.fraction)
        case "pi":
            return "pi", _ATOM
        case "symbol":
            return str(e.value), _ATOM
        case "add":
            return _sum_text(e, text), _SUM
        case "mul":
            return _product_text(e, text)
        case "div":
            return f"{_wrap(e.args[0], _PRODUCT, text)}/{_wrap(e.args[1], _POWER, text)}", _PRODUCT
        case "pow":
            return _power_text(_wrap(e.args[0], _ATOM, text), int(str(e.value)))
        case "norm" if len(e.args) == 1:
            return f"abs({text[e.args[0]][0]})", _ATOM
        case _:
            return f"{e.op}({', '.join(text[arg][0] for arg in e.args)})", _ATOM


def _wrap(e: Expression, least: int, text: dict[Expression, tuple[str, int]]) -> str:
    words, strength = text[e]
    return words if strength >= least else f"({words})"


def _constant_text(q: Fraction) -> tuple[str, int]:
    words = number_text(q)
    return words, _SUM if q < 0 else _PRODUCT if "/" in words else _ATOM


def _sum_text(e: Expression, text: dict[Expression, tuple[str, int]]) -> str:
    # The operands are ordered by what they are: their order in the graph depends on the history of the
    # process.
    def rank(arg: Expression) -> tuple[bool, bool, bool, str]:
        return arg.op != "add", text[arg][0].startswith("-"), arg.is_constant, text[arg][0]

    first, second = sorted(e.args, key=rank)
    head = text[first][0]
    words, strength = text[second]
    if strength == _SUM and words.startswith("-") and second.op in ("mul", "const"):
        return f"{head} - {words[1:]}"
    return f"{head} + {_wrap(second, _PRODUCT, text)}"


def _product_text(e: Expression, text: dict[Expression, tuple[str, int]]) -> tuple[str, int]:
    first, second = e.args
    if not first.is_constant:
        first, second = sorted(e.args, key=lambda arg: (arg.op != "mul", text[arg][0]))
        return f"{_wrap(first, _PRODUCT, text)}*{_wrap(second, _POWER, text)}", _PRODUCT
    q = first.fraction
    words = _wrap(second, _PRODUCT, text)
    if abs(q) != 1:
        size = number_text(abs(q))
        # The numerator 1 of 1/y gives way to the factor.
        reciprocal = second.op == "div" and second.args[0].is_constant
        words = f"{size}{words[1:]}" if reciprocal else f"{size}*{words}"
    return (f"-{words}", _SUM) if q < 0 else (words, _PRODUCT)


def _power_text(base: str, exponent: int) -> tuple[str, int]:
    sign = -1 if exponent < 0 else 1
    full, rest = divmod(abs(exponent), _LARGEST_EXPONENT)
    parts = [sign * _LARGEST_EXPONENT] * full + [sign * rest] * (rest > 0)
    words = "*".join(base if n == 1 else f"{base}**{n}" if n > 0 else f"{base}**({n})" for n in parts)
    return words, _POWER if len(parts) == 1 else _PRODUCT
