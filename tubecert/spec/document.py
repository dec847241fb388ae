"""YAML events -> a tree of nodes that know where they stand.

Nothing is resolved: a scalar stays the text that was written (PyYAML reads `1e-3` as text, `NO` as false and
`1:30` as 90). Aliases, tags and further documents are findings. Events come one by one, so that depth is checked
before it can hurt.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any, Final, Literal

import yaml

from tubecert.findings import Finding
from tubecert.spec import codes
from tubecert.spec.source import Mark, Source

MAX_NESTING: Final = 50

_PLAIN_TAGS = tuple(f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "seq", "map"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """What stands at `start` in the text `source`; what a node of its kind does not have is empty.

    A scalar is its `text` as written, with `style` empty for plain text, else the quote or block indicator; a list has
    `items`, a mapping `pairs` in the order of the file; a broken one stands where something was refused (and reported).
    """

    kind: Literal["scalar", "list", "mapping", "broken"]
    start: Mark
    source: Source = field(repr=False)
    end: Mark | None = None
    text: str = ""
    style: str = ""
    items: tuple[Node, ...] = ()
    pairs: tuple[tuple[Node, Node], ...] = ()

    @property
    def is_row(self) -> bool:
        """Whether this is a list of scalars."""
        return self.kind == "list" and len(self.texts) == len(self.items)

    @property
    def texts(self) -> list[str]:
        """The texts of the scalars of a list, without blanks around them."""
        return [node.text.strip() for node in self.items if node.kind == "scalar"]


class _NestedError(Exception):
    """Nodes within nodes beyond `MAX_NESTING`."""


def compose(source: Source, language: str = "YAML") -> tuple[Node | None, list[Finding]]:
    """The tree of the file's one document, None if there is none, and what was wrong with the YAML.

    `language` is what findings call it (JSON is YAML).
    """
    composer = _Composer(source)
    try:
        return composer.document(), composer.findings
    except yaml.YAMLError as error:
        composer.findings.append(_syntax(source, error, language))
    except _NestedError:
        pass
    return None, composer.findings


class _Composer:
    """Builds the tree from events, each node when its event comes."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.findings: list[Finding] = []
        self.refused: set[str] = set()
        # The C parser is the same grammar, faster; where PyYAML was built without it the other one serves.
        self.events = yaml.parse(source.text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))

    def report(self, code: str, mark: Mark, message: str, help: str = "") -> None:
        """Adds a finding."""
        location = self.source.location(mark)
        self.findings.append(Finding(code=code, message=message, location=location, help=help))

    def document(self) -> Node | None:
        """The first document; raises `yaml.YAMLError` and `_NestedError`."""
        found: list[Node] = []
        documents = 0
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents == 2:
                    mark, help = _mark(event.start_mark), "remove what follows ---"
                    self.report(codes.YAML_FEATURE, mark, "a file holds one document", help)
            elif isinstance(event, yaml.NodeEvent):
                found.append(self._node(event, depth=1))
        return found[0] if found else None

    def _node(self, event: yaml.NodeEvent, depth: int) -> Node:
        """The node that begins with an event, with all that is in it."""
        start = _mark(event.start_mark)
        broken = Node(kind="broken", start=start, source=self.source)
        if isinstance(event, yaml.AliasEvent):
            self._refuse("aliases", start, "quote text that begins with *, or repeat what it stands for")
            return broken
        refused = self._is_refused(event, start)
        if isinstance(event, yaml.ScalarEvent):
            style, end = event.style or "", _mark(event.end_mark)
            own = replace(broken, kind="scalar", end=end, text=event.value, style=style)
            return broken if refused else own
        if depth > MAX_NESTING:
            self.report(codes.LIMIT, start, f"the text is nested more than {MAX_NESTING} deep")
            raise _NestedError
        inner: Iterator[Any] = takewhile(
            lambda own: not isinstance(own, yaml.CollectionEndEvent), self.events
        )
        below = tuple(self._node(each, depth + 1) for each in inner)
        if refused:
            return broken
        if isinstance(event, yaml.SequenceStartEvent):
            return replace(broken, kind="list", items=below)
        pairs = tuple(zip(below[::2], below[1::2], strict=True))
        for key, _ in pairs:
            if key.kind in ("list", "mapping"):
                self.report(codes.WRONG_TYPE, key.start, "a key must be a plain word")
        return replace(broken, kind="mapping", pairs=tuple(p for p in pairs if p[0].kind == "scalar"))

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
        help=hidden
        or ("indent with spaces, not tabs" if tab else _remedy(words, location.source, source.lines)),
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


def _remedy(problem: str, line: str, lines: Sequence[str]) -> str:
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
        odd = next((k for k, own in enumerate(lines, start=1) if own.partition(" #")[0].count('"') % 2), None)
        if odd is not None:
            return f"line {odd} opens a quote that it does not close"
        return "close every [ and {, and quote expressions that contain commas"
    return "check indentation, brackets and quotes near this place"


def place_in(scalar: Node, offset: int) -> Mark:
    """Where the character at `offset` of the scalar's text stands in the file.

    Folding and `''` are followed by matching characters; a text with backslash escapes is located at its
    start.
    """
    source = scalar.source
    raw_start = source.index(scalar.start)
    raw = source.text[raw_start : source.index(scalar.end or scalar.start)]
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
