"""`schema`: the JSON Schemas, for editors and other programs. `version`: what runs, and what results rest on."""

from __future__ import annotations

from typing import Final

from tubecert.asking import Choice
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout

SCHEMAS: Final = ("spec", "metric", "certificate", "sampled-loop")
_SCHEMA_AFTER = """\b
Example:
  tubecert schema spec > spec.schema.json
and, as the first line of a specification:
  # yaml-language-server: $schema=spec.schema.json
"""
_VERSION_AFTER = """\b
Example:
  tubecert version --json
"""
_NAME: Final = Choice("Of what.", "|".join(SCHEMAS), words=SCHEMAS, place=True, optional=True)


@command({"name": _NAME}, short="Show the JSON Schemas.", after=_SCHEMA_AFTER, shared=("debug",))
def schema(how: Output, name: str = "spec") -> None:
    """Show a JSON Schema: of specifications (for editors), of metric files, of certificates, of those with hardware."""
    from importlib import resources

    file = resources.files("tubecert") / "schemas" / f"{name}.schema.json"
    write_stdout(file.read_text(encoding="utf-8"))


@command({}, short="Show the version.", after=_VERSION_AFTER)
def version(how: Output) -> None:
    """Show the version; with -v, also those of Python and of the libraries that results rest on."""
    import json

    from tubecert.libraries import versions
    from tubecert.release import __version__

    shown = versions() if how.verbose or how.json else {"tubecert": __version__}
    if how.json:
        write_stdout(json.dumps(shown, indent=1) + "\n")
    else:
        write_stdout("".join(f"{name} {own}\n" for name, own in shown.items()))
