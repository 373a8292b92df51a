"""Whichever way the process ends, somebody calls stop first.

Covered here: SIGTERM, SIGINT and SIGHUP, the interpreter's exit, and a parent that is gone. What no code of a process
can catch (kill -9, a hang, a power cut of the computer) is the watchdog's and the drive's own (``watchdog.py``).
"""

from __future__ import annotations

import atexit
import os
import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Shutdown:
    """Calls ``stop`` (which may be called again and must not raise) before the process ends."""

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self._process, self._parent = os.getpid(), os.getppid()
        self._before: dict[int, Any] = {}

    def install(self) -> None:
        """Listen to signals (only a main thread can) and to the interpreter's exit."""
        atexit.register(self._at_exit)
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                self._before[number] = signal.signal(number, self._handle)

    def remove(self) -> None:
        """Give the signals back to whoever had them."""
        atexit.unregister(self._at_exit)
        for number, before in self._before.items():
            signal.signal(number, before if before is not None else signal.SIG_DFL)
        self._before = {}

    @property
    def orphaned(self) -> bool:
        """Whether the process that started this one is gone."""
        return os.getppid() != self._parent

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self._at_exit()
        before = self._before.get(number)
        if callable(before):
            before(number, frame)  # Python's own raises KeyboardInterrupt for SIGINT
        elif before != signal.SIG_IGN:
            raise SystemExit(128 + number)

    def _at_exit(self) -> None:
        if os.getpid() == self._process:  # a forked child inherits the handlers, not the motor
            self._stop()
