"""The module that `export` writes in Python, read: numbers, tables, programs and the loop; everything else is refused.

What is read becomes the same `Code` that C becomes, so that whatever runs and bounds the one runs and bounds the other.
Programs are translated operation by operation; of what surrounds them there is one text for every kind of loop
(`python_loop`). Nothing but numbers is taken from the file: names that a program could hide are refused.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from tubecert.recheck.code.python_loop import IMPORTED, TESTED, Loop, Pair, functions, methods, table
from tubecert.recheck.code.python_trees import (
    bare,
    constant,
    names,
    program,
    refused,
    string,
    table_of,
    whole,
)
from tubecert.recheck.code.reader import Code, Table, function_of
from tubecert.recheck.code.tree import (
    Expr,
    Function,
    Name,
    Number,
)
from tubecert.recheck.code.words import UnreadError

_NAME = "controller"
_LONGEST = 64_000_000
# programs, and how many vectors come out of each
_PROGRAMS = {
    "plan": 2,
    "drift": 1,
    "flow": 1,
    "symbols": 1,
    "halfway": 2,
    "onward": 2,
    "law": 2,
    "applied": 1,
    "gauss": 1,
    "predictor": 1,
    "estimator": 2,
}
_REALS = ("SAMPLE_TIME", "DELAY", "LEVEL", "REACH", "HORIZON")
_COUNTS = ("MEETS", "EVERY", "PANELS", "SWEEPS")
_TABLES = ("START", "X", "U")
_TESTS = ("MEASURED", "EXPECTED", "TOLERANCE")


def read_python(text: str) -> Code:
    """The code of a module; raises `UnreadError` for what is not of the grammar."""
    if len(text) > _LONGEST or not text.startswith('"""'):  # in its first line no other encoding can be named
        raise UnreadError("the file does not begin as a controller does")
    try:
        tree = ast.parse(text)
        return _Module(bare(tree.body)).code()
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise error if isinstance(error, UnreadError) else UnreadError(f"it is no Python: {error}") from error


@dataclass
class _Module:
    """What stands at the top of a file."""

    body: Sequence[ast.stmt]
    values: dict[str, ast.expr] = field(default_factory=dict)
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    classes: list[ast.ClassDef] = field(default_factory=list)
    rest: list[ast.stmt] = field(default_factory=list)

    def code(self) -> Code:
        """The same controller as C is read into."""
        imported = len(ast.parse(IMPORTED).body)
        _require(IMPORTED, self.body[:imported], {})
        for own in self.body[imported:]:
            self._sort(own)
        tested = self.functions.pop("self_test", None)
        _require(TESTED, [*([] if tested is None else [tested]), *self.rest], {})
        loop = self._loop()
        return Code(
            name=_NAME,
            real="double",
            hash=string(self._value("CERTIFICATE")),
            macros=self._macros(loop),
            tables=self._tables(),
            members=_members(loop),
            functions={own.name: own for own in self._read(loop)},
        )

    def _sort(self, own: ast.stmt) -> None:
        """By kinds; nothing has a name twice, and no name but those that are known."""
        match own:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if name not in self.values:
                known = {*_REALS, *_COUNTS, *_TABLES, *_TESTS, "CERTIFICATE", "STATES", "INPUTS", "ADDS_PLAN"}
                if name not in known and not re.fullmatch(r"(AT|CUBIC)_\w+", name):
                    raise refused(own, f"{name} is no constant that is known")
                self.values[name] = value
            case ast.FunctionDef(name=name) if name not in self.functions:
                self.functions[name] = own
            case ast.ClassDef():
                self.classes.append(own)
            case ast.If():
                self.rest.append(own)
            case _:
                raise refused(own, "this does not belong here")

    # -- numbers

    def _value(self, name: str) -> ast.expr:
        if name not in self.values:
            raise UnreadError(f"there is no {name}")
        return self.values[name]

    def _loop(self) -> Loop:
        """Which loop it says that it is."""
        adds_plan = self._value("ADDS_PLAN")
        if not (isinstance(adds_plan, ast.Constant) and isinstance(adds_plan.value, bool)):
            raise refused(adds_plan, "ADDS_PLAN is no truth")
        for name in _TESTS:
            table_of(self._value(name))
        if ("START" in self.values) != ("plan" not in self.functions):
            raise UnreadError("the plan is given twice, or not at all")
        return Loop(
            inputs=len(names(self._value("INPUTS"))),
            states=len(names(self._value("STATES"))),
            adds_plan=adds_plan.value,
            ends=not self._endless,
            seldom="EVERY" in self.values,
            predicts="predictor" in self.functions,
            swept="PANELS" in self.values,
            pieces=self._size("START"),
            meets=self._count("MEETS"),
            panels=self._count("PANELS"),
            sweeps=self._count("SWEEPS"),
        )

    @property
    def _endless(self) -> bool:
        match self._value("HORIZON"):
            case ast.Attribute(value=ast.Name(id="math"), attr="inf"):
                return True
        return False

    def _count(self, name: str) -> int:
        return int(whole(self._value(name))) if name in self.values else 0

    def _size(self, name: str) -> int:
        return len(table_of(self._value(name))) if name in self.values else 0

    def _macros(self, loop: Loop) -> dict[str, Expr]:
        found: dict[str, Expr] = {"N": Number(str(loop.states)), "M": Number(str(loop.inputs))}
        for name in _REALS:
            if name != "HORIZON" or loop.ends:
                found[f"{_NAME.upper()}_{name}"] = constant(self._value(name))
        if loop.seldom:
            found[f"{_NAME.upper()}_EVERY"] = Number(str(self._count("EVERY")))
        if loop.pieces:
            found["PIECES"] = Number(str(loop.pieces))
        return found

    def _tables(self) -> dict[str, Table]:
        found: dict[str, Table] = {
            name: table_of(self.values[name]) for name in _TABLES if name in self.values
        }
        for own in self._looked:
            for kind in ("AT", "CUBIC"):
                found[f"{kind.lower()}_{own}"] = table_of(self._value(f"{kind}_{own}"))
        return found

    @property
    def _looked(self) -> list[str]:
        """Names of tables; each has its numbers and its function."""
        named = [
            {key.removeprefix(start) for key in keys if key.startswith(start)}
            for start, keys in (("AT_", self.values), ("CUBIC_", self.values), ("table_", self.functions))
        ]
        if not named[0] == named[1] == named[2]:
            raise UnreadError("a table has numbers without a function, or a function without numbers")
        return sorted(named[0])

    # -- functions

    def _read(self, loop: Loop) -> Iterator[Function]:
        left = dict(self.functions)
        around = functions(loop)
        around |= {f"table_{own}": table(own, self._size(f"AT_{own}")) for own in self._looked}
        for name, pair in around.items():
            if name not in left:
                raise UnreadError(f"there is no function {name}")
            yield _paired(pair, left.pop(name))
        yield from self._methods(loop)
        for name, own in left.items():
            if name not in _PROGRAMS:
                raise refused(own, f"{name} is no function that is known")
            yield program(own, _PROGRAMS[name])

    def _methods(self, loop: Loop) -> Iterator[Function]:
        if len(self.classes) != 1:
            raise UnreadError("there has to be one class")
        (own,) = self.classes
        body, wanted = bare(own.body), methods(loop)
        more: list[object] = [own.bases, own.keywords, own.decorator_list, getattr(own, "type_params", ())]
        if own.name != "Controller" or any(more) or len(body) != len(wanted):
            raise refused(own, "the class is not the loop that it has to be")
        for pair, each in zip(wanted, body, strict=True):
            if pair.c:
                yield _paired(pair, each)
            else:
                _require(pair.python, [each], {})


