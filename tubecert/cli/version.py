"""`version`: what runs, and what results rest on."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from tubecert.cli.guard import write_stdout
from tubecert.libraries import versions
from tubecert.release import __version__

if TYPE_CHECKING:
    from tubecert.cli.options import Output


def run(output: Output) -> None:
    """Show the version."""
    shown = versions() if output.verbose or output.json else {"tubecert": __version__}
    if output.json:
        write_stdout(json.dumps(shown, indent=1) + "\n")
    else:
        write_stdout("".join(f"{name} {version}\n" for name, version in shown.items()))
