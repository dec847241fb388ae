"""`version`: what runs, and what results rest on."""

from __future__ import annotations

import json
import platform
from importlib import metadata
from typing import TYPE_CHECKING

from tubecert import __version__
from tubecert.cli.guard import write_stdout

if TYPE_CHECKING:
    from tubecert.cli.options import Output

_LIBRARIES = ("numpy", "scipy", "cvxpy", "clarabel", "pyyaml", "python-flint")


def versions() -> dict[str, str]:
    """Versions of tubecert, Python and the libraries that results rest on, as far as installed."""
    found = {"tubecert": __version__, "python": platform.python_version()}
    for name in _LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def run(output: Output) -> None:
    """Show the version."""
    shown = versions() if output.verbose or output.json else {"tubecert": __version__}
    if output.json:
        write_stdout(json.dumps(shown, indent=1) + "\n")
    else:
        write_stdout("".join(f"{name} {version}\n" for name, version in shown.items()))
