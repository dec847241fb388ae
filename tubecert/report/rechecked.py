"""What `recheck` found, as a page: the verdict, the claim that fails, every claim with its outcome."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from tubecert.printable import visible
from tubecert.report.page import Facts, Page, Section, Table

if TYPE_CHECKING:
    from tubecert.recheck.run import Examined, Recheck


def page_of(found: Recheck, name: str, note: str = "") -> Page:
    """The page of a certificate in a file of this name; `note`: whose specification it is, if that was asked."""
    claims = sorted(found.claims, key=lambda item: item.outcome.holds)  # those first that are not confirmed
    rest = Facts.of(_rest(found))
    said = f"the certificate says {found.stated}", _failing(found), note
    return Page(
        name=name,
        verdict=found.verdict,
        summary=visible("; ".join(filter(None, said))),
        sections=(
            Section(key="claims", title="Claims", blocks=(_table(claims),)),
            Section(key="rest", title="Further", blocks=(rest,)),
        ),
        about="recheck",
    )


def _failing(found: Recheck) -> str:
    if found.failing is not None:
        return f"first failing claim: {found.failing.name}: {found.failing.outcome.why}"
    return "" if found.stated == "certified" else "what can be examined of it agrees; it certifies nothing"


def _table(claims: Sequence[Examined]) -> Table:
    rows = (
        (
            item.outcome.verdict,
            visible(item.name if item.outcome.holds else f"{item.name}: {item.outcome.why}"),
            str(item.outcome.boxes or ""),
        )
        for item in claims
    )
    return Table.of(("", f"{len(claims)} claims", ">boxes"), rows)


def _rest(found: Recheck) -> Iterator[tuple[str, str]]:
    yield "hash", visible(found.hash)
    if found.unread:
        yield "not examined", f"for orientation only: {', '.join(found.unread)}"
