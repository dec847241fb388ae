"""Keys that the command line sets (`--set tube.epsilon=.3`), put into the parsed file before anything is read.

So a value that is set is read as one of the file is: exactly, in its range, with every problem located. Its place is
the option. A path names a key as findings do: `tube.epsilon`, `system.parameters.m`, `initial_state.at[0]`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from tubecert.errors import SpecError
from tubecert.expression import suggestion
from tubecert.findings import Finding, NamedPlace
from tubecert.spec import codes
from tubecert.spec.document import Node, compose
from tubecert.spec.source import Mark, Source, check_limits

OPTION: Final = "--set"
_FORM: Final = "write KEY=VALUE, for example tube.epsilon=0.3"
_NAME = r"[A-Za-z_]\w*"
_INDEX = r"(?:0|[1-9]\d{0,5})"
_PATH = re.compile(rf"{_NAME}(?:\.{_NAME}|\[{_INDEX}\])*", re.ASCII)
_PART = re.compile(rf"({_NAME})|\[({_INDEX})\]", re.ASCII)
_MEANT: Final = ("system.parameters", "system.definitions")
_OWN_NAMES: Final = (*_MEANT, "system.tables", "system.units", "system.outputs")  # keys are the user's words


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A key, by its dotted path, and the text that stands in the place of its value; `option` is who says so."""

    path: str
    text: str
    option: str = field(default=OPTION, compare=False)

    @classmethod
    def of(cls, words: str, option: str = OPTION) -> Setting:
        """What `KEY=VALUE` says; raises `SpecError`."""
        path, equals, text = (part.strip() for part in words.partition("="))
        source = Source.of(option, words, NamedPlace)
        check_limits(source)
        if not words.isprintable():
            _refuse(source, codes.WRONG_TYPE, "the text holds a character that does not print", _FORM)
        if not equals or not path or not text:
            _refuse(source, codes.WRONG_TYPE, f"{words[:60]!r} is not KEY=VALUE", _FORM)
        if not _PATH.fullmatch(path):
            help = "join keys by dots, and number the entries of lists from 0: initial_state.at[0]"
            _refuse(source, codes.UNKNOWN_KEY, f"{path[:60]!r} is no path of a key", help)
        return cls(path=path, text=text, option=option)

    @property
    def place(self) -> str:
        """What findings name in place of a file."""
        return f"{self.option} {self.path}"

    def meets(self, path: str) -> bool:
        """Whether this sets the key at a path, a part of it, or what it is a part of."""
        short, long = sorted((self.path, path), key=len)
        return long == short or long.startswith((f"{short}.", f"{short}["))

    def __str__(self) -> str:
        return f"{self.path}={self.text}"


