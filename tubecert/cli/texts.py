"""`schema`, `explain`, `version`: texts of tubecert's own, about itself."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import resources
from typing import Final

from tubecert.asking import Choice, Text
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout
from tubecert.errors import SpecError
from tubecert.expression import near
from tubecert.findings import Finding
from tubecert.libraries import versions
from tubecert.printable import json_text
from tubecert.release import __version__
from tubecert.report import pages

SCHEMAS: Final = ("spec", "metric", "certificate", "sampled-loop")
_NAME: Final = Choice("Of what.", "|".join(SCHEMAS), words=SCHEMAS, place=True, optional=True)
_TOPIC: Final = Text("A code, a constant or an equation.", "TOPIC", place=True, optional=True)


@command({"name": _NAME}, shared=("debug",))
def schema(how: Output, name: str = "spec") -> None:
    """Show a JSON Schema: of specifications (for editors), of metric files, of certificates, of those with hardware."""
    file = resources.files("tubecert") / "schemas" / f"{name}.schema.json"
    write_stdout(file.read_text(encoding="utf-8"))


@command({"topic": _TOPIC}, shared=("debug",))
def explain(how: Output, topic: str | None = None) -> None:
    """Explain a finding code, a constant or an equation; without a topic, list all that there are."""
    if topic is None:
        write_stdout("\n".join(_index()) + "\n")
        return
    page = pages.find(topic)
    if page is None:
        meant = near(topic, pages.topics()) if topic.isascii() else ()
        help = "".join(f"did you mean {word}? " for word in meant) + "tubecert explain lists all topics"
        raise SpecError([Finding(code="TC112", message=f"there is no page about {topic[:60]!r}", help=help)])
    write_stdout(page.text() + "\n")


def _index() -> Iterator[str]:
    yield "Words of reports"
    yield from (f"  {word:<16} {page.title}" for word, page in pages.words().items())
    yield "\nFinding codes"
    yield from (f"  {code}  {page.title}" for code, page in pages.codes().items())
    yield "\nConstants (by name or symbol)"
    yield from (f"  {name:<20} {page.symbol:<14} {page.title}" for name, page in pages.constants().items())
    yield "\nEquations"
    yield from (f"  {tag:<20} {page.title}" for tag, page in pages.equations().items())


@command({})
def version(how: Output) -> None:
    """Show the version; with -v, also those of Python and of the libraries that results rest on."""
    shown = versions() if how.verbose or how.json else {"tubecert": __version__}
    if how.json:
        write_stdout(json_text(shown))
    else:
        write_stdout("".join(f"{name} {own}\n" for name, own in shown.items()))
