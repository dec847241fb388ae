"""`compare`: certificates in; what they say side by side, as a table, a page or data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from tubecert import certificate
from tubecert.asking import CERTIFICATE, Choice, Text, refuse
from tubecert.certificate.file import refused, spare
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout
from tubecert.cli.telling import present
from tubecert.files import STDIN

_FILES = "A page or a table: FILE.html (with figures), FILE.md, FILE.csv or FILE.json; may be repeated."
_WORDS: Final = {
    "certificates": replace(CERTIFICATE, help="Certificates, two or more.", metavar="CERT...", many=True),
    "format_": Choice(
        "What to write on stdout; markdown is for pull requests.", words=("text", "markdown", "csv", "json")
    ),
    "output": Text(_FILES, "FILE", short="-o", many=True),
}


@command(_WORDS)
def compare(
    how: Output, certificates: Sequence[str], *, format_: str = "text", output: Sequence[str] = ()
) -> None:
    """Put gains, tubes and margins of certificates side by side, and name what differs in their specifications."""
    if how.json and format_ not in ("text", "json"):
        refuse("--format", "", "--json and --format exclude each other")
    from tubecert.library import comparing

    if certificates.count(STDIN) > 1:
        raise refused("- is given twice: one certificate can be on stdin", "give files")
    for target in output:
        form = comparing.Comparison.form_of(target)
        certificate.check_target(target, comparing.Comparison.remedy)
        spare(target, form, {f"certificate {path}": path for path in certificates if path != STDIN})
    comparison = comparing.compare(*certificates)
    for target in output:
        comparison.save(target)
    if how.json or format_ != "text":
        write_stdout(getattr(comparison, "json" if how.json else format_))
        return
    written = [*(("page", target) for target in output), ("more", "-v here; -o FILE.html")]
    present(how, comparison._page(), written)