class _Put:
    """One setting on its way into the tree: `parts` are the keys and numbers of its path."""

    def __init__(self, setting: Setting, findings: list[Finding]) -> None:
        self.setting, self.findings = setting, findings
        self.source = Source.of(setting.place, str(setting), NamedPlace)
        self.parts = list(_PART.finditer(setting.path))

    def within(self, root: Node, k: int = 0, names: Mapping[str, str] | None = None) -> Node:
        """The tree with the value in its place; as it was, with a finding, where there is no such place."""
        names = _named(root) if names is None else names
        if k == len(self.parts):
            return self._value()
        part, before = self.parts[k], self.setting.path[: self.parts[k].start()].rstrip(".")
        before = before or "the specification"
        if part[1] is None:
            items, index = root.items, int(part[2])
            if index < len(items):
                within = self.within(items[index], k + 1, names)
                return replace(root, items=(*items[:index], within, *items[index + 1 :]))
            have = f"has {len(items)} entries" if root.kind == "list" else "is no list"
            help = f"they are numbered from [0] to [{len(items) - 1}]" if items else ""
            return self._unchanged(root, part, f"{before} {have}: there is no [{index}]", help)
        if root.kind == "scalar" and not root.text and not root.style:
            root = replace(root, kind="mapping")
        if root.kind == "mapping":
            return self._within(root, k, before, names)
        found = "a list" if root.kind == "list" else "a value"
        help = "number the entries of a list from 0: [0]" if root.kind == "list" else ""
        return self._unchanged(root, part, f"{before} is {found}: it has no keys", help)

    def _within(self, node: Node, k: int, before: str, names: Mapping[str, str]) -> Node:
        """The same of a mapping: a key that is not there yet is added, but no name of the user's."""
        part, known = self.parts[k], [own.text for own, _ in node.pairs]
        key = part[1]
        if key in known:
            pairs = [
                (own, self.within(value, k + 1, names) if own.text == key else value)
                for own, value in node.pairs
            ]
            return replace(node, pairs=tuple(pairs))
        if before in _OWN_NAMES:
            help = suggestion(key, known, what="names in the file") if known else "the file has none there"
            return self._unchanged(node, part, f"unknown name {key} in {before}", help)
        # a section is no number
        if len(self.parts) == 1 and key in names and self.setting.text[0] not in "[{":
            help = f"write --set {names[key]}.{key}=..."
            return self._unchanged(node, part, f"{key} is no key of a specification", help)
        if k + 1 < len(self.parts) and self.parts[k + 1][1] is None:
            message = f"{self.setting.path[: part.end()]} is not in the file: it has no entries"
            return self._unchanged(node, part, message)
        start, end = Mark(line=0, column=part.start()), Mark(line=0, column=part.end())
        own = Node(kind="scalar", start=start, end=end, text=key, source=self.source)
        below = self.within(Node(kind="mapping", start=start, source=self.source), k + 1, names)
        return replace(node, pairs=(*node.pairs, (own, below)))

    def _value(self) -> Node:
        """The value: a scalar as it is written, or a list or mapping in brackets."""
        text, column = self.setting.text, len(self.setting.path) + 1
        start, end = Mark(line=0, column=column), Mark(line=0, column=column + len(text))
        plain = Node(kind="scalar", start=start, end=end, text=text, source=self.source)
        if text[0] not in "[{":
            return plain
        node, findings = compose(replace(self.source, text=" " * column + text))
        self.findings += findings
        return node or replace(plain, text="", end=start)

    def _unchanged(self, node: Node, part: re.Match[str], message: str, help: str = "") -> Node:
        self.report(codes.UNKNOWN_KEY, part.span(), message, help)
        return node

    def report(self, code: str, span: tuple[int, int], message: str, help: str) -> None:
        """Adds a finding at a part of the path."""
        place = self.source.location(Mark(line=0, column=span[0]), span[1] - span[0])
        self.findings.append(Finding(code=code, message=message, location=place, help=help))


def _named(root: Node) -> dict[str, str]:
    """The user's own names in a file that a path may have been meant for, with where they stand."""
    top = {key.text: value for key, value in root.pairs}
    sections = {f"system.{key.text}": own for key, own in top["system"].pairs} if "system" in top else {}
    named = [(key.text, path) for path, own in sections.items() if path in _MEANT for key, _ in own.pairs]
    return {name: path for name, path in named if name not in top}


def put(node: Node | None, settings: Sequence[Setting]) -> tuple[Node | None, list[Finding]]:
    """The tree with every setting in its place, and what is wrong with them."""
    findings: list[Finding] = []
    for index, setting in enumerate(settings):
        other = next((each for each in settings[:index] if setting.meets(each.path)), None)
        own = _Put(setting, findings)
        if other is not None:
            said = f"{other.path} is set, too" if other.path != setting.path else f"{other.path} is set twice"
            own.report(codes.DUPLICATE_KEY, (0, len(setting.path)), said, "keep one")
        elif node is not None:
            node = own.within(node)
    return node, findings


def _refuse(source: Source, code: str, message: str, help: str) -> None:
    place = source.location(Mark(line=0, column=0), len(source.text))
    raise SpecError([Finding(code=code, message=message, location=place, help=help)])
