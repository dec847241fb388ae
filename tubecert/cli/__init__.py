"""The command line: argv in, exit code out; no mathematics.

In: arguments. Out: a report on stdout, findings and progress on stderr, a certificate file, an exit code.
Until a command runs, nothing but typer and the error family is imported: `--help` is to feel instant.

| module | what it does |
|---|---|
| `app` | the commands and their options |
| `options` | the options that every command shares; numbers from the command line |
| `targets`, `places` | files that commands write; places on the command line |
| `guard`, `presenting` | every way a command can end -> one exit code and no traceback; reports or data |
| `everyday`, `synthesising`, `simulating` | commands beside certify: their options |
| `certify`, `check`, `simulate`, `version`, ... | what each command does |
"""

import sys


def main() -> None:
    """The entry point. It imports the rest itself: from its first line on an interruption has its exit code."""
    try:
        from tubecert.cli.app import start

        start()
    except KeyboardInterrupt:
        if sys.stderr is not None:
            print("tubecert: interrupted", file=sys.stderr)
        sys.exit(130)  # ExitCode.INTERRUPTED: what is not imported cannot be interrupted
