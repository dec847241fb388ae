"""Graph -> text in the grammar of the specification.

The text parses back to the same expression, and depends on the expression alone (not on what else the process
has built before), so that it may be hashed.

An expression never loses what it owes, though folding drops it: 0*sqrt(x - 5) is 0 in the graph, and yet x must stay
above 5. The text of an expression with its obligations ends in terms that vanish and owe what the rest does not:
`0 + 0*sqrt(x - 5)`, `y + 0/x`. Such a text is in the grammar, so whoever parses it (the checker does) meets the same
obligations, and expressions that owe differently differ in text.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction

from tubecert.expression import graph
from tubecert.expression.graph import Expression, coefficient, topological
from tubecert.expression.parse import Duty, Obligation, within
from tubecert.expression.scan import MAX_NUMBER_EXPONENT, MAX_NUMBER_LENGTH

_SUM, _PRODUCT, _POWER, _ATOM = range(4)  # how strongly the outermost operation of a text binds
_LARGEST_EXPONENT = 12  # of one `**` in the grammar
_PLAIN_DIGITS = 25
_CHUNK = 30  # digits of the parts of a long integer
_CLOSED = frozenset({"symbol", "sin", "cos", "tan", "norm"})  # texts that need no parentheses
_NEVER_ZERO = frozenset({"const", "pi", "exp", "cosh", "sqrt"})
_Owed = tuple[Duty, Expression]


def number_text(q: Fraction) -> str:
    """A rational exactly: as a decimal where that is short, else `p/q`; within the limits of the grammar."""
    sign, size = "-" if q < 0 else "", abs(q)
    short = _decimal(size)
    if short is not None and len(short) <= MAX_NUMBER_LENGTH:
        return sign + short
    quotient = "" if size.denominator == 1 else f"/{_integer(size.denominator)}"
    return sign + _integer(size.numerator) + quotient


def _decimal(q: Fraction) -> str | None:
    """A positive rational as a decimal, None if it has no finite one or one of too many places."""
    twos, rest = _multiplicity(q.denominator, 2)
    fives, rest = _multiplicity(rest, 5)
    places = max(twos, fives)
    if rest != 1 or places > MAX_NUMBER_EXPONENT:
        return None
    digits = str(q.numerator * 10**places // q.denominator)
    if places == 0:
        short = digits.rstrip("0")
        zeros = len(digits) - len(short)
        return (
            f"{short}e{zeros}"
            if len(digits) > _PLAIN_DIGITS and 4 <= zeros <= MAX_NUMBER_EXPONENT
            else digits
        )
    if places > _PLAIN_DIGITS:
        return f"{digits}e-{places}"
    digits = digits.zfill(places + 1)
    return f"{digits[:-places]}.{digits[-places:]}"


def _multiplicity(n: int, prime: int) -> tuple[int, int]:
    """How often `prime` divides n, and what is left."""
    found = 0
    while n % prime == 0:
        n, found = n // prime, found + 1
    return found, n


def _integer(n: int) -> str:
    """A positive integer; a long one as a sum of short numbers in parentheses."""
    digits = str(n)
    if len(digits) <= MAX_NUMBER_LENGTH:
        return digits
    high, low = divmod(n, 10**MAX_NUMBER_EXPONENT)
    parts = [f"{_integer(high)}*1e{MAX_NUMBER_EXPONENT}"] if high else []
    words = str(low)
    for end in range(len(words), 0, -_CHUNK):
        chunk, place = words[max(0, end - _CHUNK) : end].lstrip("0"), len(words) - end
        if chunk:
            parts.append(f"{chunk}e{place}" if place else chunk)
    return f"({' + '.join(parts)})"


def longest_text(e: Expression) -> int:
    """A bound of the length of the text, found without writing it: shared parts are written wherever they occur."""
    length: dict[Expression, int] = {}
    for node in topological([e]):
        own = sum(length[arg] + 4 for arg in node.args) + 8
        if node.is_constant:
            own = node.fraction.numerator.bit_length() + node.fraction.denominator.bit_length() + 8
        elif node.op == "symbol":
            own = len(str(node.value))
        elif node.op == "table":
            own += len(str(node.value))
        elif node.op == "pow":
            own *= 1 + abs(int(str(node.value))) // _LARGEST_EXPONENT
        length[node] = own
    return length[e]


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
        case "table":  # a derivative gets a dash, which is not in the grammar
            return f"{e.value}({text[e.args[0]][0]})", _ATOM
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


def full_text(e: Expression, obligations: Iterable[Obligation]) -> str:
    """Text that parses back to `e` and to obligations that hold exactly where these do."""
    shown = {item for node in topological([e]) for item in _of_node(node)}
    missing: dict[_Owed, None] = {}
    for owed in obligations:
        for item in _simplest(owed.kind, owed.argument):
            if item not in shown:
                missing[item] = None
    return " + ".join([to_text(e), *sorted(_term(*item) for item in missing)])


def _term(kind: Duty, argument: Expression) -> str:
    """A term that is 0 and owes this."""
    words = to_text(argument)
    if kind == "positive":
        return f"0*sqrt({words})"
    return f"0/{words}" if argument.op in _CLOSED else f"0/({words})"


def _of_node(node: Expression) -> Iterator[_Owed]:
    """What a reader of the node's text will note."""
    match node.op:
        case "div":
            yield from _simplest("nonzero", node.args[1])
        case "pow" if int(str(node.value)) < 0:
            yield from _simplest("nonzero", node.args[0])
        case "tan":
            yield from _simplest("nonzero", graph.cos(node.args[0]))
        case "sqrt" | "log":
            yield from _simplest("positive", node.args[0])
        case "table":
            for argument in within(node.lookup, node.args[0]):
                yield from _simplest("positive", argument)
        case "asin" | "acos":
            yield from _simplest("positive", 1 - node.args[0] ** 2)


def _simplest(kind: Duty, e: Expression) -> Iterator[_Owed]:
    """Obligations on smaller expressions that are equivalent, given what the parts of `e` themselves owe.

    x/(2*y) and 0.5*x/y owe the same: rational factors and powers do not matter, a product is nonzero if its factors
    are, a quotient if its numerator is (its divisor is owed by the quotient), pi, exp(u), cosh(u) and sqrt(u) always.
    """
    q, rest = coefficient(e)
    if kind == "positive":
        if q > 0 and rest.op == "pow" and int(str(rest.value)) % 2 == 1:
            yield from _simplest(kind, rest.args[0])
        else:
            yield kind, rest if q > 0 else -rest
    elif rest.op == "mul":
        for factor in rest.args:
            yield from _simplest(kind, factor)
    elif rest.op in ("pow", "div"):
        yield from _simplest(kind, rest.args[0])
    elif rest.op not in _NEVER_ZERO:
        yield kind, rest