def _members(loop: Loop) -> dict[str, Expr | None]:
    """What the controller keeps."""
    found: dict[str, Expr | None] = {"sample": None}
    if loop.seldom:
        found["since"] = None
    found |= {name: Name("N") for name in ("y", "f")}
    return found | {name: Name("M") for name in ("q", "feedback", "held", "before")}


# -- texts that have to be there


def _paired(pair: Pair, own: ast.stmt) -> Function:
    """What a function of the loop is in C; raises `UnreadError` where it is another one."""
    found: dict[str, str] = {}
    _require(pair.python, [own], found)
    text = pair.c
    for name, number in found.items():
        text = text.replace(f"{{{name}}}", number)
    return function_of(text, _NAME)


def _require(wanted: str, found: Sequence[ast.stmt], numbers: dict[str, str]) -> None:
    """Raises `UnreadError` where statements are not these; `numbers` are those that stand at `NUMBER_...`."""
    body = ast.parse(wanted).body
    for text, own in zip(body, found, strict=False):
        _alike(text, own, numbers, own)
    if len(body) != len(found):
        raise UnreadError("statements are missing, or there are too many")


def _alike(wanted: object, found: object, numbers: dict[str, str], near: ast.AST) -> None:
    """Node by node; first strings of functions are not looked at."""
    if isinstance(wanted, ast.Name) and wanted.id.startswith("NUMBER_"):
        if not isinstance(found, ast.expr):
            raise refused(near, "a number has to stand here")
        match constant(found):
            case Number(text):
                numbers[wanted.id] = text
                return
        raise refused(near, "a positive number has to stand here")
    if type(wanted) is not type(found):
        raise refused(near, "this is not the loop that it has to be")
    if isinstance(wanted, list) and isinstance(found, list):
        if len(wanted) != len(found):
            raise refused(near, "this is not the loop that it has to be")
        for a, b in zip(wanted, found, strict=True):
            _alike(a, b, numbers, b if isinstance(b, ast.stmt | ast.expr) else near)
    elif isinstance(wanted, ast.AST) and isinstance(found, ast.AST):
        for name in wanted._fields:
            a, b = getattr(wanted, name, None), getattr(found, name, None)
            if name == "body" and isinstance(found, ast.FunctionDef):
                a, b = bare(a or []), bare(b or [])
            _alike(a, b, numbers, near)
    elif wanted != found:
        raise refused(near, f"{found!r} has to be {wanted!r} here")
