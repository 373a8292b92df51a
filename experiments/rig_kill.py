"""Kill one of the processes around a virtual motor, at random, many times: how long until there is no torque?

    python -m experiments.rig_kill [--times 200] [--out outputs/rig-kill]

Four processes share an interface-local multicast group: the virtual motor (it writes the torque that it really gives
into a file), the control process (a full rig session with a torque on), its watchdog, and this one, which kills:

    control kill -9      the watchdog sees its pipe close
    control stopped      SIGSTOP: the watchdog misses beats
    control terminated   SIGTERM: the control process itself stops the drive
    watchdog kill -9     the control process notices that nobody watches
    motor kill -9        there is no torque any more; the control process notices that nothing answers

The drive's own watchdog is off in all of them: it would hide what is measured. Time counts from the kill to the last
moment at which the motor gave a torque.
"""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.report.page import Report
from steer_env.rig.watchdog import STALL, be_urgent

MOTOR = "senso_wheel"
KINDS = ("control kill -9", "control stopped", "control terminated", "watchdog kill -9", "motor kill -9")
ZERO = 0.02  # N m
WATCHED = 0.7  # s after the kill
RECORD = struct.Struct("<dd")  # time.monotonic() in s, torque in N m


class Kill(NamedTuple):
    """One kill: ms from it to the last torque (None: not even in WATCHED), and largest torque in N m.

    ``motor_blind_ms`` is the longest that the virtual motor did not look at the bus meanwhile, because the machine ran
    something else: by so much its own lateness may stand in ``to_zero_ms``. None where it is the motor that was killed.
    """

    kind: str
    to_zero_ms: float | None
    largest_torque: float
    motor_blind_ms: float | None


class Tripped(Exception):
    """The control process tripped before it was killed, as it must when the machine is too slow; the reason."""


def motor_process(port: int, path: str) -> None:
    """Be the virtual motor; append (time, torque) to a file about once per ms."""
    from steer_env.rig.bus import open_bus
    from steer_env.rig.virtual.motor import VirtualMotor

    be_urgent()  # a drive is not kept waiting by what else our computer does
    parent = os.getppid()
    motor = VirtualMotor(MOTOR, watchdog_s=0.0)
    motor.advance(1e-3)
    with open_bus(**_bus(port)) as bus, open(path, "ab", buffering=0) as trace:
        origin = time.monotonic() - motor.now
        print("ready", flush=True)
        while os.getppid() == parent:  # if that is killed, nobody would ever end this
            got = bus.receive(max(min(motor.next_event() - motor.now, 1e-3), 0.0))
            for out in motor.advance_to(max(time.monotonic() - origin, motor.now)):
                bus.send(out.frame)
            if got is not None:
                motor.submit(got.frame)
            trace.write(RECORD.pack(time.monotonic(), motor.motor_torque))


