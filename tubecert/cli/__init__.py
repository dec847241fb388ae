"""The command line: argv in, exit code out; no mathematics.

In: arguments. Out: a report on stdout, findings and progress on stderr, a certificate file, an exit code.
Until a command is called, nothing but typer and the error family is imported: `--help` is to feel instant.

| module | what it does |
|---|---|
| `process`, `keeper` | signals, exit codes, a command that can be ended at any moment |
| `telling` | what a command tells by then, and shows at the end |
| `app`, `adapter` | questions and their words as commands; the options that all share |
| `guard` | every way a command can end -> one exit code and no traceback |
| `certify`, `check`, ... | commands that do more than show what the library gives |
"""


def main() -> None:
    """The entry point. It imports the rest itself: from its first line on an interruption has its exit code.

    It does not return: the process ends here, with a code that is one of ours.
    """
    code, line = 3, ""  # ExitCode.INTERNAL: what is not imported yet cannot fail
    try:
        from tubecert.cli import process

        process.prepare()
        from tubecert.cli import keeper

        code = keeper.kept(_work)
    except KeyboardInterrupt as stop:
        code, line = 130, str(stop) or "interrupted"  # ExitCode.INTERRUPTED; `leave` knows the signal
    except BaseException as error:
        line = f"internal error: {type(error).__name__}: {str(error)[:200]!a}"
    from tubecert.cli import process

    if line:
        process.say(f"tubecert: {line}")
    process.leave(code)


def _work() -> int:
    from tubecert.cli.app import start

    return start()
