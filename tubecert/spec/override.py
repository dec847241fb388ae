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
from tubecert.findings import Finding, Location, NamedPlace
from tubecert.spec import codes
from tubecert.spec.document import ListNode, MappingNode, Node, Scalar, compose
from tubecert.spec.source import Mark, Source, check_limits

OPTION: Final = "--set"
_FORM: Final = "write KEY=VALUE, for example tube.epsilon=0.3"
_NAME = r"[A-Za-z_]\w*"
_INDEX = r"(?:0|[1-9]\d{0,5})"
_PATH = re.compile(rf"{_NAME}(?:\.{_NAME}|\[{_INDEX}\])*", re.ASCII)
_PART = re.compile(rf"({_NAME})|\[({_INDEX})\]", re.ASCII)
_OWN_NAMES: Final = (
    "system.parameters",
    "system.definitions",
    "system.tables",
    "system.units",
    "system.outputs",
)  # their keys are the user's words
_MEANT: Final = _OWN_NAMES[:2]


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
        source = _OptionText.of(option, words)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _OptionText(Source):
    """The text of an option; its name stands for file, line and column."""

    def location(self, mark: Mark, width: int = 1) -> Location:
        """The place as a finding names it."""
        found = Source.location(self, mark, width)
        return NamedPlace(file=self.file, line=1, column=found.column, source=self.text, width=max(1, width))


@dataclass(slots=True)
class _Put:
    """One setting on its way into the tree."""

    setting: Setting
    findings: list[Finding]
    source: Source = field(init=False)
    _elsewhere: Mapping[str, str] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.source = _OptionText.of(self.setting.place, str(self.setting))

    def within(self, node: Node) -> Node:
        """The tree with the value in its place; as it was, with a finding, where there is no such place."""
        self._elsewhere = _named(node)
        return self._put(node, 0)

    def _put(self, node: Node, start: int) -> Node:
        match = _PART.match(self.setting.path, start + self.setting.path.startswith(".", start))
        if match is None:
            return self._value()
        if match[1] is None:
            return self._put_item(node, match)
        if isinstance(node, MappingNode) or (isinstance(node, Scalar) and not node.text and not node.style):
            return self._put_key(node, match)
        found = "a list" if isinstance(node, ListNode) else "a value"
        help = "number the entries of a list from 0: [0]" if isinstance(node, ListNode) else ""
        self._fail(match, f"{self._before(match)} is {found}: it has no keys", help)
        return node

    def _put_key(self, node: Node, match: re.Match[str]) -> Node:
        key, pairs = match[1], node.pairs if isinstance(node, MappingNode) else ()
        if any(own.text == key for own, _ in pairs):
            changed = [
                (own, self._put(value, match.end()) if own.text == key else value) for own, value in pairs
            ]
            return MappingNode(start=node.start, source=node.source, pairs=tuple(changed))
        if self._before(match) in _OWN_NAMES:
            names = [own.text for own, _ in pairs]
            help = suggestion(key, names, what="names in the file") if names else "the file has none there"
            self._fail(match, f"unknown name {key} in {self._before(match)}", help)
            return node
        whole = not match.start() and match.end() == len(self.setting.path)
        plain = self.setting.text[0] not in "[{"  # a section is no number
        if whole and plain and key in self._elsewhere:
            help = f"write --set {self._elsewhere[key]}.{key}=..."
            self._fail(match, f"{key} is no key of a specification", help)
            return node
        rest = _PART.match(self.setting.path, match.end())
        if rest is not None and rest[2] is not None:
            self._fail(match, f"{self.setting.path[: match.end()]} is not in the file: it has no entries")
            return node
        mark = Mark(line=0, column=match.start())
        own = Scalar(start=mark, end=Mark(line=0, column=match.end()), text=key, source=self.source)
        below = self._put(MappingNode(start=mark, pairs=(), source=self.source), match.end())
        return MappingNode(start=node.start, source=node.source, pairs=(*pairs, (own, below)))

    def _put_item(self, node: Node, match: re.Match[str]) -> Node:
        items = node.items if isinstance(node, ListNode) else ()
        index = int(match[2])
        if index >= len(items):
            have = f"has {len(items)} entries" if isinstance(node, ListNode) else "is no list"
            help = f"they are numbered from [0] to [{len(items) - 1}]" if items else ""
            self._fail(match, f"{self._before(match)} {have}: there is no [{index}]", help)
            return node
        changed = [self._put(item, match.end()) if i == index else item for i, item in enumerate(items)]
        return ListNode(start=node.start, source=node.source, items=tuple(changed))

    def _value(self) -> Node:
        """The value: a scalar as it is written, or a list or mapping in brackets."""
        text, start = self.setting.text, len(self.setting.path) + 1
        if text[0] not in "[{":
            end = Mark(line=0, column=start + len(text))
            return Scalar(start=Mark(line=0, column=start), end=end, text=text, source=self.source)
        node, findings = compose(_OptionText.of(self.source.file, " " * start + text))
        self.findings += findings
        mark = Mark(line=0, column=start)
        return Scalar(start=mark, end=mark, text="", source=self.source) if node is None else self._ours(node)

    def _ours(self, node: Node) -> Node:
        """A node with this option as its place."""
        match node:
            case ListNode():
                return replace(node, source=self.source, items=tuple(map(self._ours, node.items)))
            case MappingNode():
                pairs = tuple(
                    (replace(key, source=self.source), self._ours(value)) for key, value in node.pairs
                )
                return replace(node, source=self.source, pairs=pairs)
            case _:
                return replace(node, source=self.source)

    def _before(self, match: re.Match[str]) -> str:
        return self.setting.path[: match.start()].rstrip(".") or "the specification"

    def _fail(self, match: re.Match[str], message: str, help: str = "") -> None:
        place = self.source.location(Mark(line=0, column=match.start()), match.end() - match.start())
        self.findings.append(Finding(code=codes.UNKNOWN_KEY, message=message, location=place, help=help))


def _named(root: Node) -> dict[str, str]:
    """The user's own names in a file that a path may have been meant for, with where they stand."""
    pairs = root.pairs if isinstance(root, MappingNode) else ()
    top = {key.text for key, _ in pairs}
    system = next((value for key, value in pairs if key.text == "system"), None)
    found: dict[str, str] = {}
    for section, value in system.pairs if isinstance(system, MappingNode) else ():
        path = f"system.{section.text}"
        if path in _MEANT and isinstance(value, MappingNode):
            found |= {key.text: path for key, _ in value.pairs if key.text not in top}
    return found


def put(node: Node | None, settings: Sequence[Setting]) -> tuple[Node | None, list[Finding]]:
    """The tree with every setting in its place, and what is wrong with them."""
    findings: list[Finding] = []
    for index, setting in enumerate(settings):
        other = next((each for each in settings[:index] if setting.meets(each.path)), None)
        if other is not None:
            source = _OptionText.of(setting.place, str(setting))
            message = (
                f"{setting.path} is set twice" if other.path == setting.path else f"{other.path} is set, too"
            )
            place = source.location(Mark(line=0, column=0), len(setting.path))
            findings.append(
                Finding(code=codes.DUPLICATE_KEY, message=message, location=place, help="keep one")
            )
        elif node is not None:
            node = _Put(setting, findings).within(node)
    return node, findings


def _refuse(source: Source, code: str, message: str, help: str) -> None:
    place = source.location(Mark(line=0, column=0), len(source.text))
    raise SpecError([Finding(code=code, message=message, location=place, help=help)])
