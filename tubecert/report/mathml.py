"""Expressions as MathML: the equations of a specification as one would write them on paper.

In: texts in the grammar of specifications, as certificates hold them. Out: MathML, which browsers show without help.
The order of terms and factors is that of the text. Nothing is computed; what is no expression stays the text it is.
"""

from __future__ import annotations

import ast
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from tubecert.expression import UNKNOWN, ExpressionError, is_name, parse, symbol

_SUM, _PRODUCT, _SIGN, _ATOM = range(4)  # how strongly the outermost operation binds
_LINE = 64  # characters of text on a line of an equation
_DIGITS = 12  # longer numbers are cut; the text beside the equation has every digit
_LETTERS: Final = (
    "αalpha βbeta γgamma δdelta εepsilon ζzeta ηeta θtheta ιiota κkappa λlambda μmu νnu ξxi πpi ρrho σsigma τtau "
    "υupsilon φphi χchi ψpsi ωomega ΓGamma ΔDelta ΘTheta ΛLambda ΞXi ΠPi ΣSigma ΦPhi ΨPsi ΩOmega"
)
_GREEK: Final = {word[1:]: word[0] for word in _LETTERS.split()}
_APPLY, _TIMES, _MINUS, _DOT = "\u2061", "\u2062", "\u2212", "\u02d9"
Shown = tuple[ET.Element, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Equation:
    """`left` = the sum of the texts in `right`; `rate`: the left side is a time derivative."""

    left: str
    right: tuple[str, ...]
    rate: bool = False

    @property
    def text(self) -> str:
        """On one line."""
        return f"{self.left}{chr(39) if self.rate else ''} = {' + '.join(self.right)}"


def aligned(equations: Iterable[Equation]) -> str:
    """Equations below each other, long sums on several lines."""
    table = ET.Element("mtable", {"class": "equations"})
    for each in equations:
        terms = [term for text in each.right for term in _terms(text)]
        for number, line in enumerate(_lines(terms)):
            row = ET.SubElement(table, "mtr")
            head, body = ET.SubElement(row, "mtd"), ET.SubElement(row, "mtd")
            if not number:
                head.append(dotted(each.left) if each.rate else identifier(each.left))
                head.append(_operator("="))
            body.append(_sum(line, begins=not number))
    return math(table)


def matrix(rows: Sequence[Sequence[str]]) -> ET.Element:
    """A matrix in brackets."""
    whole = ET.Element("mrow")
    ET.SubElement(whole, "mo", {"stretchy": "true"}).text = "["
    table = ET.SubElement(whole, "mtable")
    for row in rows:
        line = ET.SubElement(table, "mtr")
        for entry in row:
            ET.SubElement(line, "mtd").append(expression(entry))
    ET.SubElement(whole, "mo", {"stretchy": "true"}).text = "]"
    return whole


def named(left: str, right: ET.Element) -> str:
    """`left = right`."""
    return math(_row(identifier(left), _operator("="), right))


def math(*parts: ET.Element) -> str:
    """The markup of a formula of its own."""
    whole = ET.Element("math", {"display": "block"})
    whole.extend(parts)
    return ET.tostring(whole, encoding="unicode")


def expression(text: str) -> ET.Element:
    """An expression; its text where it is none."""
    return _sum(_terms(text), begins=True)


def identifier(name: str) -> ET.Element:
    """A name: Greek where it spells a Greek letter, its number or what follows a `_` as an index."""
    found = re.fullmatch(r"([A-Za-z]+)_?([A-Za-z0-9_]*)", name)
    stem, index = ("", "") if found is None else found.groups()
    if not stem:
        return _leaf("mtext", name)
    letter = _leaf("mi", _GREEK.get(stem, stem))
    return _pair("msub", letter, _leaf("mi", index)) if index else letter


def dotted(name: str) -> ET.Element:
    """The time derivative of a variable."""
    whole = identifier(name)
    if whole.tag != "msub":
        return _pair("mover", whole, _operator(_DOT))
    letter, index = whole
    return _pair("msub", _pair("mover", letter, _operator(_DOT)), index)


# -- terms of a sum, and what they consist of


def _terms(text: str) -> list[tuple[bool, ET.Element, int]]:
    """The terms of a text with their signs (True: minus) and the lengths of their texts."""
    plain = [(False, _leaf("mtext", text), len(text))]
    tree = _tree(text)
    if tree is None:
        return plain
    try:
        return [(minus, _factor(node, _PRODUCT), len(ast.unparse(node))) for minus, node in _signed(tree)]
    except RecursionError:  # a product of hundreds of factors: nobody could read it either way
        return plain


def _tree(text: str) -> ast.expr | None:
    """The structure of a text that is an expression: what bounds its size and depth is the grammar's own parser."""
    line = " ".join(text.split())
    tables = {name for name in re.findall(r"([A-Za-z][A-Za-z0-9_]*)\(", line) if is_name(name)}
    names = {name for name in re.findall(r"[A-Za-z][A-Za-z0-9_]*", line) if is_name(name)} - tables
    try:
        parse(
            line,
            symbols={name: symbol(name) for name in names},
            tables=dict.fromkeys(tables, UNKNOWN),
            kinks=True,
        )
        tree = ast.parse(line, mode="eval").body
    except (ExpressionError, SyntaxError, ValueError):
        return None
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant):  # as it is written, not as the nearest float
            node.value = line[node.col_offset : node.end_col_offset]
    return tree


