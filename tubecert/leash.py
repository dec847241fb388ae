"""A process that does not outlive the one that started it, however that ends.

In: the number of a process. Out: nothing. Trusted: yes; it decides nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import threading
import time
from typing import Final

_WITH_PARENT: Final = 1  # PR_SET_PDEATHSIG
_LOOK: Final = 1.0  # s


def follow(parent: int) -> None:
    """Has this process killed when its parent ends: at once on Linux, elsewhere when Python looks up next."""
    if not hasattr(os, "fork"):
        return
    with contextlib.suppress(OSError, AttributeError):
        if ctypes.CDLL(None).prctl(_WITH_PARENT, signal.SIGKILL) == 0 and os.getppid() == parent:
            return
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os.kill(os.getpid(), signal.SIGKILL)
