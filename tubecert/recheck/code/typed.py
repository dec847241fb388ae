"""Types of the C that is read: every number that is written, handed over or given back is of the type of its place.

C converts silently: a `real` that is written to an `int`, or given back by a function of that type, loses its
fraction. What runs the text (`run`) knows values and no types, so conversions are refused here. Names are declared
once, and are no others of the file, so that it does not matter in which block; and what is pointed to by `&` is not
written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tubecert.recheck.code.seen import FUNCTIONS
from tubecert.recheck.code.tree import (
    Assign,
    Binary,
    Call,
    Choice,
    Declare,
    Do,
    Entry,
    Expr,
    Function,
    Loop,
    Member,
    Name,
    Number,
    Return,
    Shape,
    Statement,
    Test,
    Unary,
)
from tubecert.recheck.code.words import UnreadError

_INT, _REAL, _STATE = Shape("int"), Shape("real"), "state"
_COMPARED = ("<", ">", "<=", ">=", "==")


def require_typed(
    functions: Mapping[str, Function],
    macros: Mapping[str, Expr],
    members: Mapping[str, Expr | None],
    depths: Mapping[str, int],
    real: str,
) -> None:
    """Raises `UnreadError` where a type is not that of its place; `depths` are those of tables, `real` the type."""
    every = [*functions, *macros, *depths, "UINT32_MAX"]
    if len(set(every)) < len(every):
        raise UnreadError("a name of the file stands for two things")
    around = {name: Shape("real", depth, const=True) for name, depth in depths.items()}
    whole = _Typed(functions, macros, members, around, real)
    for own in functions.values():
        whole.function(own)


class _Typed:
    """The names of a file, and of the function that is looked at."""

    def __init__(
        self,
        functions: Mapping[str, Function],
        macros: Mapping[str, Expr],
        members: Mapping[str, Expr | None],
        tables: Mapping[str, Shape],
        real: str,
    ) -> None:
        self._functions, self._macros, self._members = functions, macros, members
        self._tables, self._suffix = tables, "f" if real == "float" else ""
        self._own: dict[str, Shape] = {}
        self._looked: list[str] = []  # macros, one in another
        self._name, self._kind = "", "void"

    def function(self, own: Function) -> None:
        """Its parameters and its body."""
        self._own, self._name, self._kind = {}, own.name, own.kind
        for name, shape in zip(own.given, own.shapes, strict=True):
            if shape.depth > 1 or (shape.kind == _STATE) != (shape.depth == 1 and shape.kind != "real"):
                raise self._wrong(f"{name} is of a type that is not known")
            self._add(name, shape)
        self._all(own.body)

    def _wrong(self, what: str) -> UnreadError:
        return UnreadError(f"{self._name}: {what}")

    def _add(self, name: str, shape: Shape) -> None:
        if name in {*self._own, *self._functions, *self._macros, *self._tables, *FUNCTIONS}:
            raise self._wrong(f"{name} stands for two things")
        self._own[name] = shape

    # -- statements

    def _all(self, body: Sequence[Statement]) -> None:
        for own in body:
            self._do(own)

    def _do(self, own: Statement) -> None:
        match own:
            case Declare(kind, name, sizes, value):
                if len(sizes) > 1 or any(self._of(size) != _INT for size in sizes):
                    raise self._wrong(f"{name} has sizes that are not known")
                if value is not None:
                    self._same(value, Shape(kind, len(sizes)))
                self._add(name, Shape(kind, len(sizes)))
            case Assign(target, value):
                self._written(target, value)
            case Loop(name, first, test, body):
                for each in (Name(name), first, test):
                    self._same(each, _INT)
                self._all(body)
            case Test(test, yes, no):
                self._same(test, _INT)
                self._all((*yes, *no))
            case Return(value):
                if value is not None:
                    self._same(value, Shape(self._kind))
                elif self._kind != "void":
                    raise self._wrong("it gives nothing back")
            case Do(call):
                self._called(call)

    def _written(self, target: Expr, value: Expr) -> None:
        found = self._of(target)
        if (
            found.depth
            or found.const
            or found.kind == _STATE
            or not isinstance(target, Name | Entry | Member)
        ):
            raise self._wrong("something is written that may not be")
        self._same(value, found)

    def _same(self, tree: Expr, wanted: Shape) -> None:
        found = self._of(tree)
        if (found.kind, found.depth) != (wanted.kind, wanted.depth):
            raise self._wrong(f"a number of another type stands where one of {wanted.kind} has to")

    # -- expressions

    def _of(self, tree: Expr) -> Shape:
        match tree:
            case Number(text):
                return _INT if text.isdigit() else _REAL
            case Name(name):
                return self._named(name)
            case Entry(base, index):
                self._same(index, _INT)
                found = self._of(base)
                if not found.depth or found.kind == _STATE:
                    raise self._wrong("an entry of something that has none")
                return Shape(found.kind, found.depth - 1, found.const)
            case Member(base, name):
                return self._member(self._of(base), name)
            case Call():
                return self._called(tree)
            case Unary(sign, arg):
                return self._unary(sign, arg)
            case Binary(sign, left, right):
                return self._both(sign, left, right)
            case Choice(test, yes, no):
                self._same(test, _INT)
                return self._both("+", yes, no)

    def _named(self, name: str) -> Shape:
        if name in self._own:
            return self._own[name]
        if name in self._tables:
            return self._tables[name]
        if name == "UINT32_MAX":
            return _INT
        if name not in self._macros or name in self._looked:
            raise self._wrong(f"{name} is not known")
        self._looked.append(name)
        found = self._of(self._macros[name])
        self._looked.pop()
        return found

    def _member(self, base: Shape, name: str) -> Shape:
        if base.kind != _STATE or base.depth != 1 or name not in self._members:
            raise self._wrong(f"{name} is no member of anything")
        return Shape("int", 0, base.const) if self._members[name] is None else Shape("real", 1, base.const)

    def _unary(self, sign: str, arg: Expr) -> Shape:
        if sign in ("!", "real"):
            self._same(arg, _INT)
            return _INT if sign == "!" else _REAL
        self._same(arg, _REAL)
        return _REAL if sign == "-" else Shape("real", 1, const=True)

    def _both(self, sign: str, left: Expr, right: Expr) -> Shape:
        first = self._of(left)
        if first.depth or first.kind not in ("int", "real") or (sign in ("&&", "||") and first.kind != "int"):
            raise self._wrong(f"{sign} of this is not known")
        self._same(right, first)
        return _INT if sign in (*_COMPARED, "&&", "||") else Shape(first.kind)

    def _called(self, own: Call) -> Shape:
        if own.name in self._functions:
            called = self._functions[own.name]
            if len(called.shapes) != len(own.args):
                raise self._wrong(f"{own.name} is given {len(own.args)} arguments")
            for arg, wanted in zip(own.args, called.shapes, strict=True):
                self._same(arg, wanted)
                if wanted.depth and self._of(arg).const and not wanted.const:
                    raise self._wrong(f"{own.name} may write to what may not be written")
            return Shape(called.kind)
        if own.name.removesuffix(self._suffix) not in FUNCTIONS:
            raise self._wrong(f"{own.name} is not known")
        for arg in own.args:
            self._same(arg, _REAL)
        return _REAL
