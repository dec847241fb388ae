"""The libraries: which of them a result can depend on, which only run or show it.

What runs is recorded with every certificate, and names what a cache keeps; both read it here.
"""

from __future__ import annotations

import platform
from importlib import metadata
from typing import Final

from tubecert.release import __version__

DECIDING: Final = (
    "numpy",
    "scipy",
    "clarabel",
    "cvxpy",
    "pyyaml",
    "python-flint",
)
RUNNING: Final = ("distributed",)  # decides who computes, never what
SHOWING: Final = ("typer", "rich", "jinja2", "matplotlib")


def versions() -> dict[str, str]:
    """Versions of tubecert, Python and the libraries that a result can depend on, as far as installed."""
    found = {"tubecert": __version__, "python": platform.python_version()}
    for name in DECIDING:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
