"""A command of the program, in the process of the test."""

from typing import Any

from click.testing import Result
from typer.testing import CliRunner

from tubecert.cli.app import app


def run(*arguments: object, **options: Any) -> Result:
    """What became of it: its exit code, and what it said."""
    return CliRunner().invoke(app, [*map(str, arguments)], prog_name="tubecert", **options)
