"""What a claim, an advice and an assumption are; a reason is a claim with what is known of it.

Each is one class: what it holds, and beside it what it says, in a sentence that nothing reads again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import ClassVar, Literal, TypeVar, dataclass_transform

from tubecert.digits import near
from tubecert.enclosure.constant import Witness
from tubecert.records import INLINE, Tagged
from tubecert.verdict import Verdict

Side = Literal["lower", "upper"]
# symbol and words of each: `bounds.constants` says what they are called
CONSTANTS: dict[str, tuple[str, str]] = {}


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
class Member:
    """Base of families: every member is a frozen record, and says one thing.

    That is `says`, with fields of it in braces: a number as `near` writes it, with three digits in {field:3}; or what a
    member makes of its fields.
    """

    __slots__ = ()
    says: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if Tagged not in cls.__bases__:
            dataclass(frozen=True, kw_only=True)(cls)

    def told(self) -> str:
        """What it says."""
        return self._told()

    def _told(self) -> str:
        return re.sub(r"\{(\w+):?(\d*)\}", self._field, self.says)

    def _field(self, found: re.Match[str]) -> str:
        value = getattr(self, found[1])
        return near(value, int(found[2] or 6)) if isinstance(value, (float, Fraction)) else str(value)


class Claim(Member, Tagged):
    """Something that is proven, refuted or left undecided; `name`: what it is called."""

    __slots__ = ()
    key: ClassVar[str] = "claim"
    name: ClassVar[str] = ""

    @property
    def title(self) -> str:
        """What it is called, in the words of the table of gains."""
        return self._title()

    def why(self, reason: Reason) -> str:
        """Why it holds or not, in one sentence."""
        return self._why(reason)

    def _title(self) -> str:
        return self.name

    def _why(self, reason: Reason) -> str:
        return self.told()


class Relax(Member, Tagged):
    """Something that would help; it says what to do."""

    __slots__ = ()


class Assumption(Member, Tagged):
    """Something that is not proven here and that the certificate rests on; it says what is assumed."""

    __slots__ = ()


M = TypeVar("M", bound=Member)


def plain(module: str, family: type[M], name: str, says: str) -> type[M]:
    """A member of a family without parameters, which says one thing; its tag is its name with underscores."""
    return type(name, (family,), {"says": says, "__doc__": says, "__module__": module})


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """A claim, whose members stand beside these; `at`: a point that shows it; `relax`: what would help."""

    claim: Claim = field(metadata=INLINE)
    verdict: Verdict
    at: Witness | None = None
    relax: tuple[Relax, ...] = ()

    @property
    def when(self) -> str:
        """The time at which the point shows it, at the end of a sentence."""
        return "" if self.at is None or self.at.t is None else f", at t = {near(self.at.t)}"

    @property
    def message(self) -> str:
        """Why it holds or not, in one sentence."""
        return self.claim.why(self)

    @property
    def sentence(self) -> str:
        """The claim and why it holds or not."""
        return f"{self.claim.title}: {self.message}"


def name(constants: Mapping[str, tuple[str, str]]) -> None:
    """What constants are called, symbol and words, by their names in a certificate."""
    CONSTANTS.update(constants)
