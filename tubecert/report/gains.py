"""The gains of the certificates as rows: each pair with its own margin, never mixed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import Final

from tubecert.certificate.result import Result
from tubecert.claims.conditions import SECTIONS
from tubecert.digits import exact, percent
from tubecert.kinds import name_of
from tubecert.kinds.kind import Pair, Role
from tubecert.verdict import Verdict

NAMES = SECTIONS
# what a set of gains is chosen for, in the order in which they are shown
ROLES: Final[Mapping[Role, str]] = {
    "feedback": "feedback alone",
    "asked": "asked for",
    "least_bandwidth": "least omega",
    "least_adaptation": "least Gamma",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """One set of gains of one kind of certificate, proven (or not, see `verdict`) on its own: never mix two sets.

    `decides`: whether the verdict is about them. `pair` has them as fractions.
    """

    section: str
    verdict: Verdict
    decides: bool
    pair: Pair

    @property
    def kind(self) -> str:
        """The letter of its kind."""
        return name_of(self.section).letter

    @property
    def chosen(self) -> str:
        """What the gains are chosen for."""
        return ROLES[self.pair.role]

    @property
    def certified(self) -> bool:
        """Whether these gains are proven to suffice."""
        return self.verdict is Verdict.CERTIFIED

    @property
    def omega(self) -> float | None:
        """The filter bandwidth in rad/s, as the certificate prints it; None where the loop has none."""
        return None if self.pair.bandwidth is None else float(self.pair.bandwidth)

    @property
    def Gamma(self) -> float | None:
        """The adaptation rate, as the certificate prints it; None where the loop has none."""
        return None if self.pair.adaptation_rate is None else float(self.pair.adaptation_rate)

    @property
    def margins(self) -> Mapping[str, tuple[float, float]]:
        """By condition what is left, as a share of what is allowed: proven from below and from above."""
        return MappingProxyType({name: (m.below, m.above) for name, m in self.pair.margins.items()})

    def text(self, *, titled: bool = False) -> str:
        """The gains for the verdict line, with their certificate's name if there are several."""
        return (f"{NAMES[self.section]} " if titled else "") + gains_text(self.pair)

    def words(self) -> str:
        """The gains in a sentence."""
        if self.pair.bandwidth is None:
            return "its feedback and no adaptation"
        loop = f"a filter bandwidth of {exact(self.pair.bandwidth)} rad/s"
        return f"{loop} and an adaptation rate of {exact(self.pair.adaptation_rate)}"

    @property
    def slack(self) -> str:
        """The margin in per cent, with the condition that has the least where there are several."""
        margins = {condition: margin.below for condition, margin in self.pair.margins.items()}
        tightest = min(margins, key=lambda condition: margins[condition], default="")
        least = margins.get(tightest)
        known = least if least is not None and isfinite(least) else None
        return f"{percent(known)} {tightest}" if len(margins) > 1 and known is not None else percent(known)


def named(key: str) -> str:
    """A kind of certificate in a sentence: `A, paper's conditions`."""
    return NAMES[key].replace(" ", ", ", 1)


def gains_text(pair: Pair) -> str:
    """A set of gains as one reads it."""
    parts = ["feedback alone" if pair.bandwidth is None else f"omega = {exact(pair.bandwidth)} rad/s"]
    if pair.adaptation_rate is not None:
        parts.append(f"Gamma = {exact(pair.adaptation_rate)}")
    return ", ".join(parts)


def rows(result: Result) -> Iterator[Gains]:
    """Every set of gains that the certificate holds."""
    for key in NAMES:
        section = result.sections.get(key)
        if section is None:
            continue
        decisive = section.decisive(asked=result.asked)
        for pair in sorted(section.pairs(asked=result.asked), key=lambda pair: ORDER.index(pair.role)):
            yield Gains(
                section=key,
                verdict=section.verdict,
                decides=key in result.decided_by and pair == decisive,
                pair=pair,
            )


ORDER = tuple(ROLES)


def deciding(result: Result) -> list[Gains]:
    """The gains that the verdict is about."""
    return [row for row in rows(result) if row.decides]
