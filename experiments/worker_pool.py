"""Processes that share work and end with the one that started them, however it ends.

An executor's workers wait for their next task in a queue. Of a parent that is killed (kill -9, out of memory) they hear
nothing, and would wait, or work, for ever. So each has a thread that waits for the parent's end, on every system.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.connection import wait
from typing import Any

ORPHANED = 1  # exit status of a worker whose parent is gone


def worker_pool(jobs: int) -> ProcessPoolExecutor:
    """``jobs`` worker processes; a context manager, as any executor.

    They are spawned: a forked one would share locks that its parent's threads hold. A main module that uses it must
    guard its main part by ``if __name__ == "__main__"``.
    """
    return ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"), initializer=end_with_parent)


def end_with_parent() -> None:
    """Let this process end when the one that started it is gone; in a process that nobody started so: do nothing."""
    parent: Any = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_wait_and_end, args=(parent.sentinel,), daemon=True).start()


def _wait_and_end(sentinel: int) -> None:
    wait([sentinel])
    os._exit(ORPHANED)  # no manners: whoever would take the result is gone
