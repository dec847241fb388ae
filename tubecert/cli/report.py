"""`report`: a certificate in, pages out. Also what `certify --report` checks before it works."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from tubecert.asking import CERTIFICATE, Text, words_of
from tubecert.certificate.file import check_target, refused, spare
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout
from tubecert.files import STDIN, stem_of
from tubecert.library import pages
from tubecert.library.reading import read
from tubecert.printable import printable_json, visible

_FILES: Final = "The page: FILE.html or FILE.md; may be repeated.  [CERT's stem.html]"
_WORDS: Final = {
    "certificate": CERTIFICATE,
    "output": Text(_FILES, "FILE", short="-o", many=True),
    "figures": Text("Every figure as a file, for a paper: SVG, PDF, PNG, captions.", "FOLDER"),
    **words_of(pages.report),
}


@command(_WORDS)
def report(
    how: Output, certificate: str, *, output: Sequence[str] = (), figures: str | None = None, **asked: Any
) -> None:
    """Make a page from a certificate, without certifying anything again."""
    from tubecert.report.claimed import NOT_RECHECKED

    if certificate == STDIN and not output:
        raise refused("a certificate on stdin has no name that the page could have", "give -o FILE.html")
    targets = list(output) or [_beside(certificate)]
    check_pages(targets, {"certificate": certificate})
    page = pages.report(read(certificate), **asked)
    for target in targets:
        page.save(target)
    drawn = [] if figures is None else page.save_figures(figures)
    if how.json:
        write_stdout(printable_json(json.dumps({"pages": targets}, ensure_ascii=False)) + "\n")
    elif not how.quiet:
        rows = [f"page {visible(target)}\n" for target in targets]
        rows += [f"figures {visible(figures)}: {len(drawn)} files\n"] if figures is not None else []
        write_stdout("".join([*rows, f"{NOT_RECHECKED}\n"]))


def check_pages(targets: Sequence[str], taken: Mapping[str, str | None]) -> None:
    """Raise `TargetError` now for a page that cannot be written, or would take the place of another file.

    `taken` says which files must stay what they are.
    """
    kept = dict(taken)
    for page in targets:
        form = pages.Report.form_of(page)
        check_target(page, pages.Report.remedy)
        spare(page, form, kept, "choose another file for the page")
        kept[f"page {page}"] = page


def _beside(source: str) -> str:
    """`plant.html` for `plant.certificate.json`, in the same folder."""
    path = Path(source)
    return str(path.with_name(f"{stem_of(path.name) or 'certificate'}.html")) if path.name else source
