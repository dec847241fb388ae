"""Programs, numbers and tables of a module in Python, read from its syntax tree; every other node is refused.

Operation by operation a program becomes the tree that one in C becomes. Names are taken from closed patterns, so that
none hides a vector, a table or `math`.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping, Sequence

from tubecert.recheck.code.reader import Table
from tubecert.recheck.code.seen import FUNCTIONS
from tubecert.recheck.code.tree import (
    Assign,
    Binary,
    Call,
    Choice,
    Declare,
    Entry,
    Expr,
    Function,
    Name,
    Number,
    Statement,
    Unary,
)
from tubecert.recheck.code.words import UnreadError

_OPERATORS: Mapping[type[ast.AST], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_LOCAL = re.compile(r"r\d+")
_GIVEN = re.compile(r"[a-z]+(_[a-z]+)?")


def program(own: ast.FunctionDef, count: int) -> Function:
    """A function without branches that gives so many vectors."""
    given = _arguments(own)
    done, sizes = list[Statement](), dict[str, int]()
    known = set[str]()
    *body, last = bare(own.body)
    for each in body:
        match each:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if name not in known | sizes.keys():
                if _LOCAL.fullmatch(name):
                    done.append(Declare("real", name, (), _expression(value, known, given)))
                    known.add(name)
                elif name.startswith("out_") and isinstance(value, ast.Tuple) and value.elts:
                    entries = [_expression(entry, known, given) for entry in value.elts]
                    done += [Assign(Entry(Name(name), Number(str(i))), e) for i, e in enumerate(entries)]
                    sizes[name] = len(entries)
                else:
                    raise refused(each, f"{name} is no result that is known")
            case _:
                raise refused(each, "a program has no such statement")
    match last:
        case ast.Return(value=ast.Name(id=only)) if count == 1:
            outs = [only]
        case ast.Return(value=ast.Tuple(elts=elements)) if len(elements) == count > 1:
            outs = [each.id if isinstance(each, ast.Name) else "" for each in elements]
        case _:
            raise refused(last, f"{own.name} gives something else")
    if len(set(outs)) != len(outs) or set(outs) != sizes.keys():
        raise refused(last, f"{own.name} gives something else")
    return Function(name=own.name, given=(*given, *outs), body=tuple(done))


def _arguments(own: ast.FunctionDef) -> tuple[str, ...]:
    """Names of what a program is given: vectors."""
    a = own.args
    given = tuple(each.arg for each in a.args)
    more: list[object] = [a.posonlyargs, a.vararg, a.kwonlyargs, a.kw_defaults, a.kwarg, a.defaults]
    more += [own.decorator_list, own.returns, getattr(own, "type_params", ())]
    if any(more) or any(each.annotation for each in a.args):
        raise refused(own, "a program is given vectors by their names")
    for name in given:
        hides = name == "math" or _LOCAL.fullmatch(name) or name.startswith(("out_", "table_"))
        if hides or not _GIVEN.fullmatch(name) or given.count(name) > 1:
            raise refused(own, f"{name} is no name of a vector")
    return given


def _expression(tree: ast.expr, known: set[str], given: Sequence[str]) -> Expr:
    """What may stand in a program."""

    def of(own: ast.expr) -> Expr:
        return _expression(own, known, given)

    match tree:
        case ast.Constant():
            return constant(tree)
        case ast.Name(id=name) if name in known:
            return Name(name)
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant() as place) if name in given:
            return Entry(Name(name), Number(whole(place)))
        case ast.UnaryOp(op=ast.USub(), operand=arg):
            return Unary("-", of(arg))
        case ast.BinOp(op=op, left=left, right=right) if type(op) in _OPERATORS:
            return Binary(_OPERATORS[type(op)], of(left), of(right))
        case ast.Call(func=ast.Attribute(value=ast.Name(id="math"), attr=name), args=[arg], keywords=[]):
            if name in FUNCTIONS:
                return Call(name, (of(arg),))
        case ast.Call(func=ast.Name(id=name), args=[arg], keywords=[]) if name.startswith("table_"):
            return Call(name, (of(arg),))
        case ast.IfExp(test=test, body=yes, orelse=no):
            return Choice(_test(test, known, given), of(yes), of(no))
    raise refused(tree, "a program has no such expression")


def _test(tree: ast.expr, known: set[str], given: Sequence[str]) -> Expr:
    match tree:
        case ast.BoolOp(op=ast.And(), values=[first, second]):
            return Binary("&&", _test(first, known, given), _test(second, known, given))
        case ast.Compare(left=left, ops=[ast.Lt() | ast.Gt() as op], comparators=[right]):
            sign = "<" if isinstance(op, ast.Lt) else ">"
            return Binary(sign, _expression(left, known, given), _expression(right, known, given))
    raise refused(tree, "a program has no such test")


# -- numbers


def constant(tree: ast.expr) -> Expr:
    """A number of the type; what is negative is written with its sign in front."""
    match tree:
        case ast.Constant(value=value) if type(value) is float and math.isfinite(value):
            return Number(repr(value))
        case ast.UnaryOp(op=ast.USub(), operand=arg):
            return Unary("-", constant(arg))
    raise refused(tree, "a finite number of the type has to stand here")


def whole(tree: ast.expr) -> str:
    """The digits of a whole number."""
    match tree:
        case ast.Constant(value=value) if type(value) is int:
            return str(value)
    raise refused(tree, "a whole number has to stand here")


def string(tree: ast.expr) -> str:
    """What a string holds."""
    match tree:
        case ast.Constant(value=str() as value):
            return value
    raise refused(tree, "a string has to stand here")


def names(tree: ast.expr) -> list[str]:
    """Strings in brackets."""
    match tree:
        case ast.Tuple(elts=elements):
            return [string(each) for each in elements]
    raise refused(tree, "names have to stand here")


def table_of(tree: ast.expr) -> Table:
    """Numbers, in brackets in brackets."""
    if isinstance(tree, ast.Tuple):
        return tuple(table_of(each) for each in tree.elts)
    match constant(tree):
        case Number(text):
            return text
        case Unary("-", Number(text)):
            return f"-{text}"
    raise refused(tree, "a number has to stand here")


# -- what surrounds them


def bare(body: list[ast.stmt]) -> list[ast.stmt]:
    """Without the string that says what it is."""
    match body:
        case [ast.Expr(value=ast.Constant(value=str())), *rest]:
            return rest
    return body


def refused(near: ast.AST, what: str) -> UnreadError:
    """Why a module is not read, and in which line."""
    return UnreadError(f"line {getattr(near, 'lineno', 0)}: {what}")
