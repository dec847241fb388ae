"""`export`: a certificate in; a folder with its controller out."""

from __future__ import annotations

from dataclasses import replace

from tubecert.asking import CERTIFICATE, Text
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout
from tubecert.files import stem_of
from tubecert.printable import visible

_WORDS = {
    "certificate": replace(CERTIFICATE, help="A certificate (JSON) of a sampled loop."),
    "output": Text("Where to.  [CERT's stem.controller]", "FOLDER", short="-o"),
}


@command(_WORDS)
def export(how: Output, certificate: str, *, output: str | None = None) -> None:
    """Write the controller that a certificate of a sampled loop is about: C99, with its data and a self-test."""
    from tubecert.library import exporting

    found = exporting.export(certificate, output or f"{stem_of(certificate)}.controller")
    if not how.quiet:
        write_stdout(
            f"{visible(found.folder)}: {', '.join(found.files)}\n"
            f"  {found.work} multiply-adds a sample; README.txt says how to compile and what is covered\n"
        )
