"""The gains of the three certificates as rows: each pair with its own margin, never mixed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from tubecert.report.numbers import Number, exact, percent
from tubecert.words.conditions import SECTIONS

NAMES = SECTIONS


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """One set of gains of one certificate; `margin` is what is proven to be left, of what is allowed."""

    section: str
    which: str
    verdict: str
    decides: bool
    bandwidth: Number | None
    adaptation_rate: Number | None = None
    sample_time: Number | None = None
    margin: float | None = None
    tightest: str = ""

    def text(self, *, titled: bool = False) -> str:
        """The gains for the verdict line, with their certificate's name if there are several."""
        parts = [f"omega = {exact(self.bandwidth)} rad/s"]
        if self.adaptation_rate is not None:
            parts.append(f"Gamma = {exact(self.adaptation_rate)}")
        if self.sample_time is not None:
            parts.append(f"Ts = {exact(self.sample_time)} s")
        return (f"{NAMES[self.section]} " if titled else "") + ", ".join(parts)

    def words(self) -> str:
        """The gains in a sentence."""
        loop = f"a filter bandwidth of {exact(self.bandwidth)} rad/s"
        if self.sample_time is not None:
            return f"{loop} and adaptation every {exact(self.sample_time)} s"
        return f"{loop} and an adaptation rate of {exact(self.adaptation_rate)}"

    @property
    def slack(self) -> str:
        """The margin in per cent, with the condition that has the least where there are several."""
        share = percent([self.margin])
        return f"{share} {self.tightest}" if self.tightest and self.margin is not None else share


def rows(result: Mapping[str, Any]) -> Iterator[Gains]:
    """Every set of gains that the certificate holds."""
    decided_by = result.get("decided_by", ())
    for section, read in (("conditions_26", _rates), ("distance", _distance), ("sampled", _sampled)):
        if section in result:
            yield from read(result[section], section in decided_by, bool(_asked(result)))


def deciding(result: Mapping[str, Any]) -> list[Gains]:
    """The gains that the verdict is about."""
    return [row for row in rows(result) if row.decides]


def _asked(result: Mapping[str, Any]) -> bool:
    return "bandwidth" in result.get("overrides", {})


def _rates(data: Mapping[str, Any], decides: bool, asked: bool) -> Iterator[Gains]:
    if data.get("bandwidth") is not None:
        yield _rate_pair(data, data, "asked for" if asked else "least omega", decides)
    if (least := data.get("least_adaptation")) and not asked:
        yield _rate_pair(data, least, "least Gamma", False)


def _rate_pair(data: Mapping[str, Any], pair: Mapping[str, Any], which: str, decides: bool) -> Gains:
    margins = {claim: margin[0] for claim, margin in (pair.get("margins") or {}).items()}
    # a margin that is not bounded from below may be the least
    tightest = min(margins, key=lambda claim: -inf if margins[claim] is None else margins[claim], default="")
    return Gains(
        section="conditions_26",
        which=which,
        verdict=data["verdict"],
        decides=decides,
        bandwidth=pair["bandwidth"],
        adaptation_rate=pair["adaptation_rate"],
        margin=margins.get(tightest),
        tightest=tightest,
    )


def _distance(data: Mapping[str, Any], decides: bool, asked: bool) -> Iterator[Gains]:
    pairs = {
        "asked for": data.get("asked"),
        "least omega": data.get("split"),
        "least Gamma": data.get("least_adaptation"),
    }
    found = {which: pair for which, pair in pairs.items() if pair and asked == (which == "asked for")}
    decisive = next((which for which in ("asked for", "least Gamma", "least omega") if which in found), "")
    for which, pair in found.items():
        yield Gains(
            section="distance",
            which=which,
            verdict=data["verdict"],
            decides=decides and which == decisive,
            bandwidth=pair["bandwidth"],
            adaptation_rate=pair["adaptation_rate"],
            margin=(pair.get("margin") or [None])[0],
        )


def _sampled(data: Mapping[str, Any], decides: bool, asked: bool) -> Iterator[Gains]:
    if data.get("sample_time") is not None:
        yield Gains(
            section="sampled",
            which="asked for" if asked else "omega = 1/Ts",
            verdict=data["verdict"],
            decides=decides,
            bandwidth=data["bandwidth"],
            sample_time=data["sample_time"],
            margin=(data.get("margin") or [None])[0],
        )
