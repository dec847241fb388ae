"""What a certification of a sampled loop comes down to, in the words of `expect`."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.checking.expectations import Claim, Outcome
from tubecert.sampled_loop.record import Certificate, Result
from tubecert.spec.settings import WIDTHS
from tubecert.words.sampled_loop import remedy, why


def outcome(certificate: Certificate) -> Outcome:
    """The verdict, half-widths, what the inputs use of their room, and why it is not certified."""
    result, notes, effective = certificate.result, certificate.notes, certificate.result.spec.effective
    lacks = [
        Claim(
            name=lack.kind,
            verdict=result.verdict,
            message=why(lack, effective),
            relax=remedy(lack, effective, notes),
        )
        for lack in result.lacks
    ]
    claims = tuple(lacks) or (Claim(name="sampled loop", verdict=result.verdict),)
    return Outcome(verdict=result.verdict, metric=None, numbers=tuple(_numbers(result)), claims=claims)


def _numbers(result: Result) -> Iterator[tuple[str, float]]:
    yield from ((f"{WIDTHS}.{name}", float(width)) for name, width in result.half_widths.items())
    shares = [float(use.share) for use in result.inputs if use.share is not None]
    if shares:
        yield "inputs", max(shares)
