"""Header and source of an exported controller, read: macros, tables and functions; everything else is refused."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from tubecert.recheck.code.expressions import Words
from tubecert.recheck.code.tree import (
    Assign,
    Binary,
    Call,
    Declare,
    Do,
    Expr,
    Function,
    Loop,
    Name,
    Number,
    Return,
    Shape,
    Statement,
    Test,
)
from tubecert.recheck.code.typed import require_typed
from tubecert.recheck.code.words import UnreadError, Word, words

Table: TypeAlias = "str | tuple[Table, ...]"  # literals

_DEFINE = re.compile(r"#define (\w+)(?: (.*?))?(?: /\*(?:(?!\*/).)*\*/)?")
_UNSAFE = (
    "__FAST_MATH__", "__ASSOCIATIVE_MATH__", "__RECIPROCAL_MATH__", "__NO_SIGNED_ZEROS__", "_M_FP_FAST",
)  # fmt: skip
_ASKED = (  # of a compiler, in this order; %s is the type
    "#if " + " || ".join(f"defined({name})" for name in _UNSAFE),
    '#error "compile without -ffast-math: it changes the arithmetic"',
    "#endif",
    "#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0",
    '#error "compile without -ffinite-math-only: it removes the checks of what is measured"',
    "#endif",
    "#if !defined(FLT_EVAL_METHOD) || FLT_EVAL_METHOD != 0",
    '#error "every operation must be done in its own type (on x86: -msse2 -mfpmath=sse)"',
    "#endif",
    "#if FLT_RADIX != 2 || %s",
    '#error "%s is not that of IEEE 754"',
    "#endif",
    "#if defined(__clang__)",
    "#pragma STDC FP_CONTRACT OFF",
    "#if __clang_major__ >= 12 /* of single flags, as -freciprocal-math, it tells the preprocessor nothing */",
    "#pragma float_control(precise, on)",
    "#endif",
    "#endif",
)
_MACROS = ("N", "M", "PIECES")
_TYPES = {"double": "DBL_MANT_DIG != 53", "float": "FLT_MANT_DIG != 24"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Code:
    """A controller: `real` is its type, `members` the sizes of what it keeps, `macros` and `sizes` expressions."""

    name: str
    real: str
    hash: str
    macros: Mapping[str, Expr]
    tables: Mapping[str, Table]
    members: Mapping[str, Expr | None]
    functions: Mapping[str, Function]


def read_code(header: str, source: str) -> Code:
    """The code of a header and its source; raises `UnreadError` for what is not of the grammar."""
    head, macros, above = _preprocessed(header)
    body, more, below = _preprocessed(source)
    if not macros.keys().isdisjoint(more):
        raise UnreadError("a macro is defined twice")
    types = re.findall(r"^typedef (double|float) (\w+)_real;$", header, re.MULTILINE)
    if len(types) != 1:
        raise UnreadError("the header has no type of numbers")
    ((real, name),) = types
    if source.count(f"typedef {name}_real real;\n") != 1:
        raise UnreadError("the source has no type of numbers")
    for macro in macros | more:
        if macro not in _MACROS and not macro.startswith(f"{name.upper()}_"):
            raise UnreadError(f"{macro} is no macro that is known")
    _require_lines(header, source, real, name)
    own = _Reader(name)
    own.read(words(head, above))
    own.read(words(body, below))
    found = {key: _expression(text) for key, text in (macros | more).items()}
    for key, table in own.tables.items():
        if not _fits(table, own.sizes[key], found):
            raise UnreadError(f"the table {key} has other sizes than its numbers")
    depths = {key: len(sizes) for key, sizes in own.sizes.items()}
    require_typed(own.functions, found, own.members, depths, real)
    return Code(
        name=name,
        real=real,
        hash=own.hash,
        macros=found,
        tables=own.tables,
        members=own.members,
        functions=own.functions,
    )


def function_of(text: str, name: str = "") -> Function:
    """One function, alone, of the controller of a name."""
    own = _Reader(name)
    own.read(words(text))
    (found,) = own.functions.values()
    return found


def _preprocessed(text: str) -> tuple[str, dict[str, str], list[int]]:
    """What is left for the compiler, with empty lines in place of others, the macros, and which lines those are."""
    left, macros, gone = [], {}, []
    for count, line in enumerate(text.split("\n"), start=1):
        found = _DEFINE.fullmatch(line)
        if found and found[2]:
            if found[1] in macros:
                raise UnreadError(f"{found[1]} is defined twice")
            macros[found[1]] = found[2]
        if line.startswith("#"):
            gone.append(count)
        left.append("" if line.startswith("#") else line)
    return "\n".join(left), macros, gone


def _require_lines(header: str, source: str, real: str, name: str) -> None:
    """Every line of the preprocessor but definitions of numbers, as it has to be."""

    def lines(text: str) -> list[str]:
        defined = (_DEFINE.fullmatch(line) for line in text.split("\n"))
        kept = zip(text.split("\n"), defined, strict=True)
        return [line for line, own in kept if line.startswith("#") and not (own and own[2])]

    big = name.upper()
    asked = [line.replace("%s", _TYPES[real] if "RADIX" in line else real) for line in _ASKED]
    wanted = [f'#include "{name}.h"', "#include <float.h>", "#include <math.h>", *asked]
    if lines(header) != [f"#ifndef {big}_H", f"#define {big}_H", "#include <stdint.h>", "#endif"]:
        raise UnreadError("lines of the preprocessor in the header are others")
    if lines(source) != wanted:
        raise UnreadError("lines of the preprocessor in the source are others")
    # nothing is compiled in some cases only, and all that is compiled stands below what is asked of the compiler
    whole = source.split("\n")
    end = len(whole) - whole[::-1].index("#endif")
    above = [line for line in whole[:end] if line.startswith("#")]
    left, _, gone = _preprocessed("\n".join(whole[:end]))
    if above != wanted or len(words(left, gone)) > 1:
        raise UnreadError("something stands above or between the lines that ask for a compiler")


def _expression(text: str) -> Expr:
    """Of a macro, which is put in as a text: what is not one number or name is in brackets."""
    own = Words(words(text))
    found = own.primary()
    own.take("")
    return found


def _fits(table: Table, sizes: Sequence[Expr | None], macros: Mapping[str, Expr]) -> bool:
    """Whether a table has these sizes: C fills up with 0, and leaves out what is too much."""
    if isinstance(table, str) or not sizes:
        return isinstance(table, str) and not sizes
    size = sizes[0]
    for _ in macros:
        size = macros.get(size.name) if isinstance(size, Name) else size
    right = sizes[0] is None or size == Number(str(len(table)))
    return right and all(_fits(own, sizes[1:], macros) for own in table)


class _Reader:
    """What stands at the top of a file, and the statements in functions."""

    def __init__(self, name: str) -> None:
        self.own, self.hash = name, ""
        self.tables: dict[str, Table] = {}
        self.sizes: dict[str, list[Expr | None]] = {}  # of tables; None: as many as there are
        self.members: dict[str, Expr | None] = {}
        self.functions: dict[str, Function] = {}

    def read(self, found: list[Word]) -> None:
        self._w = Words(found)
        while self._w.next.kind != "end":
            self._item()

    def _item(self) -> None:
        w, own = self._w, self.own
        if w.took("typedef"):
            self._type()
        elif w.took("extern", "const", "char", f"{own}_certificate", "[", "]", ";"):
            return
        elif w.took("const", "char", f"{own}_certificate", "[", "]", "="):
            self.hash = w.next.text.strip('"')
            w.take(w.next.text)
            w.take(";")
        elif w.took("static", "const", "real"):
            self._table()
        else:
            self._function(kept=w.took("static"))

    def _type(self) -> None:
        """The types of numbers, the state, and what holds of sizes (the compiler examines those)."""
        w, own = self._w, self.own
        if w.took("double", f"{own}_real", ";") or w.took("float", f"{own}_real", ";"):
            return
        if w.took(f"{own}_real", "real", ";"):
            return
        if w.took("char"):
            w.name()
            while w.take(w.next.text) != ";":
                pass
            return
        self._kept()

    def _kept(self) -> None:
        w, own = self._w, self.own
        w.take("struct")
        w.take("{")
        while not w.took("}"):
            kind = w.take("uint32_t", f"{own}_real")
            name, sizes = w.name(), w.sizes()
            if len(sizes) != (kind != "uint32_t") or name in self.members:
                raise w.refused()
            self.members[name] = sizes[0] if sizes else None
            w.take(";")
        w.take(f"{own}_state")
        w.take(";")

    def _table(self) -> None:
        w = self._w
        name = w.name()
        sizes: list[Expr | None] = [None] if w.took("[", "]") else []
        sizes += w.sizes()
        w.take("=")
        if name in self.tables:
            raise w.refused("a table twice")
        self.tables[name], self.sizes[name] = self._braces(), sizes
        w.take(";")

    def _braces(self) -> Table:
        w, found = self._w, []
        w.take("{")
        while not w.took("}"):
            found.append(self._braces() if w.next.text == "{" else self._literal())
            if not w.took(",") and w.next.text != "}":
                raise w.refused()
        return tuple(found)

    def _literal(self) -> str:
        w = self._w
        if w.took("("):
            found = self._literal()
            w.take(")")
            return found
        sign = "-" if w.took("-") else ""
        if w.next.kind != "number":
            raise w.refused()
        return sign + w.take(w.next.text)

    def _function(self, *, kept: bool) -> None:
        w = self._w
        kind = w.take("void", "int", "real")
        name = w.name()
        w.take("(")
        given = [self._parameter()]
        while w.take(",", ")") == ",":
            given.append(self._parameter())
        if not kept and w.took(";"):
            return  # what the header promises
        names, shapes = zip(*given, strict=True)
        if name in self.functions or len(set(names)) < len(names):
            raise w.refused(f"{name} twice")
        self.functions[name] = Function(name=name, given=names, body=self._block(), kind=kind, shapes=shapes)

    def _parameter(self) -> tuple[str, Shape]:
        w = self._w
        const = w.took("const")
        kind = w.take("real", "int", f"{self.own}_real", f"{self.own}_state").removeprefix(f"{self.own}_")
        pointer = w.took("*")
        name = w.name()
        return name, Shape(kind, pointer + len(w.sizes()), const)

    def _block(self) -> tuple[Statement, ...]:
        w, found = self._w, list[Statement]()
        w.take("{")
        while not w.took("}"):
            found += self._statement()
        return tuple(found)

    def _statement(self) -> list[Statement]:
        w = self._w
        words_of = {"for": self._loop, "if": self._test, "return": self._return}
        if w.next.text in words_of:
            own: Callable[[], Statement] = words_of[w.take(*words_of)]
            return [own()]
        if w.took("(", "void", ")"):
            w.name()
            w.take(";")
            return []
        if w.took("const") or w.next.text in ("real", "int"):
            return self._declared()
        return [self._done()]

    def _declared(self) -> list[Statement]:
        w, found = self._w, list[Statement]()
        kind = w.take("real", "int")
        while True:
            name, sizes = w.name(), w.sizes()
            value = w.expression() if w.took("=") else None
            found.append(Declare(kind, name, sizes, value))
            if w.take(",", ";") == ";":
                return found

    def _done(self) -> Statement:
        w = self._w
        target = w.expression()
        if isinstance(target, Call):
            w.take(";")
            return Do(target)
        sign = w.take("=", "+=", "++")
        own = Number("1") if sign == "++" else w.expression()
        w.take(";")
        return Assign(target, own if sign == "=" else Binary("+", target, own))

    def _loop(self) -> Statement:
        w = self._w
        w.take("(")
        name = w.name()
        w.take("=")
        first = w.expression()
        w.take(";")
        test = w.expression()
        for text in (";", name, "++", ")"):
            w.take(text)
        return Loop(name, first, test, self._block())

    def _test(self) -> Statement:
        w = self._w
        w.take("(")
        test = w.expression()
        w.take(")")
        yes = self._block()
        return Test(test, yes, self._block() if w.took("else") else ())

    def _return(self) -> Statement:
        w = self._w
        if w.took(";"):
            return Return(None)
        found = w.expression()
        w.take(";")
        return Return(found)
