"""Functions of C run in any arithmetic of their numbers: exact balls, or balls with what a computer is off by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from tubecert.recheck.code.reader import Code, Table
from tubecert.recheck.code.seen import FUNCTIONS, Rounded, Seen
from tubecert.recheck.code.tree import (
    Assign,
    Binary,
    Call,
    Choice,
    Declare,
    Do,
    Entry,
    Expr,
    Loop,
    Member,
    Name,
    Number,
    Return,
    Statement,
    Test,
    Unary,
)
from tubecert.recheck.code.words import UnreadError

_MOST = 100_000  # passes of loops in one call
_LARGEST = 2**32 - 1


class Counter:
    """The number of a sample that is neither the first nor the last: `count` is what (real) makes of it."""

    def __init__(self, count: Callable[[int], Seen], before: int = 0) -> None:
        self._count, self._before = count, before

    def converted(self) -> Seen:
        """As a number of the type."""
        return self._count(self._before)

    def earlier(self, by: int) -> Counter:
        """Some samples before."""
        return Counter(self._count, self._before + by)


class _Unknown:
    """A whole number that is not known: what a step returns, in boxes."""


UNKNOWN = _Unknown()
Vector: TypeAlias = "list[Value]"
State: TypeAlias = "dict[str, Value]"  # members of a state, or variables of a function
Value: TypeAlias = "Seen | int | Counter | _Unknown | Vector | State | None"
Own: TypeAlias = Callable[..., Value]


class _ReturnedError(Exception):
    def __init__(self, value: Value) -> None:
        self.value = value


class Machine:
    """The functions of a code; `instead` are done in place of those of their names.

    Vectors are lists, and are written to where a function does that. `left` has the variables of the last call of
    every function.
    """

    def __init__(
        self,
        code: Code,
        arithmetic: Rounded,
        instead: Mapping[str, Own] | None = None,
        tables: Mapping[str, Vector] | None = None,
    ) -> None:
        self.code, self.a = code, arithmetic
        self.instead = dict(instead or {})
        self.left: dict[str, State] = {}
        own = {name: self._table(table) for name, table in code.tables.items()}
        self._tables = own | dict(tables or {})

    def within_tables(self, name: str) -> Vector:
        """A table."""
        return _vector(self._tables.get(name))

    def state(self) -> State:
        """What the controller keeps, of which nothing is known yet."""
        found: State = {}
        for name, size in self.code.members.items():
            found[name] = None if size is None else [None] * self._whole(self._value(size, {}))
        return found

    def size(self, macro: str) -> int:
        """A number of the header."""
        return self._whole(self._value(Name(macro), {}))

    def number(self, macro: str) -> Seen:
        """Another one."""
        return _number(self._value(Name(macro), {}))

    def call(self, name: str, *args: Value) -> Value:
        """A function, by its name."""
        return self.instead[name](*args) if name in self.instead else self.own(name, *args)

    def own(self, name: str, *args: Value) -> Value:
        """The same, of the text in any case."""
        own = self.code.functions.get(name)
        if own is None:
            raise UnreadError(f"there is no function {name}")
        if len(own.given) != len(args):
            raise UnreadError(f"{name} is given {len(args)} arguments")
        memory: State = dict(zip(own.given, args, strict=True))
        self.left[name] = memory
        try:
            self._all(own.body, memory)
        except _ReturnedError as done:
            return done.value
        return None

    def _table(self, table: Table) -> Value:
        return self.a.literal(table) if isinstance(table, str) else [self._table(own) for own in table]

    # -- statements

    def _all(self, body: Sequence[Statement], memory: State) -> None:
        for own in body:
            self._do(own, memory)

    def _do(self, own: Statement, memory: State) -> None:
        match own:
            case Declare():
                self._declare(own, memory)
            case Assign(target, value):
                self._assign(target, self._value(value, memory), memory)
            case Do(call):
                self._value(call, memory)
            case Return(value):
                raise _ReturnedError(None if value is None else self._value(value, memory))
            case Test(test, yes, no):
                self._all(yes if self._known(test, memory) else no, memory)
            case Loop():
                self._loop(own, memory)

    def _declare(self, own: Declare, memory: State) -> None:
        if own.sizes:
            (size,) = own.sizes
            memory[own.name] = [None] * self._whole(self._value(size, memory))
        elif own.value is None:
            memory[own.name] = None
        else:
            value = self._value(own.value, memory)
            if (own.kind == "int") != isinstance(value, int | _Unknown):
                raise UnreadError(f"{own.name} is converted from another type")
            memory[own.name] = value

    def _assign(self, target: Expr, value: Value, memory: State) -> None:
        match target:
            case Name(name) if name in memory:
                memory[name] = value
            case Member(base, name):
                _state(self._value(base, memory))[name] = value
            case Entry(base, index):
                vector, place = _vector(self._value(base, memory)), self._whole(self._value(index, memory))
                if not 0 <= place < len(vector):
                    raise UnreadError(f"entry {place} of a vector of {len(vector)} is written")
                vector[place] = value
            case _:
                raise UnreadError("something is written that is no variable")

    def _loop(self, own: Loop, memory: State) -> None:
        memory[own.name] = self._whole(self._value(own.first, memory))
        for _ in range(_MOST):
            if not self._known(own.test, memory):
                return
            self._all(own.body, memory)
            memory[own.name] = self._whole(memory[own.name]) + 1
        raise UnreadError("a loop does not end")

    def _known(self, test: Expr, memory: State) -> bool:
        found = self._truth(test, memory)
        if found is None:
            raise UnreadError("what is done next depends on numbers that are not known")
        return found

    # -- expressions

    def within(self, function: str, tree: Expr) -> Value:
        """An expression, by the variables of the last call of a function."""
        return self._value(tree, self.left[function])

    def _value(self, tree: Expr, memory: Mapping[str, Value]) -> Value:
        match tree:
            case Number(text):
                return int(text) if text.isdigit() else self.a.literal(text)
            case Name(name):
                return self._named(name, memory)
            case Entry(base, index):
                return self._entry(self._value(base, memory), self._whole(self._value(index, memory)))
            case Member(base, name):
                return _present(_state(self._value(base, memory)).get(name), name)
            case Call(name, args):
                return self._called(name, [self._value(arg, memory) for arg in args])
            case Unary(sign, arg):
                return self._unary(sign, self._value(arg, memory))
            case Binary(sign, left, right):
                return self._both(sign, self._value(left, memory), self._value(right, memory))
            case Choice():
                return self._chosen(tree, memory)

    def _named(self, name: str, memory: Mapping[str, Value]) -> Value:
        if name in memory:
            return _present(memory[name], name)
        if name in self._tables:
            return self._tables[name]
        if name == "UINT32_MAX":
            return _LARGEST
        if name not in self.code.macros:
            raise UnreadError(f"{name} is not known")
        return self._value(self.code.macros[name], {})

    def _entry(self, vector: Value, place: int) -> Value:
        own = _vector(vector)
        if not 0 <= place < len(own):
            raise UnreadError(f"entry {place} of a vector of {len(own)} is read")
        return _present(own[place], f"entry {place}")

    def _called(self, name: str, args: Vector) -> Value:
        plain = name.removesuffix("f") if self.code.real == "float" else name
        if plain in FUNCTIONS and name not in self.code.functions:
            if len(args) != 1 or (plain == name) == (self.code.real == "float"):
                raise UnreadError(f"{name} is not the function of this type")
            return self.a.call(plain, _number(args[0]))
        return self.call(name, *args)

    def _unary(self, sign: str, value: Value) -> Value:
        if sign == "&":
            return [value]
        if sign == "real":
            return value.converted() if isinstance(value, Counter) else self.a.whole(self._whole(value))
        if sign == "-" and not isinstance(value, int):
            return self.a.negative(_number(value))
        raise UnreadError(f"{sign} of this is not known")

    def _both(self, sign: str, a: Value, b: Value) -> Value:
        if isinstance(a, Counter) and isinstance(b, int) and sign in ("+", "-"):
            return a.earlier(b if sign == "-" else -b)
        if isinstance(a, _Unknown) or isinstance(b, _Unknown):
            return UNKNOWN
        if isinstance(a, int) and isinstance(b, int):
            whole = {"+": a + b, "-": a - b, "*": a * b, "/": a // b if b > 0 <= a else None}
            return _present(whole.get(sign), sign)
        if sign not in ("+", "-", "*", "/"):
            raise UnreadError(f"{sign} as a value")
        return self.a.both(sign, _number(a), _number(b))

    def _chosen(self, tree: Choice, memory: Mapping[str, Value]) -> Value:
        found = self._pattern(tree, memory)
        if found is not None:
            return found
        truth = self._truth(tree.test, memory)
        if truth is not None:
            return self._value(tree.yes if truth else tree.no, memory)
        if all(isinstance(self._value(own, memory), int) for own in (tree.yes, tree.no)):
            return UNKNOWN
        raise UnreadError("a choice between numbers that is no minimum and no maximum")

    def _pattern(self, tree: Choice, memory: Mapping[str, Value]) -> Value:
        """The smaller or larger of two numbers, and quotients with a guard."""
        match tree:
            case Choice(Binary("<" | ">" as sign, a, b), yes, no) if (a, b) == (yes, no):
                p, q = self._value(a, memory), self._value(b, memory)
                if isinstance(p, Seen) and isinstance(q, Seen):
                    return self.a.least(p, q) if sign == "<" else self.a.greatest(p, q)
            case Choice(Binary(">", a, b), Binary("/", c, d), Number("1.0" | "1.0f")) if (a, b) == (d, c):
                return self.a.shrink(_number(self._value(a, memory)), _number(self._value(b, memory)))
            case Choice(
                Binary("&&", Binary(">", a, Number(x)), Binary(">", b, Number(y))),
                Binary("/", c, d),
                Number(z),
            ) if (a, b) == (c, d) and {own.rstrip("f") for own in (x, y, z)} == {"0.0"}:
                return self.a.ratio(_number(self._value(a, memory)), _number(self._value(b, memory)))
        return None

    def _truth(self, tree: Expr, memory: Mapping[str, Value]) -> bool | None:
        match tree:
            case Binary("&&" | "||" as sign, left, right):
                first, sure = self._truth(left, memory), sign == "||"
                if first is sure:  # what stands on the right is not computed
                    return sure
                second = self._truth(right, memory)
                if second is sure:
                    return sure
                return None if None in (first, second) else not sure
            case Unary("!", arg):
                found = self._truth(arg, memory)
                return None if found is None else not found
            case Binary(sign, left, right) if sign in ("<", ">", "<=", ">=", "=="):
                return self._compared(sign, self._value(left, memory), self._value(right, memory))
        raise UnreadError("a test that is no comparison")

    def _compared(self, sign: str, a: Value, b: Value) -> bool | None:
        if isinstance(a, Counter) and isinstance(b, int):
            if sign == ">" and b == 0:
                return True
            if sign == "<" and b == _LARGEST:
                return True
            raise UnreadError("samples are compared with another number")
        if isinstance(a, int) and isinstance(b, int):
            return {"<": a < b, ">": a > b, "<=": a <= b, ">=": a >= b, "==": a == b}[sign]
        p, q = _number(a), _number(b)
        if sign in ("<", ">"):
            return self.a.less(p, q) if sign == "<" else self.a.less(q, p)
        if sign in ("<=", ">="):
            found = self.a.less(q, p) if sign == "<=" else self.a.less(p, q)
            return None if found is None else not found
        raise UnreadError("numbers are compared for being equal")

    def _whole(self, value: Value) -> int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise UnreadError("a place or a size that is no whole number")
        return value


def _number(value: Value) -> Seen:
    if not isinstance(value, Seen):
        raise UnreadError("a whole number, or no number, stands where one of the type has to")
    return value


def numbers(value: Value) -> list[Seen]:
    """The entries of a vector."""
    return [_number(each) for each in _vector(value)]


def _vector(value: Value) -> Vector:
    if not isinstance(value, list):
        raise UnreadError("an entry of something that has none")
    return value


def _state(value: Value) -> State:
    if not isinstance(value, dict):
        raise UnreadError("a member of something that has none")
    return value


def _present(value: Value, name: str) -> Value:
    if value is None:
        raise UnreadError(f"{name} is read before it is written")
    return value
