"""`schema`: the JSON Schemas, for editors and other programs."""

from __future__ import annotations

from typing import Final

from tubecert.asking import Choice
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout

SCHEMAS: Final = ("spec", "metric", "certificate", "sampled-loop")
_NAME: Final = Choice("Of what.", "|".join(SCHEMAS), words=SCHEMAS, place=True, optional=True)


@command({"name": _NAME}, shared=("debug",))
def schema(how: Output, name: str = "spec") -> None:
    """Show a JSON Schema: of specifications (for editors), of metric files, of certificates, of those with hardware."""
    from importlib import resources

    file = resources.files("tubecert") / "schemas" / f"{name}.schema.json"
    write_stdout(file.read_text(encoding="utf-8"))
