"""What a claim, an advice and an assumption are; a reason is a claim with what is known of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from tubecert.enclosure.constant import Witness
from tubecert.records import INLINE, Tagged
from tubecert.verdict import Verdict

Side = Literal["lower", "upper"]


class Claim(Tagged):
    """Something that is proven, refuted or left undecided."""

    __slots__ = ()
    key: ClassVar[str] = "claim"


class Relax(Tagged):
    """Something that would help."""

    __slots__ = ()


class Assumption(Tagged):
    """Something that is not proven here and that the certificate rests on."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """A claim, what is known of it, a point that shows it, and what would help."""

    claim: Claim = field(metadata=INLINE)
    verdict: Verdict
    at: Witness | None = None
    relax: tuple[Relax, ...] = ()
