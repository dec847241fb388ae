"""YAML events -> a tree of nodes that know where they stand.

Nothing is resolved: a scalar stays the text that was written (PyYAML reads `1e-3` as text, `NO` as false and
`1:30` as 90). Aliases, tags and further documents are findings. Events come one by one and the tree grows on
an explicit stack, so that depth is checked before it can hurt.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import yaml

from tubecert.findings import Finding
from tubecert.spec import codes
from tubecert.spec.source import MAX_NESTING, Mark, Source


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """Where a node stands; `source` is the text that `start` is a place of, where that is not the file's."""

    start: Mark
    source: Source | None = field(default=None, repr=False)


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
    try:
        for event in _events(source.text):
            composer.take(event)
            if composer.depth > MAX_NESTING:
                composer.report(codes.LIMIT, event, f"the text is nested more than {MAX_NESTING} deep")
                return None, composer.findings
    except yaml.YAMLError as error:
        composer.findings.append(_syntax(source, error, language))
        return None, composer.findings
    return composer.root, composer.findings


def _events(text: str) -> Iterator[yaml.Event]:
    # The C parser is the same grammar, faster; where PyYAML was built without it the other one serves.
    loader: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    yield from yaml.parse(text, Loader=loader)


class _Composer:
    """Builds the tree from events."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.findings: list[Finding] = []
        self.root: Node | None = None
        self.documents = 0
        self.stack: list[_Open] = []
        self.extras: Counter[str] = Counter()

    @property
    def depth(self) -> int:
        return len(self.stack)

    def report(self, code: str, event: yaml.Event, message: str, help: str = "") -> None:
        """Adds a finding at the event."""
        location = self.source.location(_mark(event.start_mark))
        self.findings.append(Finding(code=code, message=message, location=location, help=help))

    def take(self, event: yaml.Event) -> None:
        """Takes one event."""
        if isinstance(event, yaml.DocumentStartEvent):
            self.documents += 1
            if self.documents == 2:
                self.report(codes.YAML_FEATURE, event, "a file holds one document", "remove what follows ---")
        elif isinstance(event, yaml.AliasEvent):
            self._refuse("aliases", event, "quote text that begins with *, or repeat what it stands for")
            self._place(BrokenNode(start=_mark(event.start_mark)))
        elif isinstance(event, yaml.NodeEvent):
            broken = self._refuse_extras(event)
            if isinstance(event, yaml.ScalarEvent):
                self._place(BrokenNode(start=_mark(event.start_mark)) if broken else _scalar(event))
            else:
                mapping = isinstance(event, yaml.MappingStartEvent)
                self.stack.append(_Open(start=_mark(event.start_mark), mapping=mapping, broken=broken))
        elif isinstance(event, yaml.CollectionEndEvent):
            self._place(self._close(self.stack.pop()))

    def _refuse_extras(self, event: yaml.NodeEvent) -> bool:
        """Reports anchors and tags; returns whether a tag changes what the node means."""
        if event.anchor is not None:
            self._refuse("anchors", event, "remove it, or quote text that begins with &")
        tag: str | None = getattr(event, "tag", None)
        if tag is None:
            return False
        self._refuse("tags", event, "remove it, or quote text that begins with !")
        return tag not in _PLAIN_TAGS

    def _refuse(self, what: str, event: yaml.Event, help: str) -> None:
        """One finding for each kind of thing, at its first occurrence: a bomb holds thousands."""
        self.extras[what] += 1
        if self.extras[what] == 1:
            self.report(codes.YAML_FEATURE, event, f"{what} are not allowed", help)

    def _place(self, node: Node) -> None:
        if self.stack:
            self.stack[-1].children.append(node)
        elif self.documents == 1:
            self.root = node

    def _close(self, open_: _Open) -> Node:
        if open_.broken:
            return BrokenNode(start=open_.start)
        if not open_.mapping:
            return ListNode(start=open_.start, items=tuple(open_.children))
        pairs: list[tuple[Scalar, Node]] = []
        for key, value in zip(open_.children[::2], open_.children[1::2], strict=True):
            if isinstance(key, Scalar):
                pairs.append((key, value))
            elif not isinstance(key, BrokenNode):
                location = self.source.location(key.start)
                self.findings.append(
                    Finding(code=codes.WRONG_TYPE, message="a key must be a plain word", location=location)
                )
        return MappingNode(start=open_.start, pairs=tuple(pairs))


def _scalar(event: yaml.ScalarEvent) -> Scalar:
    start, end = _mark(event.start_mark), _mark(event.end_mark)
    return Scalar(start=start, end=end, text=event.value, style=event.style or "")


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


def place_in(source: Source, scalar: Scalar, offset: int) -> Mark:
    """Where the character at `offset` of the scalar's text stands in the file.

    Folding and `''` are followed by matching characters; a text with backslash escapes is located at its
    start.
    """
    raw_start, raw_end = source.index(scalar.start), source.index(scalar.end)
    raw = source.text[raw_start:raw_end]
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
