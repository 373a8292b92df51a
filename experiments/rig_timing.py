"""How well this machine keeps 1 kHz, and what a control cycle of the rig costs it. Measured, never asserted.

    python -m experiments.rig_timing [--seconds 10] [--out outputs/rig-timing]

A bare loop that only waits for its deadlines is the floor: what it is late, the scheduler is late. Beside it the rig's
whole cycle (safety, codec, python-can, watchdog's beat) in real time, alone on a ``virtual`` bus with an answering
motor in the same process. The cost of the parts is timed without waiting.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from experiments.cli_options import common_options, print_json, print_table
from experiments.report.page import Report
from steer_env.plants import PLANTS
from steer_env.rig import motors
from steer_env.rig.bus import open_bus
from steer_env.rig.pacing import Pacer
from steer_env.rig.safety import SafetyLayer
from steer_env.rig.safety_limits import Measurement
from steer_env.rig.session import PERIOD, RigSession
from steer_env.rig.virtual.motor import VirtualMotor

Array = NDArray[np.float64]
COLUMNS = ("loop", "cycles", "p50 / ms", "p99 / ms", "p99.9 / ms", "worst / ms", "left out")
MOTOR = "senso_wheel"


class Answering:
    """A link to a stepped virtual motor that lives in real time: what a bus without an adapter would be."""

    def __init__(self) -> None:
        self.motor = VirtualMotor(MOTOR, bitrate=0, watchdog_s=0.0)
        self._bus = open_bus("virtual", f"timing-{time.monotonic_ns()}")
        self._origin = time.monotonic()
        self._waiting: list[Any] = []

    def send(self, frame: Any) -> bool:
        """Through python-can, and to the motor at once."""
        self._bus.send(frame)
        self.motor.submit(frame)
        now = time.monotonic()
        self._waiting += [got._replace(host_time=now) for got in self.motor.advance(1e-6)]
        return True

    def receive(self, timeout: float) -> Any:
        """What the motor answered, else wait."""
        if self._waiting:
            return self._waiting.pop(0)
        self._bus.receive(timeout)
        return None

    def now(self) -> float:
        """The host's clock in s."""
        return time.monotonic()

    def health(self) -> Any:
        """Of the bus."""
        return self._bus.health()

    def close(self) -> None:
        """Let go of the bus."""
        self._bus.close()


def bare_loop(seconds: float) -> tuple[Array, int]:
    """Lateness in s of a loop that only sleeps until its deadlines, and how many were left out."""
    pacer, late = Pacer(PERIOD, time.monotonic), []
    for _ in range(round(seconds / PERIOD)):
        while (left := pacer.remaining()) > 0.0:
            time.sleep(left)
        late.append(pacer.tick().late)
    return np.array(late), pacer.overruns


def rig_loop(seconds: float) -> tuple[Array, Array, int]:
    """(lateness in s, work in s of each cycle, left out) of the rig's cycle with zero torque."""
    motor = motors.make(MOTOR)
    link, late, work = Answering(), [], []
    link.motor.advance(1e-3)  # compiled before time counts
    session = RigSession(link, motor, PLANTS["SbW"])
    for _ in range(round(seconds / PERIOD)):
        begun = time.thread_time()
        session.cycle(0.0)
        work.append(time.thread_time() - begun)
        late.append(session.late)
    link.close()
    return np.array(late), np.array(work), session.pacer.overruns


def cost_us(call: Callable[[], object], times: int = 5000) -> float:
    """Microseconds that a call takes: the median of blocks."""
    blocks = []
    for _ in range(20):
        begun = time.perf_counter()
        for _ in range(times // 20):
            call()
        blocks.append((time.perf_counter() - begun) / (times // 20))
    return 1e6 * float(np.median(blocks))


def costs() -> list[tuple[str, float]]:
    """(part of a cycle, us) on the host's side."""
    rows = []
    clock = [1.0]
    layer = SafetyLayer(7.5)

    def judged() -> float:
        clock[0] += 1e-3
        return layer.filter(0.5, Measurement(clock[0], 0.1, 0.0, 0.0, 0.0), clock[0])

    rows.append(("safety layer, locked", cost_us(judged)))
    layer.unlock(clock[0])
    for _ in range(30):
        judged()
    layer.arm(clock[0])
    rows.append(("safety layer, armed", cost_us(judged, 400)))
    for name in ("senso_wheel", "simulated"):
        motor, virtual = motors.make(name), VirtualMotor(name, bitrate=0)
        answers = virtual.exchange(motor.torque_frames(0.0), 1e-4)
        rows.append((f"{name}: command to frames", cost_us(partial(motor.torque_frames, 0.5))))
        decode = [partial(motor.decode, got.frame) for got in answers]
        rows.append((f"{name}: {len(decode)} answers to sample", sum(map(cost_us, decode))))
    return rows


def row(name: str, late: Array, left_out: int) -> tuple[str, int, float, float, float, float, int]:
    """One line of the table of lateness."""
    p50, p99, p999, worst = (float(value) * 1e3 for value in np.percentile(late, [50, 99, 99.9, 100]))
    return name, late.size, p50, p99, p999, worst, left_out


@click.command()
@click.option("--seconds", default=10.0, show_default=True, help="Of each loop.")
@common_options
def main(seconds: float, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool) -> None:
    """Measure pacing and cost on this machine, as it is loaded now."""
    bare, bare_left = bare_loop(seconds)
    late, work, left = rig_loop(seconds)
    rows = [row("bare", bare, bare_left), row("rig", late, left)]
    parts = [*costs(), ("whole cycle with the virtual motor in it, CPU time, median", 1e6 * float(np.median(work)))]
    report = Report("Pacing", "1 kHz on this machine, as it was loaded then")
    report.text(__doc__.split("\n\n", 2)[2])
    report.table(COLUMNS, rows, "How late cycles began")
    report.table(("part", "us"), parts, "Cost of a cycle on the host")
    out.mkdir(parents=True, exist_ok=True)
    path = report.write(out / "report.html")
    if as_json:
        print_json({"lateness": [list(r) for r in rows], "cost_us": dict(parts), "report": str(path)})
        return
    print_table(COLUMNS, rows)
    print_table(("part", "us"), parts)
    click.echo(str(path))


if __name__ == "__main__":
    main()
