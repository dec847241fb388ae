"""The verdict on a certificate: every claim examined, the first that fails named."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from tubecert.errors import ExitCode
from tubecert.recheck import refuted
from tubecert.recheck.certificate import NOT_HASHED, opened, read_result
from tubecert.recheck.claims import Case, of_certified, of_every
from tubecert.recheck.cover import Claim, Memory, Outcome, stated, telling, time_is_up, within
from tubecert.recheck.document import SAMPLED_LOOP, Node, read
from tubecert.recheck.examines import not_examined
from tubecert.recheck.result import Result
from tubecert.recheck.sampled_loop import claims as sampled_loop
from tubecert.recheck.sampled_loop.record import read_result as read_sampled_loop

BUDGET = 200_000
Report = Callable[[str, int, int, int, float], None]
# the claim that is examined now, how many are done, of how many; its boxes so far, and the share of it that is proven

_TOO_LATE = Outcome(verdict="undecided", why="not examined: the time was up")
_CODES = {
    "confirmed": ExitCode.CERTIFIED,
    "contradicted": ExitCode.NOT_CERTIFIED,
    "undecided": ExitCode.UNDECIDED,
}


@dataclass(frozen=True, slots=True)
class Examined:
    """A claim by name, and its outcome."""

    name: str
    outcome: Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class Recheck:
    """What was found. `stated` is the verdict of the certificate, `hash` its hash, `unread` what is for orientation."""

    stated: str
    hash: str
    claims: tuple[Examined, ...]
    unread: tuple[str, ...]

    @property
    def failing(self) -> Examined | None:
        """The first claim that is contradicted, else the first that is undecided."""
        for verdict in ("contradicted", "undecided"):
            for claim in self.claims:
                if claim.outcome.verdict == verdict:
                    return claim
        return None

    @property
    def verdict(self) -> str:
        """`confirmed`, `contradicted` or `undecided`."""
        return "confirmed" if self.failing is None else self.failing.outcome.verdict

    @property
    def exit_code(self) -> ExitCode:
        """0 only for a certificate that says `certified` and is confirmed."""
        if self.stated == "certified" or self.verdict == "contradicted":
            return _CODES[self.verdict]
        return ExitCode.NOT_CERTIFIED if self.stated == "refuted" else ExitCode.UNDECIDED


def recheck(
    text: str,
    file: str,
    budget: int = BUDGET,
    report: Report | None = None,
    memory: Memory | None = None,
    *,
    seconds: float | None = None,
    to_first_failure: bool = False,
    heard: Callable[[Examined], None] | None = None,
) -> Recheck:
    """Examine every claim of the certificate `text`; raises `CertificateError` for what is no certificate.

    `memory` keeps outcomes between certificates; `to_first_failure` leaves the rest alone once a claim has failed. What
    is not proven after so many `seconds` is undecided, and nothing of that is kept. `heard` hears each outcome.
    """
    stated_verdict, stated_hash, unread, of = _read(read(text, file), budget)
    found: list[Examined] = []
    kept = memory if seconds is None else None
    with within(seconds):
        claims = tuple(of())
        for claim in claims:
            told = None if report is None else partial(report, claim.name, len(found), len(claims))
            if told is not None:
                told(0, 0.0)
            with telling(told):
                found.append(Examined(claim.name, _TOO_LATE if time_is_up() else claim.outcome(kept)))
            if heard is not None:
                heard(found[-1])
            if to_first_failure and not found[-1].outcome.holds:
                break
    return Recheck(stated=stated_verdict, hash=stated_hash, claims=tuple(found), unread=unread)


def _read(document: Node, budget: int) -> tuple[str, str, tuple[str, ...], Callable[[], Iterator[Claim]]]:
    """What a certificate of either format states, its hash, what is not examined, and its claims."""
    node, said, own = opened(document)
    of: Callable[[], Iterator[Claim]]
    if document.mapping()["format"] == SAMPLED_LOOP:
        loop = read_sampled_loop(node)
        verdict, unread, of = loop.verdict, loop.unread, partial(sampled_loop.of, loop, budget)
    else:
        result = read_result(node)
        verdict, of = result.verdict, partial(_claims, result, budget)
        unread = (*not_examined(node, verdict), *_refuted_beside(result))

    def claims() -> Iterator[Claim]:
        same = said == own
        yield Claim("the hash is that of the result", (same,), lambda: stated(same, "something was changed"))
        yield from of()

    return verdict, said, (*NOT_HASHED, *unread), claims


def _refuted_beside(result: Result) -> Iterator[str]:
    """Sections and obstacles that are called refuted beside what is certified: why they are is not examined."""
    if result.verdict == "certified" and result.sections is not None:
        yield from (f"{key}.verdict" for key, own in result.sections.items() if own.verdict == "refuted")
        if any(own.verdict == "refuted" for own in result.clearance):
            yield "clearance.verdict"


def _claims(result: Result, budget: int) -> Iterator[Claim]:
    case = Case(result, budget)
    yield from of_every(result)
    yield from of_certified(case) if result.verdict == "certified" else refuted.of_others(case)
