"""What a certification of a sampled loop comes down to, in the words of `expect`."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.checking.expectations import Claim, Outcome
from tubecert.sampled_loop.record import Certificate, Result
from tubecert.spec.tube import WIDTHS
from tubecert.words.sampled_loop import lacking


def outcome(certificate: Certificate) -> Outcome:
    """The verdict, half-widths, what the inputs use of their room, and why it is not certified."""
    result = certificate.result
    lacks = [
        Claim(name=kind, verdict=result.verdict, message=message, relax=help)
        for kind, message, help in lacking(result, certificate.notes)
    ]
    claims = tuple(lacks) or (Claim(name="sampled loop", verdict=result.verdict),)
    return Outcome(verdict=result.verdict, metric=None, numbers=tuple(_numbers(result)), claims=claims)


def _numbers(result: Result) -> Iterator[tuple[str, float]]:
    yield from ((f"{WIDTHS}.{name}", float(width)) for name, width in result.half_widths.items())
    shares = [float(use.share) for use in result.inputs if use.share is not None]
    if shares:
        yield "inputs", max(shares)
