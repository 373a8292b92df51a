"""A second process that may do one thing: send zero torque and drop the drive when the control process fails.

    watchdog = Watchdog("senso_wheel", {}, {"interface": "socketcan", "channel": "can0"})
    watchdog.start()
    watchdog.watch(True)     # from now on a beat is due every few ms
    watchdog.beat()          # in every control cycle
    watchdog.close()

It has its own handle of the bus and its own codec, so nothing that hangs in the control process can hold it up. It acts
when beats stop while it is told to watch, at once when the control process is gone (its end of a pipe closes, however
it died), and when it is terminated itself. ``fired`` and ``alive`` are for the control process: one that was only
stalled must not go on, and none may go on without its watchdog. Shared memory is a mapped file, as on every system.
"""

from __future__ import annotations

import json
import mmap
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, cast

from steer_env.errors import InputError
from steer_env.rig import motors
from steer_env.rig.bus import Link, open_bus
from steer_env.rig.motors.motor import Motor

STALL = 0.02  # s without a beat that count as a stall: the drive must not keep a torque for longer
LOOK = 0.001  # s between two looks
STOP_EVERY, STOP_FOR = 0.005, 0.5  # s: how often and for how long the drive is told to stop
DEAD = 0.25  # s without a sign of life of the watchdog
URGENCY = 10  # of 99 among real-time processes
START_TIMEOUT = 20.0  # s, most of it imports
BEATS, WATCH, FIRED, SIGNS = range(4)  # cells of the shared memory, 8 bytes each
READY = b"ready, "  # and the priority that the system granted


class Cells:
    """Counters that two processes share: a mapped file of 8-byte numbers."""

    def __init__(self, path: str) -> None:
        with open(path, "r+b") as file:
            self._map = mmap.mmap(file.fileno(), 8 * 8)
        self._numbers = memoryview(self._map).cast("Q")

    def __getitem__(self, cell: int) -> int:
        return self._numbers[cell]

    def __setitem__(self, cell: int, value: int) -> None:
        self._numbers[cell] = value

    def close(self) -> None:
        """Let go of the memory."""
        self._numbers.release()
        self._map.close()


