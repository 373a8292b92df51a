"""Stop is called before the process ends, whichever way it ends."""

import signal
import subprocess
import sys
import threading
import time

import pytest

from steer_env.rig.shutdown import SIGNALS, Shutdown

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
PROGRAM = """
import signal, sys, time
# Whoever runs the tests in the background (nohup) has these ignored, and children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from steer_env.rig.shutdown import Shutdown
shutdown = Shutdown(lambda: print("stopped", flush=True))
shutdown.install()
print("ready", flush=True)
how = sys.argv[1]
if len(sys.argv) > 2:
    open(sys.argv[2], "w").close()
if how == "exit":
    sys.exit(0)
if how == "exception":
    raise ZeroDivisionError
if how == "removed":
    shutdown.remove()
    sys.exit(0)
while not shutdown.orphaned:
    time.sleep(0.01)
print("orphaned", flush=True)
"""


def said_by(how, number=None):
    """What the program says after it was ready, and its exit status."""
    command = [sys.executable, "-c", PROGRAM, how]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as program:
        assert program.stdout.readline() == "ready\n"
        if number is not None:
            program.send_signal(number)
        end = threading.Timer(60.0, program.kill)  # a program that goes on must not hold the tests
        end.start()
        said = program.stdout.read()
        end.cancel()
    return said, program.returncode


@pytest.mark.parametrize(("how", "says"), [("exit", "stopped\n"), ("exception", "stopped\n"), ("removed", "")])
def test_the_ordinary_ends(how, says):
    assert said_by(how)[0] == says


@pytest.mark.parametrize("number", SIGNALS)
def test_signals_stop_and_then_end_the_process(number):
    said, status = said_by("wait", number)
    assert said.startswith("stopped\n")
    assert status in (128 + number, -number)


def test_a_parent_that_is_gone_is_noticed(tmp_path):
    ready = tmp_path / "ready"
    code = (
        "import os, subprocess, sys, time\n"
        f"subprocess.Popen([sys.executable, '-c', {PROGRAM!r}, 'wait', {str(ready)!r}])\n"
        f"while not os.path.exists({str(ready)!r}):\n    time.sleep(0.01)\n"
        "os._exit(0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True)
    assert done.stdout == "ready\norphaned\nstopped\n"


def test_handlers_of_others_come_after_ours_and_are_given_back():
    order = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: order.append("theirs"))
    try:
        shutdown = Shutdown(lambda: order.append("ours"))
        shutdown.install()
        signal.raise_signal(signal.SIGTERM)
        time.sleep(0.01)
        shutdown.remove()
        signal.raise_signal(signal.SIGTERM)
        time.sleep(0.01)
        assert order == ["ours", "theirs", "theirs"]
    finally:
        signal.signal(signal.SIGTERM, before)
