"""A cursor over the tree: each question it answers is either a value or a located finding.

A `Field` that cannot answer reports why and returns None; the sections go on, so that one run names every
problem.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from operator import ge, gt, le
from typing import Final, TypeVar

from tubecert.expression import (
    MAX_LENGTH,
    Expression,
    ExpressionError,
    Side,
    elsewhere,
    longest_text,
    near,
    parse_constant,
    parse_number,
    suggestion,
    topological,
)
from tubecert.findings import MOST, Finding, Location
from tubecert.spec import codes
from tubecert.spec.document import Node, place_in
from tubecert.spec.instead import example_of, glued, of_key, of_value, of_word
from tubecert.spec.source import Mark, Source
from tubecert.spec.values import MODERATE, Ends, Matrix, Parameters, Scope, Term, TermMatrix, out_of_range

T = TypeVar("T")


_DECIMAL = re.compile(r"[+-]?[0-9]+(\.[0-9]*)?")
_BOUNDS: Final = {"above": (">", gt), "least": (">=", ge), "most": ("<=", le)}
_ENDLESS: Final = {  # what to do where a number that is not finite has a meaning
    "trajectory.horizon": "; for a claim for all time leave trajectory.horizon out",
    "limits": "; of an input without limits its entry is left out",
}
_CODE_OF_KIND = {
    "syntax": codes.EXPRESSION,
    "symbol": codes.UNKNOWN_SYMBOL,
    "limit": codes.LIMIT,
    "value": codes.EXPRESSION,
}


class Reader:
    """Collects the findings and the places of keys; `document` is what findings call the file."""

    def __init__(self, source: Source, document: str = "the specification") -> None:
        self.source = source
        self.document = document
        self.findings: list[Finding] = []
        self.places: dict[str, Location] = {}

    def report(self, code: str, location: Location, message: str, help: str = "") -> T | None:
        """Adds an error; None, which is read in the place of what is wrong."""
        self.findings.append(Finding(code=code, message=message, location=location, help=help))
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """A node with its dotted path."""

    reader: Reader = field(repr=False)
    path: str
    node: Node
    key: Node | None = None  # the key whose value this is

    @property
    def location(self) -> Location:
        """Where the value begins."""
        return self.node.source.location(self.node.start, len(self.node.text))

    def fail(self, code: str, message: str, help: str = "") -> T | None:
        """Reports that this value will not do."""
        return self.reader.report(code, self.location, message, help)

    def child(self, key: Node, node: Node) -> Field:
        """The value of a key."""
        below = Field(reader=self.reader, path=self._name(key.text), node=node, key=key)
        self.reader.places[below.path] = below.location
        return below

    def get(self, name: str) -> Field | None:
        """The value of a key, if this is a mapping that has it."""
        return next((self.child(key, node) for key, node in self.node.pairs if key.text == name), None)

    def item(self, index: int, node: Node) -> Field:
        """An item of a list."""
        path = f"{self.path}[{index}]"
        below = Field(reader=self.reader, path=path, node=node)
        self.reader.places[path] = below.location
        return below

    # collections

    def mapping(
        self,
        *,
        required: Sequence[str] = (),
        optional: Sequence[str] = (),
        reserved: Sequence[str] = (),
        named: bool = False,
    ) -> dict[str, Field] | None:
        """The values of the known keys, or of names that the file has `named`; others and missing ones are findings."""
        keys = [*(required or optional)]
        pairs = self.pairs(
            f"with the keys {', '.join(keys[:8])}", ", ".join(f"{key}: ..." for key in keys[:2])
        )
        if pairs is None:
            return None
        known = [*required, *optional]
        fields = {key.text: self.child(key, node) for key, node in pairs if key.text in known}
        meant: set[str] = set()  # required keys that a misspelt one stands for
        for key, _ in pairs:
            if key.text in reserved:
                self._at(codes.NOT_YET, key, f"{self._name(key.text)} is not yet supported", "remove it")
            elif key.text not in fields:
                meant.update(self._unknown(key, known, named=named))
        missing = [key for key in required if key not in fields and key not in meant]
        if missing:
            message = f"{self.path or self.reader.document} lacks {', '.join(missing)}"
            help = f"add {', '.join(example_of(key, missing=len(missing) == 1) for key in missing)}"
            if self.key is None:
                self.fail(codes.MISSING_KEY, message, help)
            else:
                self._at(codes.MISSING_KEY, self.key, message, help)
        return fields

    def pairs(self, purpose: str = "", shown: str = "NAME: ...") -> list[tuple[Node, Node]] | None:
        """The keys and values of a mapping, without keys that occur twice."""
        if self.node.kind != "mapping":
            return self._wrong_type(f"a mapping {purpose}".strip(), f"write {{{shown}}}")
        seen: dict[str, Node] = {}
        for key, _ in self.node.pairs:
            if key.text == "<<" and not key.style:
                self._at(codes.YAML_FEATURE, key, "merge keys are not allowed", "write the keys out")
            elif first := seen.get(key.text):
                line = first.start.line + 1
                self._at(
                    codes.DUPLICATE_KEY,
                    key,
                    f"{key.text[:60]} occurs twice (first in line {line})",
                    "keep one",
                )
            seen.setdefault(key.text, key)
        return [(key, node) for key, node in self.node.pairs if seen[key.text] is key and key.text != "<<"]

    def items(self, count: int | None = None, what: str = "entries", help: str = "") -> list[Field] | None:
        """The items of a list; another number of them than `count` is a finding."""
        if self.node.kind != "list":
            return self._wrong_type(
                f"a list of {what if count is None else _counted(count, what)}", help or self._listed(count)
            )
        if count is not None and len(self.node.items) != count:
            return self._wrong_count(len(self.node.items), count, what, help)
        return [self.item(i, node) for i, node in enumerate(self.node.items)]

    # scalars

    def text(self, what: str = "text") -> str | None:
        """The text of a scalar."""
        if self.node.kind != "scalar":
            return self._wrong_type(what)
        return self.node.text

    def word(self, choices: Sequence[str]) -> str | None:
        """One of the words."""
        word = self.text(f"one of {', '.join(choices)}")
        if word is None or word in choices:
            return word
        return self.fail(
            codes.RANGE, f"{self.path} is {word[:60]!r}, not one of the choices", of_word(word, choices)
        )

    def number(self, parameters: Parameters, *, side: Side = "nearest", **bounds: int) -> Fraction | None:
        """A rational number, `above`, at `least` and at `most` its bounds; what contains pi is rounded to a side."""
        if self.node.kind != "scalar":
            return self._wrong_type("a number", self._one_number())
        try:
            value = parse_number(self.node.text, parameters, side)
        except ExpressionError as error:
            error.help = elsewhere("numbers").get(self.node.text, error.help)
            if self.node.text.lower().lstrip("+-.").startswith(("inf", "oo", "forever")):
                error.help += next((more for key, more in _ENDLESS.items() if self.path.startswith(key)), "")
            return self._expression_error(error, codes.NUMBER)
        if extreme := out_of_range(value):
            return self.fail(codes.LIMIT, f"{self.path} is {extreme}", MODERATE)
        told = [(*_BOUNDS[name], bounds[name]) for name in _BOUNDS if name in bounds]
        if all(holds(value, bound) for _, holds, bound in told):
            return value
        needed = " and ".join(f"{sign} {bound}" for sign, _, bound in told)
        return self.fail(codes.RANGE, f"{self.path} is {self.node.text[:40]}; it must be {needed}")

    def constant(self, parameters: Parameters) -> Expression | None:
        """A number as it is, with pi if it contains that."""
        value = self.number(parameters)
        if value is None:
            return None
        exact = parse_constant(self.node.text, parameters)
        if longest_text(exact) > MAX_LENGTH:
            return self.fail(
                codes.LIMIT, f"{self.path} is too long with its parameters written out", "split it"
            )
        return exact

    def numbers(self, count: int, parameters: Parameters) -> tuple[Fraction, ...] | None:
        """A list of numbers."""
        return whole([item.number(parameters) for item in self.items(count, "numbers") or []], count)

    def ends(
        self,
        parameters: Parameters,
        *,
        sides: tuple[Side, Side] = ("below", "above"),
        order: str = "the lower end must be below the upper end",
        help: str = "write [lower, upper]",
        what: str = "numbers",
        counted: str = "",
        equal: bool = False,
    ) -> Ends | None:
        """[lower, upper], each rounded to its side if irrational: outward; `order` says that they are, or `equal`."""
        items = zip(self.items(2, what, counted) or (), sides, strict=False)
        low, high = whole((item.number(parameters, side=side) for item, side in items), 2) or (None, None)
        if low is None or high is None or low < high or (equal and low == high):
            return None if low is None or high is None else (low, high)
        return self.fail(codes.RANGE, f"{self.path}: {order}", help)

    def matrix(self, n: int, parameters: Parameters) -> Matrix | None:
        """A square matrix of numbers, or a number that stands for a multiple of the identity."""
        if self.node.kind == "scalar":
            value = self.number(parameters)
            if value is None:
                return None
            return tuple(tuple(value if i == j else Fraction(0) for j in range(n)) for i in range(n))
        if self.node.is_row and self.node.items:
            message = f"{self.path} must be a matrix, not a list"
            return self.fail(codes.WRONG_SHAPE, message, self._diagonal(n))
        rows = self.items(n, "rows", f"write one number, or {n} rows of {n} numbers")
        return whole([row.numbers(n, parameters) for row in rows or []], n)

    def term(self, scope: Scope) -> Term | None:
        """An expression."""
        if self.node.kind != "scalar":
            row = "write a row of A x as one expression: 2*x1 - x2"
            return self._wrong_type(
                "an expression", row if self.node.is_row else "put the expression in quotes"
            )
        try:
            parsed = scope.parse(self.node.text)
        except ExpressionError as error:
            return self._expression_error(error, codes.EXPRESSION)
        for node in topological([parsed.expression, *(owed.argument for owed in parsed.obligations)]):
            if node.is_constant and (extreme := out_of_range(node.fraction)):
                return self.fail(codes.LIMIT, f"a constant of {self.path} is {extreme}", MODERATE)
        return Term(
            expression=parsed.expression,
            obligations=parsed.obligations,
            places=tuple(self.inside(owed.offset, owed.width) for owed in parsed.obligations),
            text=self.node.text,
            location=self.location,
        )

    def terms(self, count: int, scope: Scope, what: str = "expressions") -> tuple[Term, ...] | None:
        """A list of expressions; the ones that are there are read even if their number is wrong."""
        if self.node.kind != "list":
            return self._wrong_type(f"a list of {what}", self._listed(count))
        nodes = self.node.items[: 2 * count + 8]
        found = [self.item(i, node).term(scope) for i, node in enumerate(nodes)]
        if len(self.node.items) != count:
            return self._wrong_count(len(self.node.items), count, what)
        return whole(found, count)

    def term_matrix(self, rows: int, columns: int, scope: Scope) -> TermMatrix | None:
        """A matrix of expressions, row by row."""
        row = f"[{', '.join(['...'] * columns)}]"
        shape = f"[{', '.join([row] * rows)}]" if rows * columns <= 9 else f"{rows} rows of {columns}"
        if self.node.is_row:
            return self.fail(codes.WRONG_SHAPE, f"{self.path} must be a list of rows", f"write {shape}")
        help = f"write {shape}"
        if rows != columns == len(self.node.items):
            help += "; these rows may be its columns"
        found = self.items(rows, "rows", help)
        return whole([row.terms(columns, scope) for row in found or []], rows)

    def inside(self, offset: int, width: int) -> Location:
        """The place of a part of a scalar's text."""
        assert self.node.kind == "scalar"
        return self.node.source.location(place_in(self.node, offset), width)

    # findings

    def _expression_error(self, error: ExpressionError, ordinary: str) -> T | None:
        special = _CODE_OF_KIND[error.kind]
        code = ordinary if special == codes.EXPRESSION else special
        return self.reader.report(code, self.inside(error.offset, error.width), error.message, error.help)

    def _at(self, code: str, key: Node, message: str, help: str = "") -> None:
        self.reader.report(code, key.source.location(key.start, len(key.text)), message, help)

    def _name(self, key: str) -> str:
        return f"{self.path}.{key}" if self.path else key

    def _listed(self, count: int | None) -> str:
        """How a value would be written as a list."""
        if self.node.kind == "mapping":
            return "write the values only, in brackets and in their order: [..., ...]"
        text = self.node.text.strip()
        if text.startswith("(") and text.endswith(")"):
            text = text[1:-1].strip()
        if count == 2 and (size := re.fullmatch(r"(?:\+-|\+/-|±)\s*([0-9.]+)", text)):
            return f"write [-{size[1]}, {size[1]}]"
        if text.startswith("[") and text.endswith("]"):
            return "remove the quotes around it: a list is not a text"
        if self.path.startswith(("safe_set.", "limits.")) and re.fullmatch(r"[0-9.]+", text):
            return f"write [-{text}, {text}], or whatever its ends are"
        plain = text and len(text) <= 40 and not set(text) & set("[]{}\n;")
        if not plain or (count is not None and text.count(",") + 1 != count):
            return f"write a list in brackets: [{', '.join(['...'] * min(count or 2, 8))}]"
        return f'write ["{text}"]' if "(" in text else f"write [{text}]"

    def _one_number(self) -> str:
        """What to write for a range that is symmetric, or a list of one number."""
        texts = self.node.texts
        single = len(texts) == 1 or (len(texts) == 2 and texts[0] == f"-{texts[1]}")
        return f"write {texts[-1]}" if single else ""

    def _diagonal(self, n: int) -> str:
        """What to write for a list that gives a matrix by its diagonal."""
        texts = self.node.texts
        if len(texts) != n or n > 4:
            return f"write one number for a multiple of the identity, or {n} rows of {n} numbers"
        if len(set(texts)) == 1:
            return f"write {texts[0][:40]}: one number stands for a multiple of the identity"
        rows = [", ".join(text[:20] if i == j else "0" for j in range(n)) for i, text in enumerate(texts)]
        return f"with these numbers on its diagonal it is [{', '.join(f'[{row}]' for row in rows)}]"

    def _wrong_count(self, found: int, wanted: int, what: str, help: str = "") -> T | None:
        texts = self.node.texts
        if any(";" in text for text in texts):
            help = "entries are separated by commas: [..., ...]"
        elif found > wanted and what == "numbers" and all(text.lstrip("+-").isdecimal() for text in texts):
            help = help or "if a comma was meant as a decimal point, write the point"
        if found == 1 and wanted > 1 and self.node.items[0].kind == "list" and "rows" not in what:
            help = help or "one pair of brackets is too many"
        entries = "1 entry" if found == 1 else f"{found} entries"
        return self.fail(
            codes.WRONG_SHAPE, f"{self.path} has {entries}; needed: {_counted(wanted, what)}", help
        )

    def _unknown(self, key: Node, known: Sequence[str], *, named: bool) -> list[str]:
        """Reports an unknown key; returns the known ones that it may stand for."""
        if len(self.reader.findings) > MOST:
            self._at(codes.UNKNOWN_KEY, key, "unknown key")
            return []
        shown = key.text[:60]
        message = f"unknown key {shown}" + (f" in {self.path}" if self.path else "")
        if not key.text.isascii():
            message += " (it contains letters outside ASCII)"
        if apart := glued(key.text, known):
            self._at(codes.UNKNOWN_KEY, key, message, apart)
            return [key.text.partition(":")[0]]
        own = suggestion(key.text, known, what="known keys"), near(key.text, known)
        advice, meant = own if named else of_key(key.text, known)
        self._at(codes.UNKNOWN_KEY, key, message, advice)
        return meant

    def _wrong_type(self, wanted: str, help: str = "") -> T | None:
        if self.node.kind == "broken":
            return None  # has been reported
        found = "a list" if self.node.kind == "list" else "a mapping"
        if self.node.kind == "scalar":
            found = f"the text {self.node.text[:40]!r}" if self.node.text else "nothing"
            if not self.node.style and _DECIMAL.fullmatch(self.node.text):
                found = f"the number {self.node.text[:40]}"
        instead = of_value(self.path, self.node.text)
        name = self.path or self.reader.document
        return self.fail(codes.WRONG_TYPE, f"{name} must be {wanted}, not {found}", instead or help)


