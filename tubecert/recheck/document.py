"""The certificate as a document: its bytes, its form, its hash, and typed access to its fields.

What is not as it should be raises `CertificateError` with a code of its own, see `CODES`.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from tubecert.errors import TubecertError
from tubecert.expression import ExpressionError, parse_number
from tubecert.findings import Finding, Location

FORMAT = "tubecert-certificate/2"
MOST_BYTES = 64_000_000
_VERSIONED = re.compile(r"tubecert-certificate/(\d+)")
_DEEPEST = 60

CODES = {
    "TC600": "the certificate cannot be read",
    "TC601": "the file is not a certificate",
    "TC602": "the certificate's format version is not known",
    "TC603": "a field of the certificate is missing or of the wrong kind",
    "TC604": "the certificate belongs to another specification",
}


class CertificateError(TubecertError):
    """The file is no certificate that could be checked (exit code 2)."""


def wrong(code: str, message: str, help: str = "", location: Location | None = None) -> CertificateError:
    """An error about the document."""
    return CertificateError([Finding(code=code, message=message, help=help, location=location)])


class Node:
    """A value of the document with its path; reading what is not there, or is of another kind, is an error."""

    __slots__ = ("path", "value")

    def __init__(self, value: Any, path: str) -> None:
        self.value, self.path = value, path

    def __getitem__(self, key: str) -> Node:
        if key not in self.mapping():
            raise wrong("TC603", f"{self.path}.{key} is missing", "write the certificate again")
        return Node(self.value[key], f"{self.path}.{key}")

    def get(self, key: str) -> Node | None:
        """A member that may be absent or null."""
        value = self.mapping().get(key)
        return None if value is None else Node(value, f"{self.path}.{key}")

    def _expected(self, kind: str) -> CertificateError:
        shown = json.dumps(self.value, ensure_ascii=True)[:40]
        return wrong("TC603", f"{self.path} is {shown}, not {kind}", "write the certificate again")

    def mapping(self) -> dict[str, Any]:
        """An object."""
        if not isinstance(self.value, dict):
            raise self._expected("an object")
        return self.value

    def items(self) -> Iterator[tuple[str, Node]]:
        """The members of an object."""
        for key in self.mapping():
            yield key, self[key]

    def entries(self) -> list[Node]:
        """An array."""
        if not isinstance(self.value, list):
            raise self._expected("a list")
        return [Node(value, f"{self.path}[{i}]") for i, value in enumerate(self.value)]

    def text(self) -> str:
        """A string."""
        if not isinstance(self.value, str):
            raise self._expected("a text")
        return self.value

    def flag(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            raise self._expected("true or false")
        return self.value

    def number(self) -> Fraction:
        """An exact number: the decimal that is written, or a text `p/q`."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, (int, float, str, Fraction)):
            raise self._expected("a number")
        if isinstance(value, str):
            try:
                return parse_number(value)
            except ExpressionError:
                raise self._expected("a number") from None
        return value if isinstance(value, Fraction) else Fraction(value)

    def texts(self) -> list[str]:
        """A list of texts."""
        return [item.text() for item in self.entries()]

    def numbers(self) -> list[Fraction]:
        """A list of numbers."""
        return [item.number() for item in self.entries()]

    def pair(self) -> tuple[Node, Node]:
        """[below, above]; either may be null."""
        both = self.entries()
        if len(both) != 2:
            raise self._expected("a pair")
        return both[0], both[1]


def read(text: str, file: str) -> Node:
    """The document, its format checked; numbers are exact."""
    if len(text) > MOST_BYTES:
        raise wrong("TC600", f"{file} is larger than {MOST_BYTES // 1_000_000} MB")
    if _depth(text) > _DEEPEST:
        raise wrong("TC600", f"{file} is nested deeper than {_DEEPEST}")
    try:
        data = json.loads(text, object_pairs_hook=_once, parse_constant=_refused, parse_float=_Decimal)
    except json.JSONDecodeError as error:
        at = Location(file=file, line=error.lineno, column=error.colno)
        raise wrong("TC600", f"not JSON: {error.msg}", "write the certificate again", at) from None
    except ValueError as error:
        raise wrong("TC600", f"{file}: {error}", "write the certificate again") from None
    known = data.get("format") if isinstance(data, dict) else None
    if not isinstance(known, str) or not (match := _VERSIONED.fullmatch(known)):
        raise wrong(
            "TC601", f"{file} is not a certificate of tubecert", "give a file that `tubecert certify` wrote"
        )
    if known != FORMAT:
        newer = int(match[1][:9]) > int(FORMAT.rpartition("/")[2])
        remedy = "use a newer tubecert" if newer else "certify again"
        raise wrong("TC602", f"{file} has the format {known}; this version reads {FORMAT}", remedy)
    return Node(data, "certificate")


class _Decimal(float):
    """A float that remembers the decimal it was read from."""

    __slots__ = ("written",)
    written: str

    def __new__(cls, text: str) -> _Decimal:
        value = super().__new__(cls, text)
        if not math.isfinite(value) or len(text) > 400:
            raise ValueError(f"the number {text[:40]} is out of range")
        value.written = text
        return value

    def as_integer_ratio(self) -> tuple[int, int]:
        """The decimal itself, exactly (`Fraction` reads this)."""
        return Fraction(self.written).as_integer_ratio()


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key occurs twice in one object")
    return found


def _refused(word: str) -> None:
    raise ValueError(f"{word} is not a number")


def _depth(text: str) -> int:
    deepest = depth = 0
    for bracket in re.finditer(r"[\[\]{}]", text):
        depth += 1 if bracket[0] in "[{" else -1
        deepest = max(deepest, depth)
    return deepest


def digest(data: Any) -> str:
    """The hash of the canonical bytes: UTF-8, sorted keys, no spaces."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return "sha256:" + hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
