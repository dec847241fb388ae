"""The certificate as a document: its bytes, its form, its hash, and typed access to its fields.

What is not as it should be raises `CertificateError` with a code of its own, see `CODES`.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from itertools import accumulate
from typing import Any, TypeVar

from tubecert.errors import TubecertError
from tubecert.findings import Finding, Location
from tubecert.recheck.grammar import LONGEST, GrammarError, read_number, spelled

FORMAT = "tubecert-certificate/3"
SAMPLED_LOOP = "tubecert-sampled-loop/1"
MOST_BYTES = 64_000_000
_KNOWN = {form.rpartition("/")[0]: form for form in (FORMAT, SAMPLED_LOOP)}
_VERSIONED = re.compile(rf"({'|'.join(_KNOWN)})/(\d+)")
_DEEPEST = 60
_LEAST, _MOST = Fraction(1, 10**300), Fraction(10**300)
_MOST_FLOAT = 1e300  # whose shortest decimal is _MOST
_PLAIN = re.compile(r"-?[0-9]{1,40}(\.[0-9]{1,40})?")  # most numbers: read without a grammar
# nearly all of these: the form alone says that `spelled` gives the same text, and that the size is that of a float
_SHORT = re.compile(r"0|-?[1-9][0-9]{0,20}|-?(0|[1-9][0-9]{0,12})\.[0-9]{0,20}[1-9]")
_BRACKETS = re.compile(r'[\[\]{}]|"(?:[^"\\]++|\\.)*+"?', re.DOTALL)  # one, or a whole text
_DECIMAL = re.compile(r"-?[0-9]+(/[0-9]+|(\.[0-9]+)?([eE][-+]?[0-9]+)?)")
_FORMS: dict[type, str] = {dict: "an object", list: "a list"}
T = TypeVar("T")

CODES = {
    "TC600": "the certificate cannot be read",
    "TC601": "the file is not a certificate",
    "TC602": "the certificate's format version is not known",
    "TC603": "a field of the certificate is missing, unknown or of the wrong kind",
    "TC604": "the certificate belongs to another specification",
}


class CertificateError(TubecertError):
    """The file is no certificate that could be checked (exit code 2)."""


def wrong(code: str, message: str, help: str = "", location: Location | None = None) -> CertificateError:
    """An error about the document."""
    return CertificateError([Finding(code=code, message=message, help=help, location=location)])


class Node:
    """A value of the document with its path; reading what is not there, or is of another kind, is an error."""

    __slots__ = ("_at", "value")

    def __init__(self, value: Any, at: str | tuple[Node, str | int]) -> None:
        self.value, self._at = value, at

    @property
    def path(self) -> str:
        """Where the value is: written when it is asked for, as most of a million numbers never are."""
        if isinstance(self._at, str):
            return self._at
        owner, key = self._at
        return f"{owner.path}.{key[:60]}" if isinstance(key, str) else f"{owner.path}[{key}]"

    def _expected(self, kind: str) -> CertificateError:
        shown = _FORMS.get(type(self.value)) or json.dumps(self.value, ensure_ascii=True)[:40]
        return self.refused(f"is {shown}, not {kind}")

    def refused(self, why: str) -> CertificateError:
        """The error that says what is wrong with this value."""
        return wrong("TC603", f"{self.path} {why}", "write the certificate again")

    def mapping(self) -> dict[str, Any]:
        """An object whose keys are names of somebody else's: states, constants, libraries."""
        if not isinstance(self.value, dict):
            raise self._expected("an object")
        return self.value

    def closed(self, *required: str, optional: Collection[str] = ()) -> Members:
        """An object with exactly these keys, each of the optional ones there or not; anything else is an error."""
        for key in self.mapping():
            if key not in required and key not in optional:
                raise Node(None, f"{self.path}.{key[:60]}").refused("is not known in this place")
        return Members(self, {key: self._member(key) for key in self.mapping()})

    def record(self, kind: type[T], **own: Callable[[Node], Any]) -> T:
        """An object with the fields of a data class and no others, each read as the class or as `own` says.

        A field that has a default may be absent.
        """
        every = fields(kind)  # type: ignore[arg-type]
        may = [f.name for f in every if not (f.default is MISSING and f.default_factory is MISSING)]
        members = self.closed(*(f.name for f in every if f.name not in may), optional=may)
        how = {f.name: own.get(f.name) or f.metadata["reads"] for f in every}
        return kind(
            **{name: read(members[name]) for name, read in how.items() if name in members or name not in may}
        )

    def without(self, *keys: str) -> Node:
        """The object without these keys, which somebody else reads; at the same place."""
        return Node({key: value for key, value in self.mapping().items() if key not in keys}, self._at)

    def items(self) -> Iterator[tuple[str, Node]]:
        """The members of an object whose keys are names of somebody else's."""
        for key in self.mapping():
            yield key, self._member(key)

    def _member(self, key: str) -> Node:
        return Node(self.value[key], (self, key))

    def entries(self) -> list[Node]:
        """An array."""
        if not isinstance(self.value, list):
            raise self._expected("a list")
        return [Node(value, (self, i)) for i, value in enumerate(self.value)]

    def text(self) -> str:
        """A string."""
        if not isinstance(self.value, str):
            raise self._expected("a text")
        return self.value

    def word(self, *words: str) -> str:
        """One of several words."""
        if self.text() not in words:
            raise self._expected(" or ".join(words))
        return self.text()

    def flag(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            raise self._expected("true or false")
        return self.value

    def count(self) -> int:
        """A whole number that is not negative."""
        if isinstance(self.value, bool) or not isinstance(self.value, int) or self.value < 0:
            raise self._expected("a whole number")
        return self.value

    def number(self) -> Fraction:
        """A number of JSON: the decimal that is written, which is the one that is hashed."""
        if isinstance(self.value, bool) or not isinstance(self.value, (int, float)):
            raise self._expected("a number")
        if not abs(self.value) <= _MOST_FLOAT:
            raise self._expected("a number of at most 1e300")
        return _of_decimal(repr(self.value))

    def decimal(self) -> Fraction:
        """A number of JSON, or a text where it is not the shortest decimal of a float: a decimal or `p/q`."""
        if isinstance(self.value, str) and _DECIMAL.fullmatch(self.value):
            return self.exact()
        return self.number()

    def exact(self) -> Fraction:
        """A text that stands for a rational number, in the one spelling that it has (unless it is very long)."""
        text = self.text()
        if _SHORT.fullmatch(text):
            return _of_decimal(text)
        try:
            q = self._sized(Fraction(text) if _PLAIN.fullmatch(text) else read_number(text))
        except GrammarError as error:
            raise self._expected(f"a number: {error}") from None
        if len(text) <= LONGEST and text != spelled(q):
            raise self._expected(f"the number {spelled(q)} as it is written here")
        return q

    def _sized(self, q: Fraction) -> Fraction:
        """Neither so large nor so small that a float could not be near it."""
        if q and not _LEAST <= abs(q) <= _MOST:
            raise self._expected("a number between 1e-300 and 1e300")
        return q

    def texts(self) -> tuple[str, ...]:
        """A list of texts."""
        return tuple(item.text() for item in self.entries())

    def pair(self) -> tuple[Node, Node]:
        """Two values."""
        first, second = self.sized(2)
        return first, second

    def sized(self, size: int) -> list[Node]:
        """The items of a list of a known size."""
        items = self.entries()
        if len(items) != size:
            raise self.refused(f"has {len(items)} entries, not {size}")
        return items

    def rows(self, p: int, q: int) -> list[list[Node]]:
        """The items of a matrix of known size."""
        return [row.sized(q) for row in self.sized(p)]


def reads(how: Callable[[Node], Any]) -> Any:
    """A field that `Node.record` reads in this way."""
    return field(metadata={"reads": how})


def may(how: Callable[[Node], Any]) -> Any:
    """The same of a member that may be absent: then it is None."""
    return field(default=None, metadata={"reads": how})


def nullable(how: Callable[[Node], T]) -> Callable[[Node], T | None]:
    """A member that must be there, and may be null: then it says that there is nothing."""
    return lambda node: None if node.value is None else how(node)


def each(how: Callable[[Node], T]) -> Callable[[Node], tuple[T, ...]]:
    """A list of such values."""
    return lambda node: tuple(map(how, node.entries()))


def one_of(*words: str) -> Callable[[Node], str]:
    """One of several words."""
    return lambda node: node.word(*words)


class Members:
    """The members of an object whose keys are known."""

    def __init__(self, owner: Node, members: Mapping[str, Node]) -> None:
        self._owner, self._members = owner, members

    def __getitem__(self, key: str) -> Node:
        if key not in self._members:
            raise Node(None, f"{self._owner.path}.{key}").refused("is missing")
        return self._members[key]

    def require(self, *keys: str) -> None:
        """Raises if one of these is not there."""
        for key in keys:
            self[key]

    def __contains__(self, key: str) -> bool:
        return key in self._members

    def get(self, key: str, reads: Callable[[Node], T]) -> T | None:
        """A member that may be absent."""
        return reads(self[key]) if key in self._members else None


@lru_cache(maxsize=65_536)
def _of_decimal(text: str) -> Fraction:
    """The number of a decimal; those of knots and samples repeat."""
    return Fraction(Decimal(text))


def _given_instead(file: str) -> str:
    if file.endswith((".yaml", ".yml")):
        stem = file.replace("\\", "/").rpartition("/")[2].rpartition(".")[0]
        return f"`tubecert certify {file}` writes one: {stem}.certificate.json"
    return "give a file that tubecert certify wrote"


def read(text: str, file: str) -> Node:
    """The document, its format checked; numbers are exact."""
    if len(text) > MOST_BYTES:
        raise wrong("TC600", f"{file} is larger than {MOST_BYTES // 1_000_000} MB")
    if _depth(text) > _DEEPEST:
        raise wrong("TC600", f"{file} is nested deeper than {_DEEPEST}")
    try:
        data = json.loads(
            text, object_pairs_hook=_once, parse_constant=_refused, parse_float=_float, parse_int=_whole
        )
    except json.JSONDecodeError as error:
        at = Location(file=file, line=error.lineno, column=error.colno)
        raise wrong(
            "TC600", f"this is no certificate, for it is not JSON ({error.msg})", _given_instead(file), at
        ) from None
    except (ValueError, RecursionError) as error:
        raise wrong("TC600", f"{file}: {error}", "write the certificate again") from None
    known = data.get("format") if isinstance(data, dict) else None
    if not isinstance(known, str) or not (match := _VERSIONED.fullmatch(known)):
        raise wrong(
            "TC601", f"{file} is not a certificate of tubecert", "give a file that `tubecert certify` wrote"
        )
    own = _KNOWN[match[1]]
    if known != own:
        newer = int(match[2][:9]) > int(own.rpartition("/")[2])
        told, remedy = ("a newer", "use a newer tubecert") if newer else ("an older", "certify again")
        why = f"{file} was written by {told} version: its format is {known[:60]}, this version reads {own}"
        raise wrong("TC602", why, remedy)
    return Node(data, "certificate")


def _float(text: str) -> float:
    """A number whose shortest decimal is what is written: the hash, which is of that decimal, binds it exactly."""
    value = float(text)
    readable = len(text) <= LONGEST and math.isfinite(value)
    if not readable or (repr(value) != text and Decimal(repr(value)) != Decimal(text)):
        raise ValueError(f"{text[:40]} is not the shortest decimal of a number")
    return value


def _whole(text: str) -> int:
    """A whole number of a length that can be a bandwidth, a rate or a budget."""
    if len(text) > LONGEST:
        raise ValueError(f"the number {text[:40]} is too long")
    return int(text)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key occurs twice in one object")
    return found


def _refused(word: str) -> None:
    raise ValueError(f"{word} is not a number")


def _depth(text: str) -> int:
    steps = ({"[": 1, "{": 1, '"': 0}.get(found[0][0], -1) for found in _BRACKETS.finditer(text))
    return max(accumulate(steps), default=0)


def digest(data: Any) -> str:
    """The hash of the canonical bytes: UTF-8, sorted keys, no spaces."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return "sha256:" + hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


@dataclass(frozen=True, slots=True)
class Enclosure:
    """[below, above]; None where there is no bound."""

    below: Fraction | None = reads(nullable(Node.number))
    above: Fraction | None = reads(nullable(Node.number))

    @property
    def is_interval(self) -> bool:
        """Whether its ends, as far as there are any, are in order."""
        return self.below is None or self.above is None or self.below <= self.above


maybe = nullable(Node.number)


def enclosure(node: Node) -> Enclosure:
    """[below, above]; either may be null."""
    low, high = node.pair()
    return Enclosure(maybe(low), maybe(high))
