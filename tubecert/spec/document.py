"""YAML events -> a tree of nodes that know where they stand.

Nothing is resolved: a scalar stays the text that was written (PyYAML reads `1e-3` as text, `NO` as false and
`1:30` as 90). Aliases, tags and further documents are findings. Events come one by one and the tree grows on
an explicit stack, so that depth is checked before it can hurt.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, Final

import yaml

from tubecert.findings import Finding
from tubecert.spec import codes
from tubecert.spec.source import Mark, Source


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """Where a node stands: `start` in the text `source`."""

    start: Mark
    source: Source = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scalar(Placed):
    """Text as written; `style` is empty for plain text, else the quote or block indicator."""

    end: Mark
    text: str
    style: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListNode(Placed):
    """A list."""

    items: tuple[Node, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingNode(Placed):
    """A mapping, with its keys in the order of the file."""

    pairs: tuple[tuple[Scalar, Node], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BrokenNode(Placed):
    """Stands where something was refused (and reported)."""


MAX_NESTING: Final = 50

_PLAIN_TAGS = tuple(f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "seq", "map"))

Node = Scalar | ListNode | MappingNode | BrokenNode


@dataclass(slots=True, kw_only=True)
class _Open:
    """A collection that is still being read."""

    start: Mark
    mapping: bool
    broken: bool
    children: list[Node] = field(default_factory=list)


def compose(source: Source, language: str = "YAML") -> tuple[Node | None, list[Finding]]:
    """The tree of the file's one document, None if there is none, and what was wrong with the YAML.

    `language` is what findings call it (JSON is YAML).
    """
    composer = _Composer(source)
    # The C parser is the same grammar, faster; where PyYAML was built without it the other one serves.
    loader: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        for event in yaml.parse(source.text, Loader=loader):
            composer.take(event, _mark(event.start_mark))
            if len(composer.stack) > MAX_NESTING:
                message = f"the text is nested more than {MAX_NESTING} deep"
                composer.report(codes.LIMIT, _mark(event.start_mark), message)
                return None, composer.findings
    except yaml.YAMLError as error:
        composer.findings.append(_syntax(source, error, language))
        return None, composer.findings
    return composer.root, composer.findings


class _Composer:
    """Builds the tree from events."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.findings: list[Finding] = []
        self.root: Node | None = None
        self.documents = 0
        self.stack: list[_Open] = []
        self.refused: set[str] = set()

    def report(self, code: str, mark: Mark, message: str, help: str = "") -> None:
        """Adds a finding."""
        location = self.source.location(mark)
        self.findings.append(Finding(code=code, message=message, location=location, help=help))

    def take(self, event: yaml.Event, start: Mark) -> None:
        """Takes one event."""
        if isinstance(event, yaml.DocumentStartEvent):
            self.documents += 1
            if self.documents == 2:
                self.report(codes.YAML_FEATURE, start, "a file holds one document", "remove what follows ---")
        elif isinstance(event, yaml.AliasEvent):
            self._refuse("aliases", start, "quote text that begins with *, or repeat what it stands for")
            self._place(BrokenNode(start=start, source=self.source))
        elif isinstance(event, yaml.ScalarEvent):
            broken, style, end = self._is_refused(event, start), event.style or "", _mark(event.end_mark)
            scalar = Scalar(start=start, source=self.source, end=end, text=event.value, style=style)
            self._place(BrokenNode(start=start, source=self.source) if broken else scalar)
        elif isinstance(event, yaml.NodeEvent):
            mapping = isinstance(event, yaml.MappingStartEvent)
            self.stack.append(_Open(start=start, mapping=mapping, broken=self._is_refused(event, start)))
        elif isinstance(event, yaml.CollectionEndEvent):
            self._place(self._close(self.stack.pop()))

    def _is_refused(self, event: yaml.NodeEvent, start: Mark) -> bool:
        """Reports anchors and tags; returns whether a tag changes what the node means."""
        if event.anchor is not None:
            self._refuse("anchors", start, "remove it, or quote text that begins with &")
        tag: str | None = getattr(event, "tag", None)
        if tag is not None:
            self._refuse("tags", start, "remove it, or quote text that begins with !")
        return tag is not None and tag not in _PLAIN_TAGS

    def _refuse(self, what: str, start: Mark, help: str) -> None:
        """One finding for each kind of thing, at its first occurrence: a bomb holds thousands."""
        if what not in self.refused:
            self.report(codes.YAML_FEATURE, start, f"{what} are not allowed", help)
        self.refused.add(what)

    def _place(self, node: Node) -> None:
        if self.stack:
            self.stack[-1].children.append(node)
        elif self.documents == 1:
            self.root = node

    def _close(self, open_: _Open) -> Node:
        if open_.broken:
            return BrokenNode(start=open_.start, source=self.source)
        if not open_.mapping:
            return ListNode(start=open_.start, source=self.source, items=tuple(open_.children))
        pairs: list[tuple[Scalar, Node]] = []
        for key, value in zip(open_.children[::2], open_.children[1::2], strict=True):
            if isinstance(key, Scalar):
                pairs.append((key, value))
            elif not isinstance(key, BrokenNode):
                self.report(codes.WRONG_TYPE, key.start, "a key must be a plain word")
        return MappingNode(start=open_.start, source=self.source, pairs=tuple(pairs))


