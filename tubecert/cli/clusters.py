"""`--scheduler`: the option; what is at its address is for `library.workers` to say."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import typer

Scheduler: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Work on a running Dask cluster (extra: tubecert[cluster])."),
]