def _signed(tree: ast.expr) -> list[tuple[bool, ast.expr]]:
    """A sum as its terms, in their order."""
    found: list[tuple[bool, ast.expr]] = []
    waiting = [(False, tree)]
    while waiting:
        minus, node = waiting.pop()
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
            waiting += [(minus ^ isinstance(node.op, ast.Sub), node.right), (minus, node.left)]
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            waiting.append((minus ^ isinstance(node.op, ast.USub), node.operand))
        else:
            found.append(_without_sign(minus, node))
    return found


def _without_sign(minus: bool, node: ast.expr) -> tuple[bool, ast.expr]:
    """`-2*x` as minus and `2*x`: the sign belongs to the first factor in Python's tree."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Mult, ast.Div)):
        negative, left = _without_sign(minus, node.left)
        return negative, ast.BinOp(left=left, op=node.op, right=node.right)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return not minus, node.operand
    return minus, node


def _lines(terms: list[tuple[bool, ET.Element, int]]) -> list[list[tuple[bool, ET.Element, int]]]:
    lines: list[list[tuple[bool, ET.Element, int]]] = [[]]
    for term in terms:
        if lines[-1] and sum(each[2] for each in lines[-1]) + term[2] > _LINE:
            lines.append([])
        lines[-1].append(term)
    return lines


def _sum(terms: list[tuple[bool, ET.Element, int]], *, begins: bool) -> ET.Element:
    """Terms with their signs; at the beginning a plus is left out."""
    row = ET.Element("mrow")
    for number, (minus, term, _) in enumerate(terms):
        if number or minus or not begins:
            sign = {"form": "prefix"} if begins and not number else {"form": "infix"}
            ET.SubElement(row, "mo", sign).text = _MINUS if minus else "+"
        row.append(term)
    return row


def _factor(node: ast.expr, least: int) -> ET.Element:
    """A part of a product, in parentheses where it binds less than `least`."""
    shown, strength = _shown(node)
    return shown if strength >= least else _bracketed(shown)


def _shown(node: ast.expr) -> Shown:
    match node:
        case ast.Constant(value=value):
            return _number(str(value))
        case ast.Name(id=name):
            return (_leaf("mi", "π") if name == "pi" else identifier(name)), _ATOM
        case ast.BinOp(op=ast.Add() | ast.Sub()) | ast.UnaryOp():
            terms = [(minus, _factor(part, _PRODUCT), 0) for minus, part in _signed(node)]
            return _sum(terms, begins=True), _SUM
        case ast.BinOp(left=top, op=ast.Div(), right=bottom):
            return _pair("mfrac", _shown(top)[0], _shown(bottom)[0]), _SIGN
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return _product(left, right), _PRODUCT
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            return _pair("msup", _factor(base, _ATOM), _shown(exponent)[0]), _ATOM
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _call(name, arguments), _ATOM
        case _:
            return _leaf("mtext", ast.unparse(node)), _ATOM


def _product(left: ast.expr, right: ast.expr) -> ET.Element:
    first, second = _factor(left, _PRODUCT), _factor(right, _SIGN)
    between = "·" if _is_number(right) else _TIMES
    return _row(first, _operator(between), second)


def _is_number(node: ast.expr) -> bool:
    """Whether it begins with a digit, which a factor before it would run into."""
    while isinstance(node, ast.BinOp):
        node = node.left
    return isinstance(node, ast.Constant)


def _call(name: str, arguments: list[ast.expr]) -> ET.Element:
    shown = [_shown(each)[0] for each in arguments]
    if name == "sqrt" and len(shown) == 1:
        root = ET.Element("msqrt")
        root.append(shown[0])
        return root
    if name == "abs" and len(shown) == 1:
        return _fenced("|", shown, "|")
    if name == "norm":
        return _fenced("‖", shown, "‖")
    return _row(_leaf("mi", name), _operator(_APPLY), _fenced("(", shown, ")"))


def _number(text: str) -> Shown:
    """A number as it is written, a long one with its first digits."""
    mantissa, mark, exponent = text.lower().partition("e")
    cut = len(mantissa) > _DIGITS and "." in mantissa[:_DIGITS]
    digits = _leaf("mn", f"{mantissa[:_DIGITS]}…" if cut else mantissa)
    if not mark:
        return digits, _ATOM
    power = _leaf("mn", exponent.lstrip("+").replace("-", _MINUS))
    return _row(digits, _operator("·"), _pair("msup", _leaf("mn", "10"), power)), _PRODUCT


def _leaf(tag: str, text: str) -> ET.Element:
    element = ET.Element(tag)
    element.text = text
    return element


def _operator(sign: str) -> ET.Element:
    return _leaf("mo", sign)


def _row(*parts: ET.Element) -> ET.Element:
    row = ET.Element("mrow")
    row.extend(parts)
    return row


def _pair(tag: str, first: ET.Element, second: ET.Element) -> ET.Element:
    element = ET.Element(tag)
    element.extend([first, second])
    return element


def _bracketed(shown: ET.Element) -> ET.Element:
    return _fenced("(", [shown], ")")


def _fenced(left: str, parts: Sequence[ET.Element], right: str) -> ET.Element:
    """Parts between fences, with commas."""
    row = _row(_operator(left))
    for number, part in enumerate(parts):
        if number:
            row.append(_operator(","))
        row.append(part)
    row.append(_operator(right))
    return row