def _mark(mark: Any) -> Mark:  # the two parsers have marks of different types
    return Mark(line=mark.line, column=mark.column) if mark else Mark(line=0, column=0)


def _syntax(source: Source, error: yaml.YAMLError, language: str) -> Finding:
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
    context = getattr(error, "context", None)
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    began = getattr(error, "context_mark", None)
    if began is not None and any(what in str(context) for what in _BEGUN):
        mark = began  # where it ends, or should, says nothing
    words = " ".join(str(problem).split())[:200]
    location = source.location(_mark(mark))
    tab = source.text[source.index(_mark(mark)) :].startswith("\t")
    hidden = _hidden(source.text)
    return Finding(
        code=codes.YAML_SYNTAX,
        message=f"this is not {language}: {words}"
        + (f" ({' '.join(str(context).split())[:100]})" if context else ""),
        location=location,
        help=hidden or ("indent with spaces, not tabs" if tab else _remedy(words, location.source)),
    )


_BEGUN: Final = ("simple key", "quoted scalar")
_ASSIGNED = re.compile(r"\s*([A-Za-z_]\w*)\s*=\s*(.*)")
_GLUED = re.compile(r"\s*([A-Za-z_]\w*):(\S.*)")


def _hidden(text: str) -> str:
    """What cannot be seen and breaks a file: blanks of another kind where a line begins, a bracket in a comment."""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line[: len(line) - len(line.lstrip())].isascii():
            return f"line {number} is indented with a blank that is no space (from a web page or a PDF): type spaces"
        before, mark, comment = line.partition(" #")
        if mark and before.count("[") > before.count("]") and "]" in comment:
            return f"in line {number} the ] stands in a comment: put it before the #"
    return ""


def _remedy(problem: str, line: str) -> str:
    if slip := _ASSIGNED.fullmatch(line) or _GLUED.fullmatch(line):
        return f"write {slip[1]}: {slip[2].strip()[:40]}, with a colon and a blank"
    if "quoted" in problem or "end of stream" in problem:
        return "close the quotes that open here"
    if "expected key" in problem:
        return "keys of one section begin in the same column: indent this line as the others"
    if "mapping values" in problem:
        return "one key per line; quote text that contains ': '"
    if "cannot start any token" in problem:
        return "quote text that begins with a special character"
    if "expected ',' or" in problem or "flow" in problem:
        return "close every [ and {, and quote expressions that contain commas"
    return "check indentation, brackets and quotes near this place"


def place_in(scalar: Scalar, offset: int) -> Mark:
    """Where the character at `offset` of the scalar's text stands in the file.

    Folding and `''` are followed by matching characters; a text with backslash escapes is located at its
    start.
    """
    source = scalar.source
    raw_start = source.index(scalar.start)
    raw = source.text[raw_start : source.index(scalar.end)]
    if scalar.style == '"' and "\\" in raw:
        return scalar.start
    position = raw.find("\n") + 1 if scalar.style in ("|", ">") else 1 if scalar.style else 0
    for character in scalar.text[:offset]:
        if character.isspace():
            position += position < len(raw) and raw[position].isspace()
            continue
        position = raw.find(character, position) + 1
        if position == 0:
            return scalar.start
    if offset < len(scalar.text) and not scalar.text[offset].isspace():
        position = max(position, raw.find(scalar.text[offset], position))
    return source.mark(min(raw_start + position, len(source.text)))
