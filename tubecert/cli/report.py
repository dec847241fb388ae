"""`report`: a certificate in, pages out. Also what `certify --report` checks before it works, and writes after."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tubecert import certificate
from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.cli.targets import refused
from tubecert.errors import TargetError
from tubecert.files import STDIN
from tubecert.library.pages import REMEDY, Report, require_page, simulated_in
from tubecert.library.reading import read
from tubecert.printable import printable_json, visible
from tubecert.report.claimed import NOT_RECHECKED

if TYPE_CHECKING:
    from tubecert.report.page_simulation import Simulated
    from tubecert.report.quantities import AnyCertificate


def run(source: str, targets: Sequence[str] | None, simulation: str | None, output: Output) -> None:
    """Write the pages of the certificate in `source`, with the figures in a folder of `simulate`.

    Raises `TargetError`.
    """
    if source == STDIN and not targets:
        raise refused("a certificate on stdin has no name that the page could have", "give -o FILE.html")
    pages = list(targets) if targets else [_beside(source)]
    check_pages(pages, {"certificate": source})
    told = read(source).certificate
    write_pages(pages, told, None if simulation is None else simulated_in(simulation, told))
    if output.json:
        write_stdout(printable_json(json.dumps({"pages": pages}, ensure_ascii=False)) + "\n")
    elif not output.quiet:
        write_stdout("".join(f"page {visible(page)}\n" for page in pages) + f"{NOT_RECHECKED}\n")


def check_pages(pages: Sequence[str], taken: Mapping[str, str | Path | None]) -> None:
    """Raise `TargetError` now for a page that cannot be written, or would take the place of another file.

    `taken` says which files must stay what they are.
    """
    kept = {what: path for what, path in taken.items() if path is not None}
    for page in pages:
        require_page(page)
        certificate.check_target(page, REMEDY)
        for what, path in kept.items():
            if Path(path).resolve() == Path(page).resolve() or certificate.same_file(page, path):
                raise _refused(page, f"it is the {what} itself", "choose another file for the page")
        kept[f"page {page}"] = page


def write_pages(pages: Sequence[str], sealed: AnyCertificate, simulated: Simulated | None = None) -> None:
    """Write the pages of a certificate. Raises `TargetError`."""
    for page in pages:
        Report(certificate=sealed, simulated=simulated).save(page)


def _beside(source: str) -> str:
    """`plant.html` for `plant.certificate.json`, in the same folder."""
    path = Path(source)
    name = path.name.removesuffix(".json").removesuffix(".certificate")
    return str(path.with_name(f"{name or 'certificate'}.html")) if path.name else source


def _refused(page: str, why: str, remedy: str) -> TargetError:
    return refused(f"cannot write {page}: {why}", remedy)
