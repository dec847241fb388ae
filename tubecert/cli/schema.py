"""`schema`: the JSON Schemas, for editors and other programs."""

from __future__ import annotations

from importlib import resources

from tubecert.cli.guard import write_stdout


def run(name: str) -> None:
    """Show a schema."""
    schema = resources.files("tubecert") / "schemas" / f"{name}.schema.json"
    write_stdout(schema.read_text(encoding="utf-8"))
