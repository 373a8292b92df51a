"""Workers of a pool do their work, and none outlives a parent that was killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.worker_pool import worker_pool

ROOT = Path(__file__).resolve().parents[2]
PARENT = """
import os, sys, time
sys.path.insert(0, {folder!r})
from experiments.worker_pool import worker_pool
from pool_tasks import busy

if __name__ == "__main__":
    with worker_pool(2) as pool:
        tasks = [pool.submit(busy, {folder!r}, {idle!r}) for _ in range(2)]
        time.sleep(60.0)
"""
TASKS = """
import os, time
from pathlib import Path

def busy(folder, idle):
    Path(folder, f"{os.getpid()}.worker").touch()
    until = time.monotonic() + 60.0
    while not idle and time.monotonic() < until:
        pass
"""


def alive(pid):
    """Whether a process runs; one that has ended and that nobody waits for yet does not."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{pid}/stat")
    return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"


def eventually(condition, seconds=20.0):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.02)
    return False


def test_results_come_in_order():
    with worker_pool(2) as pool:
        assert list(pool.map(abs, (-3, 2, -1))) == [3, 2, 1]


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a signal that no process can catch")
@pytest.mark.parametrize("idle", [False, True], ids=["in the middle of a task", "waiting for one"])
def test_no_worker_outlives_a_parent_that_was_killed(tmp_path, idle):
    """Catches workers that wait in their queue for ever, or work on for nobody."""
    (tmp_path / "pool_tasks.py").write_text(TASKS)
    (tmp_path / "parent.py").write_text(PARENT.format(folder=str(tmp_path), idle=idle))
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    workers = []
    parent = subprocess.Popen([sys.executable, str(tmp_path / "parent.py")], env={**os.environ, "PYTHONPATH": path})
    try:
        assert eventually(lambda: len(list(tmp_path.glob("*.worker"))) >= (1 if idle else 2))
        time.sleep(0.3)
        workers = [int(file.stem) for file in tmp_path.glob("*.worker")]
        assert all(map(alive, workers))
    finally:
        parent.kill()
        parent.wait()
    try:
        assert eventually(lambda: not any(map(alive, workers)), 5.0), "a worker is still there"
    finally:
        for worker in filter(alive, workers):
            os.kill(worker, signal.SIGKILL)