def control_process(port: int, stall: float) -> None:
    """Be the control process: a torque of 1 N m that changes sign before the wheel is fast."""
    from steer_env.plants import PLANTS
    from steer_env.rig import motors
    from steer_env.rig.bus import open_bus
    from steer_env.rig.safety import SafetyLayer, State
    from steer_env.rig.safety_limits import Limits
    from steer_env.rig.session import RigError, RigSession
    from steer_env.rig.shutdown import Shutdown
    from steer_env.rig.watchdog import Watchdog

    watchdog = Watchdog(MOTOR, {}, _bus(port), stall)
    watchdog.start()
    # A loaded machine is late: what is looked at here is what a kill does, not what lateness does.
    patient = Limits(
        stale_after=0.1, longest_cycle=0.1, jump=1.0, motion_mismatch=5.0, torque_mismatch=50.0, frozen_after=5.0,
        speed_limit=100.0, angle_limit=30.0, energy_store=500.0,
    )  # fmt: skip
    motor = motors.make(MOTOR)
    session = RigSession(open_bus(**_bus(port)), motor, PLANTS["SbW"], patient, watchdog)
    session.safety = SafetyLayer(motor.rated_torque, patient, period=0.1)
    Shutdown(lambda: session.stop("the program ends")).install()
    try:
        session.bring_up(20.0)
        session.arm(20.0)
    except RigError as error:
        print(error, flush=True)
        raise
    for k in range(10**9):
        session.cycle(1.0 if k // 150 % 2 else -1.0)
        if k == 300:
            print(watchdog.pid, flush=True)
        if session.safety.state is not State.ARMED:
            break
    print(session.safety.trip_reason, flush=True)
    time.sleep(5.0)


def kill(kind: str, port: int, stall: float, rng: np.random.Generator) -> Kill:
    """Start everything, kill one process at a random moment, and look at the torque; Tripped if it came before."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "torque"))
        motor = _start("motor_process", port, path)
        control = watchdog = None
        try:
            _line(motor)
            control = _start("control_process", port, stall)
            line = _line(control).strip()
            if not line.isdigit():
                raise Tripped(line)
            watchdog = int(line)
            time.sleep(rng.uniform(0.0, 0.3))
            killed_at = time.monotonic()
            if kind.startswith("control"):
                how = {"control stopped": signal.SIGSTOP, "control terminated": signal.SIGTERM}
                control.send_signal(how.get(kind, signal.SIGKILL))
            else:
                os.kill(motor.pid if kind.startswith("motor") else watchdog, signal.SIGKILL)
            time.sleep(WATCHED)
            trace = np.frombuffer(Path(path).read_bytes()[: os.path.getsize(path) // 16 * 16]).reshape(-1, 2)
        finally:
            for process in (control, motor):
                if process is not None:
                    process.kill()
                    process.communicate()
            if watchdog is not None:
                _end(watchdog)
    times, torques = trace.T
    after = (np.abs(torques) > ZERO) & (times > killed_at)
    last = float(times[after][-1]) if after.any() else killed_at
    stopped = last < times[-1] - 0.05 or kind.startswith("motor")
    looks = np.concatenate([[killed_at], times[times > killed_at], [killed_at + WATCHED]])
    blind = None if kind.startswith("motor") else 1e3 * float(np.diff(looks).max())
    return Kill(kind, 1e3 * (last - killed_at) if stopped else None, float(np.abs(torques).max()), blind)


def _bus(port: int) -> dict[str, Any]:
    return {"interface": "udp_multicast", "channel": "ff11::7079:77", "port": port}


def _start(function: str, *arguments: object) -> subprocess.Popen[str]:
    code = f"from experiments import rig_kill; rig_kill.{function}(*{arguments!r})"
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise RuntimeError(f"{process.args!r} ended before it was ready")
    return line


def _end(pid: int) -> None:
    """The watchdog is not our child: it ends by itself when its control process is gone."""
    for _ in range(300):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.01)


@click.command()
@click.option("--times", default=200, show_default=True, help="Kills in all.")
@click.option("--kind", "kinds", multiple=True, type=click.Choice(KINDS), help="Only these; may be given again.")
@click.option("--stall-ms", default=1e3 * STALL, show_default=True, help="Of the watchdog; more on a busy machine.")
@common_options
def main(
    times: int, kinds: tuple[str, ...], stall_ms: float, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool
) -> None:
    """Kill processes at random and measure the time to zero torque."""
    be_urgent()  # what is killed dies when it is said to, not when the computer has time for it
    rng = np.random.default_rng(seed)
    kills, chosen = [], kinds or KINDS
    out.mkdir(parents=True, exist_ok=True)
    with progress("rig_kill", times, quiet) as advance, open(out / "kills.csv", "w", encoding="utf-8") as kept:
        kept.write(",".join(Kill._fields) + "\n")
        for k in range(times):
            kind = chosen[int(rng.integers(len(chosen)))]
            try:
                kills.append(kill(kind, 44_100 + k % 800, 1e-3 * stall_ms, rng))
            except Tripped as reason:
                kept.write(f"# {kind}: tripped before: {reason}\n")
                kept.flush()
                continue
            kept.write(",".join(map(str, kills[-1])) + "\n")
            kept.flush()  # an interrupted run has told what it did
            advance(note=f"{kind}: {kills[-1].to_zero_ms}")
    rows = []
    for kind in KINDS:
        those = [k for k in kills if k.kind == kind]
        zero = [k.to_zero_ms for k in those if k.to_zero_ms is not None]
        if those:
            half, most = (float(np.median(zero)), max(zero)) if zero else (None, None)
            blind = max((k.motor_blind_ms for k in those if k.motor_blind_ms is not None), default=None)
            largest = max(k.largest_torque for k in those)
            rows.append((kind, len(those), len(those) - len(zero), half, most, largest, blind))
    columns = ("what", "times", "torque stayed", "p50 / ms", "max / ms", "largest / N m", "motor blind, max / ms")
    report = Report("Killing processes of a rig", "time from the kill to zero torque, on this machine as it was loaded")
    report.text(__doc__.split("\n\n", 2)[2]).table(columns, rows)
    path = report.write(out / "report.html")
    if as_json:
        print_json({"kills": [k._asdict() for k in kills], "report": str(path)})
    else:
        print_table(columns, rows)
        click.echo(str(path))


if __name__ == "__main__":
    main()
