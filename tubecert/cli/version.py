"""`version`: what runs, and what results rest on."""

from __future__ import annotations

from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout


@command({})
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
