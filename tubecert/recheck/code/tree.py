"""Expressions and statements of the C that is read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Number:
    """A literal as it is written."""

    text: str


@dataclass(frozen=True, slots=True)
class Name:
    """A variable, a table or a macro."""

    name: str


@dataclass(frozen=True, slots=True)
class Entry:
    """base[index]."""

    base: Expr
    index: Expr


@dataclass(frozen=True, slots=True)
class Member:
    """base->name."""

    base: Expr
    name: str


@dataclass(frozen=True, slots=True)
class Call:
    """A function of arguments."""

    name: str
    args: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class Unary:
    """`-`, `!`, `&` (a vector of one entry) or `real` (a whole number as one of the type)."""

    sign: str
    arg: Expr


@dataclass(frozen=True, slots=True)
class Binary:
    """Of two."""

    sign: str
    left: Expr
    right: Expr


@dataclass(frozen=True, slots=True)
class Choice:
    """test ? yes : no."""

    test: Expr
    yes: Expr
    no: Expr


Expr = Number | Name | Entry | Member | Call | Unary | Binary | Choice


@dataclass(frozen=True, slots=True)
class Declare:
    """A variable of type `real` or `int`, with its sizes or its value."""

    kind: str
    name: str
    sizes: tuple[Expr, ...]
    value: Expr | None


@dataclass(frozen=True, slots=True)
class Assign:
    """target = value; `+=` is written out."""

    target: Expr
    value: Expr


@dataclass(frozen=True, slots=True)
class Loop:
    """for (name = first; test; name++)."""

    name: str
    first: Expr
    test: Expr
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class Test:
    """if (test) ... else ..."""

    test: Expr
    yes: tuple[Statement, ...]
    no: tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class Return:
    """The value of a function; None of a void one."""

    value: Expr | None


@dataclass(frozen=True, slots=True)
class Do:
    """A call, for what it writes."""

    call: Call


Statement = Declare | Assign | Loop | Test | Return | Do


@dataclass(frozen=True, slots=True)
class Shape:
    """What a name stands for: `real`, `int`, `state` or (of a function) `void`, with so many indices.

    `const`: what it points to is not written.
    """

    kind: str
    depth: int = 0
    const: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Function:
    """A function: names of what it is given, and its body; its type and theirs, where the text says them."""

    name: str
    given: tuple[str, ...]
    body: tuple[Statement, ...]
    kind: str = "void"
    shapes: tuple[Shape, ...] = ()


def parts(tree: Expr) -> tuple[Expr, ...]:
    """The operands of an expression."""
    match tree:
        case Entry(base, index):
            return (base, index)
        case Member(base, _):
            return (base,)
        case Call(_, args):
            return args
        case Unary(_, arg):
            return (arg,)
        case Binary(_, left, right):
            return (left, right)
        case Choice(test, yes, no):
            return (test, yes, no)
    return ()