def root_field(reader: Reader, node: Node | None) -> Field:
    """The whole document; an empty file is an empty text."""
    start = Mark(line=0, column=0)
    return Field(
        reader=reader,
        path="",
        node=node or Node(kind="scalar", start=start, source=reader.source, end=start, text=""),
    )


def is_of_another_kind(root: Field, kinds: Mapping[str, tuple[str, str]]) -> bool:
    """Reports a file of ours of another kind, by how one of its keys reads: what it lacks would be beside the point."""
    for key, node in root.node.pairs:
        text = f"{key.text}: {node.text}"
        if told := next((told for start, told in kinds.items() if text.startswith(start)), None):
            root.fail(codes.WRONG_TYPE, *told)
            return True
    return False


def _counted(count: int, what: str) -> str:
    """1 expression, one per input; 2 expressions, one per input."""
    first, comma, rest = what.partition(",")
    return f"{count} {first.removesuffix('s') if count == 1 and first != 'entries' else first}{comma}{rest}"


def whole(values: Iterable[T | None], count: int | None = None) -> tuple[T, ...] | None:
    """The values, if none is missing, and there are so many."""
    kept = tuple(values)
    found = tuple(value for value in kept if value is not None)
    return found if len(found) == len(kept) and count in (None, len(kept)) else None
