"""`recheck`: a certificate in; every claim examined in a second arithmetic; a verdict and an exit code out."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from tubecert.asking import asked_by, words_of
from tubecert.cli import keeper
from tubecert.cli.adapter import CERTIFICATE, Output, command
from tubecert.errors import ExitCode
from tubecert.library import rechecking

if TYPE_CHECKING:
    from tubecert.library.rechecking import Rechecked
    from tubecert.recheck.run import Examined

_WORDS: Final = {
    "certificate": replace(CERTIFICATE, help="A certificate (JSON); - is stdin."),
    **words_of(rechecking.recheck),
}


@command(_WORDS)
def recheck(how: Output, certificate: str, **asked: Any) -> ExitCode:
    """Verify every claim of a certificate again: in ball arithmetic, with derivatives of its own, without a solver."""
    if seconds := asked.get("deadline"):
        asked["deadline"] = keeper.left_of(float(seconds))
    from tubecert.cli import telling

    def heard(item: Examined) -> None:
        why = "" if item.outcome.holds else f": {item.outcome.why}"
        telling.found(f"{item.outcome.verdict:<12}  {item.name}{why}")

    with telling.shown(how) as progress, asked_by(heard=heard):
        found = rechecking.recheck(certificate, **asked, progress=progress)
    data = _as_json(found) if how.json else None
    told = f"-v here; tubecert report {shlex.quote(certificate)}: what is certified, as a page with figures"
    telling.present(replace(how, quiet=how.quiet or how.json), found._page(), [("more", told)], data)
    return found.found.exit_code


def _as_json(found: Rechecked) -> str:
    from tubecert.printable import printable_json

    failing = found.first_failing
    data = {
        "certificate": found.name,
        "verdict": found.verdict,
        "stated": found.found.stated,
        "hash": found.found.hash,
        "claims": [
            {
                "claim": item.name,
                "verdict": item.outcome.verdict,
                "why": item.outcome.why,
                "boxes": item.outcome.boxes,
            }
            for item in found.claims
        ],
        "first_failing": None if failing is None else failing.name,
        "not_examined": list(found.found.unread),
        **({"specification": found.belongs} if found.belongs else {}),
    }
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"
