"""A command works in a process of its own that can be ended at any moment; the one that was started keeps what it told.

A solver, a compiler, a power of a polynomial of a million terms: what does not look up cannot be interrupted, only be
ended from outside. So a command works in a fork. It tells where it is, what it found and what it would leave if it came
to no more (`tell`). After a signal, or once its time is up, it has a second to end by itself; then it is killed, and
what it told is shown and written here. Where there is no fork (Windows) it is interrupted between its steps only.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Mapping
from math import inf
from types import FrameType
from typing import Final, TypedDict

from tubecert.cli.process import SIGNALS, hear, say

GRACE: Final = 1.0  # s to end by itself
_TICK: Final = 0.1  # s between looks whether it has ended
_SHOWN: Final = 20  # lines of what was found
_INTERNAL, _UNDECIDED = 3, 4  # as in `errors.ExitCode`, which is not imported here
_WHY: Final[Mapping[int | None, str]] = {None: "undecided: the time was up", signal.SIGINT: "interrupted"}
_READING: Final = "reading what it was given"
_SHORTER: Final = (
    "more time; powers of sums grow when they are multiplied out: fewer factors, or a shorter table"
)


class Will(TypedDict):
    """What is left if nothing better is found: files by their names, what is said on stdout, the exit code."""

    files: Mapping[str, str]
    said: str
    code: int


class News(TypedDict, total=False):
    """What a command tells: where it is and what to do about it, what it found, its will, that it said all itself.

    It has so many `seconds`, and is `interrupted` then if it does not look at the time.
    """

    at: str
    next: str
    found: str
    will: Will
    said: bool
    seconds: float
    interrupted: bool


_place: list[int] = []  # where a command tells, in its process
_began = time.monotonic()


def kept(work: Callable[[], int]) -> int:
    """The exit code of a command that works in a fork, whether it ends by itself or is ended."""
    if not hasattr(os, "fork"):
        return work()
    keeper, (heard, told) = os.getpid(), os.pipe()
    process = os.fork()
    if process == 0:
        os.close(heard)
        _begin(told, keeper)
        return work()
    os.close(told)
    os._exit(Keeper(process, heard).wait())  # what is registered for the end is the fork's


def told_to() -> bool:
    """Whether somebody keeps what is told."""
    return bool(_place)


def tell(news: News) -> None:
    """Tells it. A signal waits until it is told as a whole."""
    if not _place:
        return
    data = json.dumps(news).encode() + b"\n"
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        while data:
            data = data[os.write(_place[0], data) :]
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def left_of(seconds: float, *, interrupted: bool = False) -> float:
    """How many of the seconds that a command was given since it was started are left, at least 1 ms; then it is ended.

    `interrupted`: it does not look at the time itself.
    """
    tell({"seconds": seconds, "interrupted": interrupted})
    return max(1e-3, seconds - (time.monotonic() - _began)) if told_to() else seconds


class Keeper:
    """Waits for a process, passes signals on to it, and keeps what it tells."""

    def __init__(self, process: int, heard: int) -> None:
        self.process, self.heard = process, heard
        self.buffer = b""
        self.at, self.next, self.found = _READING, _SHORTER, list[str]()
        self.will: Will | None = None
        self.said = self.over = self.killed = False
        self.asked: int | None = None  # the signal
        # when it is killed, when its time is up, when it is interrupted
        self.end = self.time = self.alarm = inf

    def wait(self) -> int:
        """The exit code."""
        hear(self._pass_on)
        status: int | None = None
        while status is None:
            self._hear()
            process, found = os.waitpid(self.process, os.WNOHANG)
            status = found if process else None
            if status is None and time.monotonic() > self.alarm:
                os.kill(self.process, signal.SIGALRM)
                self.alarm = inf
            if status is None and time.monotonic() > self.end:
                os.kill(self.process, signal.SIGKILL)
                self.killed, self.end = True, inf
        self.over = True
        while self._hear():
            pass
        return self._ended(os.waitstatus_to_exitcode(status))

    def _pass_on(self, number: int, frame: FrameType | None) -> None:
        del frame
        if not self.over:
            os.kill(self.process, number)
        if self.asked is None:
            self.asked, self.end = number, min(self.end, time.monotonic() + GRACE)

    def _hear(self) -> bool:
        """Reads what was told; whether there may be more."""
        ready, _, _ = select.select([self.heard], [], [], 0 if self.over else _TICK)
        data = os.read(self.heard, 1 << 20) if ready else b""
        if ready and not data and not self.over:
            time.sleep(_TICK / 10)  # it told its last word, and ends
        *whole, self.buffer = (self.buffer + data).split(b"\n")
        for line in whole:
            self._note(json.loads(line))
        return bool(data)

    def _note(self, news: News) -> None:
        self.at, self.next = news.get("at", self.at), news.get("next", self.next)
        self.will, self.said = news.get("will", self.will), news.get("said", self.said)
        if "found" in news:
            self.found.append(news["found"])
        if "seconds" in news:
            self.time = _began + news["seconds"]
            self.end = min(self.end, self.time + GRACE)
            self.alarm = self.time if news.get("interrupted") else inf

    def _ended(self, code: int) -> int:
        """What is left to be said and written; the exit code."""
        asked = None if self.asked is None else 128 + self.asked
        if self.killed:
            return self._instead(asked)
        if code < 0:
            say(
                f"tubecert: internal error: the process that worked was killed ({signal.Signals(-code).name})"
            )
            say("  perhaps for lack of memory: less work at a time needs less")
            self._account()
            return _INTERNAL
        late = code == _UNDECIDED and time.monotonic() > self.time
        if not self.said and (code == asked or late):
            left = self._left(code)
            self._account()
            return left if late else code
        return code

    def _instead(self, asked: int | None) -> int:
        """Carries out the will of what was killed."""
        if sys.stderr is not None and sys.stderr.isatty():
            sys.stderr.write("\r\x1b[K\x1b[?25h")  # the line of a bar goes, the cursor comes back
        code = self._left(_UNDECIDED)
        say(f"tubecert: {_WHY.get(self.asked, 'terminated')}")
        self._account()
        return code if asked is None else asked

    def _left(self, code: int) -> int:
        """The exit code, after what is left was written: that of the will, if there is one."""
        return code if self.will is None or self.said else self._carried_out(self.will)

    def _carried_out(self, will: Will) -> int:
        from pathlib import Path

        from tubecert.files import replace

        try:
            for name, data in will["files"].items():
                replace(Path(name), data.encode())
        except OSError as error:
            say(f"tubecert: cannot write {name!a}: {error.strerror}")
            return _INTERNAL
        if sys.stdout is not None:
            with contextlib.suppress(OSError, ValueError):
                sys.stdout.write(will["said"])
                sys.stdout.flush()
        return will["code"]

    def _account(self) -> None:
        """Where it was, what it found, and what to do."""
        say(f"  after {time.monotonic() - _began:.0f} s, {self.at}")
        if self.found:
            before = len(self.found) - _SHOWN
            say("  until then:" + (f" ({before} before these)" if before > 0 else ""))
        for line in self.found[-_SHOWN:]:
            say(f"    {line}")
        say(f"  next: {self.next}")


def _begin(place: int, keeper: int) -> None:
    """In the fork: tells there, and does not outlive who keeps it."""
    from tubecert.leash import follow

    _place.append(place)
    follow(keeper)
