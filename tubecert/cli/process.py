"""The process of a command: how it can be ended from outside, and that its exit code is always ours.

A shell and a workflow read 1 as *refuted*. Others end processes with 1 as well: Python after an exception that nobody
caught, the C library when a library calls `exit(1)` (OpenBLAS does so when it gets no memory). So a command ends with
`os._exit` and the code that it decided on, and a call of `exit` by anybody else becomes an internal error (3).
"""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

_INTERNAL, _UNDECIDED, _INTERRUPTED = 3, 4, 130  # as in `errors.ExitCode`, which is not imported yet
_ALARM = getattr(signal, "SIGALRM", None)  # sent where the time is up
# what asks for an end: what is half written is removed, then 128 + the signal's number
_ASKING = (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", None), _ALARM)
SIGNALS = tuple(number for number in _ASKING if number is not None)
# mallopt(3): the environment's name, the option's number, bytes
_KEPT = (("MALLOC_MMAP_THRESHOLD_", -3, 32 << 20), ("MALLOC_TRIM_THRESHOLD_", -1, 256 << 20))
_ENDED = b"tubecert: internal error: a library ended the process, perhaps for lack of memory"
_WORDS = {signal.SIGINT: "interrupted", _ALARM: "undecided: the time was up"}
_CODES = {_ALARM: _UNDECIDED}

_received: list[int] = []


class Terminated(KeyboardInterrupt):
    """The process was asked to end."""


def prepare() -> None:
    """Signals that ask for an end are treated as an interruption is; a library cannot decide on the exit code.

    Memory that is freed stays with the process.
    """
    hear(interrupt)
    with contextlib.suppress(ImportError, OSError, AttributeError, MemoryError):
        _watch_exits()
        keep_memory()


def hear(handler: Callable[[int, FrameType | None], None]) -> None:
    """Calls it for every signal that asks for an end and is not ignored, as nohup ignores SIGHUP."""
    for number in SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


def interrupt(number: int, frame: FrameType | None) -> None:
    """Once: a process group and who waits for it may each pass on the same wish."""
    del frame
    _received.append(number)
    if len(_received) == 1:
        raise Terminated(_WORDS.get(number, "terminated"))


def _watch_exits() -> None:
    """Whoever calls `exit` of the C library ends the process with an internal error (see `leave` for who does not).

    The C library itself does it, in reverse order of registration: Python may be in any state by then.
    """
    import ctypes

    library = ctypes.CDLL(None)
    nothing = ctypes.c_void_p(None)
    register = library["__cxa_atexit"]
    register(library["_exit"], ctypes.c_void_p(_INTERNAL), nothing)
    register(library["perror"], _ENDED, nothing)


def keep_memory() -> None:
    """What is freed is kept for what comes next: arrays of up to 32 MB, 256 MB in all, unless the user says otherwise.

    Branch and bound frees and asks for the same megabytes again and again. The C library would hand them back, and the
    system clear each page that is asked for anew: a fifth of the time of nine states. Processes that are started read
    it from their environment.
    """
    import ctypes

    library = ctypes.CDLL(None)
    for name, option, size in _KEPT:
        if name not in os.environ:
            library.mallopt(option, size)
            os.environ[name] = str(size)


def say(line: str) -> None:
    """A line on stderr, if there is one that takes it."""
    if sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):
            print(line, file=sys.stderr, flush=True)


def leave(code: int) -> NoReturn:
    """Ends the process: what was registered for the end is done, what is buffered is written, then nothing else."""
    try:
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                with contextlib.suppress(OSError, ValueError):
                    stream.flush()
    except BaseException:
        code = code or _INTERNAL
    finally:
        os._exit(_CODES.get(_received[0], 128 + _received[0]) if _received and code == _INTERRUPTED else code)
