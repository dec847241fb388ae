"""Every way a command can end, as one exit code: findings for the user, a log for us, no traceback."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

import typer

from tubecert.cli.process import say
from tubecert.errors import ExitCode, ProcessorError, TargetError, TubecertError
from tubecert.printable import printable_lines

if TYPE_CHECKING:
    from pathlib import Path

    from tubecert.cli.adapter import Output


@contextlib.contextmanager
def guarded(output: Output) -> Iterator[None]:
    """Turns whatever the block raises into `typer.Exit` with the right code, having told the user."""
    try:
        yield
    except typer.Exit:
        raise
    except TubecertError as error:
        show(error, output)
        raise typer.Exit(error.exit_code) from None
    except KeyboardInterrupt as stop:
        _tell(str(stop) or "interrupted")
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    except ProcessorError as error:
        _tell(str(error))
        raise typer.Exit(ExitCode.INTERNAL) from None
    except MemoryError as error:
        if output.debug:
            raise
        _tell(_no_memory(error))
        raise typer.Exit(ExitCode.INTERNAL) from None
    except BaseException as error:  # a library's `sys.exit` as well: it knows nothing of verdicts
        if output.debug:
            import traceback

            traceback.print_exc()
        _tell(_defect(error))
        raise typer.Exit(ExitCode.INTERNAL) from None


def show(error: TubecertError, output: Output) -> None:
    """The findings of an error on stderr."""
    from tubecert.report.findings import render
    from tubecert.report.terminal import Terminal

    Terminal.stderr(color=output.color).show(render(error.findings))


def refuse_usage(error: Any) -> int:
    """Tells what is wrong with the command line (an exception of click); the exit code."""
    from io import StringIO

    text = StringIO()
    error.show(file=text)
    said = text.getvalue().replace("Value error, ", "")  # jargon of a library
    say(printable_lines(said + usage_hint(error, sys.argv[1:])).rstrip("\n"))
    return int(error.exit_code)


def usage_hint(error: Exception, words: Sequence[str]) -> str:
    """What may have been meant by a command line that is refused, as a line; empty if nothing is known."""
    from tubecert.cli.adapter import said

    option = str(getattr(error, "option_name", ""))
    for word in words if len(option) == 2 else ():
        if word.startswith(option) and len(word) > 2 and word[1:].split("=")[0].replace("-", "").isalpha():
            return f"  {word} is read as single letters; options of several begin with two dashes: -{word}\n"
    if known := said().gone.get(words[0] if words else "") or said().options.get(option):
        return f"  {known}\n"
    message = str(getattr(error, "message", ""))
    if not option and "unexpected" in message and (unit := _UNIT.search(message)):
        return f"  a number has no unit: leave {unit[1]} out; times are in s, rates in 1/s, --bandwidth in rad/s\n"
    if not option and "unexpected" in message:
        return "  one specification at a time; tubecert check takes several, and folders\n"
    return ""


_UNIT: Final = re.compile(r"\) \((rad/s|1/s|Hz|kHz|s|ms|m|rad|deg|sec)\)")


def write_stdout(text: str) -> None:
    """Writes the result; a reader that has gone (`| head`) is no error, a full disk is one.

    Raises `TargetError`.
    """
    if sys.stdout is None:  # closed by the caller (`>&-`)
        return
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        _drop_stdout()
    except OSError as error:
        _drop_stdout()
        from tubecert.findings import Finding

        raise TargetError(
            [Finding(code="TC120", message=f"cannot write to stdout: {_reason(error)}")]
        ) from None


def flush_stdout() -> int:
    """Writes what is left in the buffer of stdout; the exit code that a failure leads to, else 0."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        return stdout_failed(error)
    return 0


def stdout_failed(error: OSError) -> int:
    """Tells why stdout takes nothing more (not if its reader has gone); the exit code."""
    _drop_stdout()
    if isinstance(error, BrokenPipeError):
        return 0
    _tell(f"error TC120: cannot write to stdout: {_reason(error)}")
    return ExitCode.INVALID


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


def _drop_stdout() -> None:
    """Sends what may still be in the buffer to nowhere: Python would complain about it at exit."""
    with contextlib.suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


def _tell(text: str) -> None:
    say(printable_lines(f"tubecert: {text}"))


def _no_memory(error: MemoryError) -> str:
    what = " ".join(str(error).split())[:200]
    line = "internal error: out of memory" + (f": {what}" if what else "")
    return f"{line}\n  less work at a time needs less: --jobs 1, a smaller --budget, a wider --gap; --debug shows where"


def _defect(error: BaseException) -> str:
    """The one line about an unexpected exception, having written its log."""
    what = " ".join(str(error).split())[:200]
    line = f"internal error: {type(error).__name__}" + (f": {what}" if what else "")
    log = _write_log(error)
    where = f"details are in {log}" if log else "no log could be written; --debug shows the details"
    return f"{line}\n  this is a defect of tubecert, not of your input; {where}"


def _write_log(error: BaseException) -> Path | None:
    import platform
    import tempfile
    import time
    import traceback
    from pathlib import Path

    from tubecert.release import __version__

    head = f"tubecert {__version__}, Python {platform.python_version()}, {platform.system()}"
    text = f"{head}\narguments: {sys.argv[1:]}\n{''.join(traceback.format_exception(error, limit=-60))}"
    home = os.environ.get("HOME")
    state = os.environ.get("XDG_STATE_HOME") or (home and f"{home}/.local/state")
    for folder in (*([f"{state}/tubecert"] if state else []), tempfile.gettempdir()):
        path = Path(folder) / f"tubecert-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", errors="backslashreplace")
            return path
    return None
