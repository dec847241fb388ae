"""`sweep`: a specification and ranges of keys in; a folder with certificates, a table and figures out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert.asking import Text, refuse, words_of
from tubecert.cli.adapter import ENDING, SET, SPEC, Output, command
from tubecert.errors import ExitCode
from tubecert.library import sweeping

if TYPE_CHECKING:
    from tubecert.library.sweeping import Swept
    from tubecert.spec import Setting

_PAGE: Final = "sweep.html"
_WORDS: Final = {
    "spec": SPEC,
    "over": Text("A key and its values; may be repeated.", "KEY=RANGE", many=True),
    "set_": SET,
    **words_of(sweeping.sweep),
    "deadline": ENDING,
    "output": Text("Points, table, figures.  [SPEC's stem.sweep]", "FOLDER", short="-o"),
}


@command(_WORDS)
def sweep(
    how: Output,
    spec: str,
    *,
    over: Sequence[str] = (),
    set_: Sequence[Setting] = (),
    output: str | None = None,
    **asked: Any,
) -> ExitCode:
    """Certify every point of a grid of keys of a specification; a table, curves, heat maps."""
    if not over:
        refuse(
            "--over",
            "",
            "--over says which keys have which values",
            "for example --over tube.epsilon=.1:.6:6",
        )
    from tubecert.cli import telling
    from tubecert.cli.telling import present
    from tubecert.printable import printable_json
    from tubecert.records import exact_json
    from tubecert.report import sweep as told

    folder = output or f"{Path(spec).stem}.sweep"
    with telling.shown(how) as progress:
        found = sweeping.sweep(spec, over, folder=folder, settings=set_, **asked, progress=progress)
    table, data = found.table, None
    if how.json:
        values = [
            [exact_json(each) if isinstance(each, Fraction) else each for each in row]
            for row in table.cells()
        ]
        rows = [dict(zip(table.header, row, strict=True)) for row in values]
        data = printable_json(json.dumps(rows, indent=1, ensure_ascii=False)) + "\n"
    present(how, told.page_of(table), _files(found), data)
    return ExitCode.INTERNAL if found.broken else ExitCode.CERTIFIED


def _files(found: Swept) -> list[tuple[str, str]]:
    """What was written."""
    names = [name for name in found.files if not name.startswith("figures/")]
    drawn = len(found.files) - len(names)
    rows = [("page" if name == _PAGE else "table", str(found.folder / name)) for name in sorted(names)]
    return rows + ([("figures", f"{found.folder / 'figures'}: {drawn} drawings (SVG)")] if drawn else [])
