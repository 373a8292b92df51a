"""The second process stops the drive when the control process is killed, hangs, or the watchdog itself is ended.

Waiting is bounded generously: what is asserted is that it happens and in which order, never how fast.
"""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from steer_env.errors import InputError
from steer_env.rig import motors
from steer_env.rig.bus import Health, open_bus
from steer_env.rig.watchdog import BEATS, FIRED, SIGNS, WATCH, Cells, Watchdog, guard

can = pytest.importorskip("can")
pytest.importorskip("msgpack")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="python-can's udp_multicast is not there on Windows")
STOPS = [frame.key for frame in motors.make("senso_wheel").stop_frames()]
PATIENCE = 30.0  # s


class Sink:
    """A link that only remembers."""

    def __init__(self):
        self.sent = []

    def send(self, frame):
        self.sent.append(frame)
        return True


@pytest.fixture
def cells(tmp_path):
    path = tmp_path / "cells"
    path.write_bytes(bytes(64))
    made = Cells(str(path))
    yield made
    made.close()


def eventually(condition):
    until = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < until, "did not happen"
        time.sleep(0.002)


def guarding(cells, sink, stall):
    gone = threading.Event()
    thread = threading.Thread(target=guard, args=(cells, gone, sink, motors.make("senso_wheel"), stall), daemon=True)
    thread.start()
    return gone, thread


def test_it_keeps_quiet_while_beats_come_or_nobody_asked_it_to_watch(cells):
    sink = Sink()
    gone, thread = guarding(cells, sink, stall=5.0)
    for _ in range(50):
        time.sleep(0.002)
    cells[WATCH] = 1
    for _ in range(50):
        cells[BEATS] += 1
        time.sleep(0.002)
    cells[WATCH] = 0
    gone.set()
    thread.join()
    assert sink.sent == []
    assert cells[FIRED] == 0
    assert cells[SIGNS] > 0


@pytest.mark.parametrize("how", ["beats stop", "gone"])
def test_it_stops_the_drive_again_and_again(cells, how):
    sink = Sink()
    gone, thread = guarding(cells, sink, stall=0.05 if how == "beats stop" else 60.0)
    cells[WATCH] = 1
    if how == "gone":
        gone.set()
    eventually(lambda: len(sink.sent) > 3 * len(STOPS))
    assert cells[FIRED] == 1
    cells[WATCH] = 0
    gone.set()
    thread.join()
    assert {frame.key for frame in sink.sent} == set(STOPS)


CONTROL = """
import sys, time
from steer_env.rig.watchdog import Watchdog
dog = Watchdog("senso_wheel", {}, {"interface": "udp_multicast", "channel": "ff11::7079:51", "port": int(sys.argv[1])})
dog.start()
dog.watch(True)
print(dog.pid, flush=True)
while True:
    dog.beat()
    time.sleep(0.001)
"""
PORTS = iter(range(43951, 44000))  # one each: a watchdog goes on stopping for half a second


@pytest.fixture
def group():
    return {"interface": "udp_multicast", "channel": "ff11::7079:51", "port": next(PORTS)}


@pytest.fixture
def ears(group):
    try:
        bus = open_bus(**group)
    except InputError as error:
        pytest.skip(f"no multicast on this machine: {error}")
    with bus:
        yield bus


def hears_stop(bus):
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        received = bus.receive(0.1)
        if received is not None:
            return received.frame.key in STOPS
    return False


@pytest.mark.skipif(not hasattr(os, "sched_getscheduler"), reason="no such priorities on this system")
def test_it_runs_at_the_priority_that_it_tells(group):
    """A watchdog that says "real time" and is scheduled like all others would be late on a crowded computer."""
    dog = Watchdog("senso_wheel", {}, group)
    try:
        dog.start()
    except InputError as error:
        pytest.skip(f"no multicast on this machine: {error}")
    try:
        real_time = os.sched_getscheduler(dog.pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        before_others = os.getpriority(os.PRIO_PROCESS, dog.pid) == -10
    finally:
        dog.close()
    assert dog.priority == ("real time" if real_time else "before others" if before_others else "as others")


@pytest.mark.parametrize("how", ["kill -9 the control process", "stop the control process", "terminate the watchdog"])
def test_whatever_happens_to_a_process_the_drive_is_told_to_stop(ears, group, how):
    control = subprocess.Popen([sys.executable, "-c", CONTROL, str(group["port"])], stdout=subprocess.PIPE)
    try:
        watchdog = int(control.stdout.readline())
        assert ears.receive(0.0) is None  # nothing is sent while all is well
        if how.startswith("kill"):
            control.kill()
        elif how.startswith("stop"):
            control.send_signal(signal.SIGSTOP)
        else:
            os.kill(watchdog, signal.SIGTERM)
        assert hears_stop(ears)
    finally:
        control.kill()
        control.wait()
        control.stdout.close()


def test_it_ends_in_peace_and_leaves_nothing(ears, group):
    dog = Watchdog("senso_wheel", {}, group)
    assert not dog.alive
    assert not dog.fired
    dog.start()
    path, process = dog._path, dog._process
    dog.watch(True)
    dog.beat()
    dog.watch(False)
    assert dog.alive
    assert not dog.fired
    dog.close()
    dog.close()
    assert process.returncode == 0
    assert not os.path.exists(path)
    assert ears.receive(0.2) is None
    assert Health() == ears.health()


def test_a_bus_that_it_cannot_open_is_told_and_nothing_is_left_behind():
    dog = Watchdog("senso_wheel", {}, {"interface": "udp_multicast", "channel": "ff02::1"})
    with pytest.raises(InputError, match="leave this host"):
        dog.start()
    assert dog.pid == 0
    assert not dog.alive