class Watchdog:
    """The control process's side. ``motor`` and ``options`` name the drive, ``bus`` are arguments of ``open_bus``."""

    def __init__(self, motor: str, options: dict[str, Any], bus: dict[str, Any], stall: float = STALL) -> None:
        self._task = {"motor": motor, "options": options, "bus": bus, "stall": stall}
        self._process: subprocess.Popen[bytes] | None = None
        self._cells: Cells | None = None
        self._path = ""
        self.priority = ""  # what the system granted it, once it runs
        self._sign, self._sign_at = 0, 0.0

    def start(self) -> None:
        """Start the process and wait until it has opened the bus; raises InputError where it cannot."""
        handle, self._path = tempfile.mkstemp(prefix="steer-env-watchdog-")
        os.write(handle, bytes(8 * 8))
        os.close(handle)
        self._cells = Cells(self._path)
        command = [sys.executable, "-m", "steer_env.rig.watchdog", self._path, json.dumps(self._task)]
        # A session of its own: Ctrl-C in the terminal must not reach the one who has to clean up.
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
        )
        first = self._first_line()
        if not first.startswith(READY):
            assert self._process.stderr is not None
            self._process.kill()
            said = self._process.stderr.read().decode(errors="replace").strip().splitlines()
            self.close()
            raise InputError(
                "watchdog",
                f"does not start: {said[-1] if said else 'no answer'}",
                "a bus that only one process can open needs watchdog=False: then the drive's own is all there is",
            )
        self.priority = first.removeprefix(READY).decode().strip()
        self._sign, self._sign_at = self._cells[SIGNS], time.monotonic()

    @property
    def pid(self) -> int:
        """Process id, 0 when it does not run."""
        return self._process.pid if self._process else 0

    def watch(self, on: bool) -> None:
        """From now on a beat is due (or no more); forgets that it fired."""
        if self._cells is not None:
            self._cells[BEATS] += 1
            self._cells[FIRED] = 0
            self._cells[WATCH] = int(on)

    def beat(self) -> None:
        """The control process is well."""
        if self._cells is not None:
            self._cells[BEATS] += 1

    @property
    def fired(self) -> bool:
        """Whether it has dropped the drive since it was started."""
        return self._cells is not None and self._cells[FIRED] != 0

    @property
    def alive(self) -> bool:
        """Whether it has given a sign of life in the last quarter of a second."""
        if self._cells is None:
            return False
        now, sign = time.monotonic(), self._cells[SIGNS]
        if sign != self._sign:
            self._sign, self._sign_at = sign, now
        return now - self._sign_at < DEAD

    def close(self) -> None:
        """End it in peace: the drive has been brought down by then."""
        self.watch(False)
        process, self._process = self._process, None
        if process is not None:
            for pipe in (process.stdin, process.stdout, process.stderr):
                if pipe is not None:
                    pipe.close()  # the end of stdin ends it
            try:
                process.wait(STOP_FOR + 2.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if self._cells is not None:
            self._cells.close()
            self._cells = None
            Path(self._path).unlink(missing_ok=True)

    def _first_line(self) -> bytes:
        """What the process says first, b"" if nothing in START_TIMEOUT; a thread reads, as not every pipe can wait."""
        assert self._process is not None
        lines: list[bytes] = []
        out: Any = self._process.stdout
        reader = threading.Thread(target=lambda: lines.append(out.readline()), daemon=True)
        reader.start()
        reader.join(START_TIMEOUT)
        return lines[0] if lines else b""


def guard(cells: Cells, gone: threading.Event, link: Link, motor: Motor, stall: float) -> None:
    """Look until the control process is gone; stop the drive if it stalls or dies while it should beat."""
    beats, beaten_at = cells[BEATS], time.monotonic()
    while not gone.wait(LOOK):
        cells[SIGNS] += 1
        now = time.monotonic()
        if cells[BEATS] != beats or not cells[WATCH]:
            beats, beaten_at = cells[BEATS], now
        elif now - beaten_at > stall:
            cells[FIRED] = 1
            stop(cells, link, motor)
            beats, beaten_at = cells[BEATS], time.monotonic()
    if cells[WATCH]:
        cells[FIRED] = 1
        stop(cells, link, motor)


def stop(cells: Cells, link: Link, motor: Motor) -> None:
    """Tell the drive to stop, over and over: a frame may be lost, and a stalled program may wake up in between."""
    until = time.monotonic() + STOP_FOR
    while time.monotonic() < until:
        for frame in motor.stop_frames():
            link.send(frame)
        cells[SIGNS] += 1
        time.sleep(STOP_EVERY)


def _await_end(gone: threading.Event) -> None:
    sys.stdin.buffer.read()  # until the control process closes it, or is no more
    gone.set()


def be_urgent() -> str:
    """Ask to run before everything else on the computer; what was granted: "real time", "before others" or "as others".

    A crowded computer must not be what keeps a torque on. Nothing here spins, so the rest of it goes on all the same.
    """
    try:
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK  # what this thread starts is not urgent
        os.sched_setscheduler(0, policy, os.sched_param(URGENCY))
    except (AttributeError, OSError):  # another system; or not allowed (root, or an rtprio limit, may)
        try:
            os.setpriority(os.PRIO_PROCESS, 0, -10)
        except (AttributeError, OSError):
            return "as others"
        return "before others"
    return "real time"


def main(path: str, task: dict[str, Any]) -> None:
    """Be the watchdog's process."""
    # python-can would load MF4 logging, and with it pandas: seconds in which nobody watches, for nothing.
    sys.modules.setdefault("asammdf", cast(Any, None))
    cells, gone = Cells(path), threading.Event()
    # Terminated itself, it acts as if the control process were gone: nobody would watch any more.
    signal.signal(signal.SIGTERM, lambda number, frame: gone.set())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with open_bus(**task["bus"]) as link:
        motor = motors.make(task["motor"], **task["options"])
        granted = be_urgent()
        threading.Thread(target=_await_end, args=(gone,), daemon=True).start()
        sys.stdout.buffer.write(READY + f"{granted}\n".encode())
        sys.stdout.buffer.flush()
        guard(cells, gone, link, motor, task["stall"])


if __name__ == "__main__":
    main(sys.argv[1], json.loads(sys.argv[2]))
