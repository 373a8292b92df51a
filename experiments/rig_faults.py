"""Everything that can go wrong between a controller and a motor, one at a time: does the torque go to zero, and when?

    python -m experiments.rig_faults [--motor senso_wheel] [--repeats 3] [--out outputs/rig-faults]

Each run brings a stepped virtual motor up, asks for a sine of torque, lets one fault act, and watches the motor's true
torque until long after. Without plant knowledge, without a watchdog process, on the virtual clock: what is measured is
what session, safety layer and the drive's own watchdog (50 ms) do. "rode through" means that the fault did no harm that
had to be stopped; such a run ends with an orderly bring-down.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.report.page import Report
from experiments.worker_pool import worker_pool
from steer_env.plants import PLANTS
from steer_env.rig import motors
from steer_env.rig.safety import State
from steer_env.rig.safety_limits import limits_for
from steer_env.rig.session import RigSession
from steer_env.rig.virtual.faults import FAULTS, Fault
from steer_env.rig.virtual.link import SteppedLink
from steer_env.rig.virtual.motor import VirtualMotor

CAP = 1.5  # N m
START, ACTS_FOR, WATCHED = 0.8, 0.6, 0.4  # s: when the fault begins, how long we go on, how long we look afterwards
ZERO = 0.02  # N m that count as no torque: a 50th of what is asked for
OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "simulated": {},
    "senso_wheel": {},
    "odrive": {"rated_torque": 3.0, "node": 3, "torque_constant": 0.1, "rate_limit": 60.0},
    "odrive_05": {"rated_torque": 3.0, "node": 3, "torque_constant": 0.1, "rate_limit": 60.0},
    "moteus": {"rated_torque": 3.0},
    "cia402": {"rated_torque": 7.5, "increments_per_turn": 65_536},
}
# Faults of our own program, besides those of the wire and the drive.
HOST_FAULTS = ("host: not a number", "host: infinity", "host: huge torque", "host: stalls", "host: exception")
# Behind the safety layer and the drive's own limit: a drive that does what it was not told. And the SENSO-Wheel's limit
# travels in a frame that can be damaged itself: a second damaged one within 10 ms then counts.
BEHIND = {(name, fault) for name in OPTIONS for fault in ("torque_gain", "latched_torque")}
BEHIND.add(("senso_wheel", "corruption_to_drive"))


class Outcome(NamedTuple):
    """Of one fault on one motor: times in s from the fault's start, NaN where it rode through; torques in N m."""

    motor: str
    fault: str
    repeat: int
    tripped: str
    time_to_zero: float
    largest_torque: float
    largest_command: float
    last_torque: float
    error: str


class HostFault(Exception):
    """What the program raises in one of the host's own faults."""


def outcome(motor: str, fault: str, repeat: int) -> Outcome:
    """Run one fault."""
    rng = np.random.default_rng([repeat, *fault.encode(), *motor.encode()])
    start = START + rng.uniform(0.0, 0.1)
    faults = [] if fault in HOST_FAULTS else [Fault(fault, start)]
    virtual = VirtualMotor(motor, repeat, faults, watchdog_s=0.05, **OPTIONS[motor])
    codec = motors.make(motor, **OPTIONS[motor])
    session = RigSession(SteppedLink(virtual), codec, PLANTS["SbW"], limits_for(CAP, codec.rated_torque))
    phase, trace, commands, error = rng.uniform(0.0, 2.0 * math.pi), [], [], ""
    try:
        session.bring_up(0.4)
        session.arm(0.2)
        while virtual.now < start + ACTS_FOR:
            if fault in HOST_FAULTS and virtual.now >= start:
                if fault == "host: stalls":
                    break
                if fault == "host: exception":
                    raise HostFault
            torque = 1.3 * math.sin(2.0 * math.pi * 1.5 * virtual.now + phase)
            session.cycle(_wrong(fault, torque) if virtual.now >= start else torque)
            trace.append((virtual.now, virtual.motor_torque))
            commands.append(abs(session.applied))
    except HostFault:
        session.stop("exception")
    except Exception as wrong:  # the point of the run is that there is none
        error = f"{type(wrong).__name__}: {wrong}"
        session.stop(error)
    tripped = session.safety.trip_reason if session.safety.state is State.TRIPPED else ""
    if not tripped and fault != "host: stalls":
        session.bring_down(0.1)
    while virtual.now < start + ACTS_FOR + WATCHED:
        virtual.advance(1e-3)
        trace.append((virtual.now, virtual.motor_torque))
    times, torques = np.array(trace).T
    moving = times[np.abs(torques) > ZERO]
    stopped = bool(tripped) or fault == "host: stalls"
    return Outcome(
        motor, fault, repeat, tripped, max(float(moving[-1]) - start, 0.0) if stopped else math.nan,
        float(np.abs(torques).max()), max(commands), float(abs(torques[-1])), error,
    )  # fmt: skip


def _wrong(fault: str, torque: float) -> float:
    wrong = {"host: not a number": math.nan, "host: infinity": math.inf, "host: huge torque": 1e30}
    return wrong.get(fault, torque)


def _outcome(case: tuple[str, str, int]) -> Outcome:
    return outcome(*case)


def failures(outcomes: Sequence[Outcome]) -> list[str]:
    """What is not as it must be, in words; [] if all is well."""
    wrong = []
    for o in outcomes:
        where = f"{o.fault} on {o.motor} ({o.repeat})"
        if o.error:
            wrong.append(f"{where}: {o.error}")
        if not o.last_torque <= ZERO:
            wrong.append(f"{where}: {o.last_torque:.3f} N m in the end")
        if not o.largest_command <= CAP:
            wrong.append(f"{where}: {o.largest_command:.3f} N m commanded, the cap is {CAP} N m")
        if not o.largest_torque <= CAP + ZERO and (o.motor, o.fault) not in BEHIND:
            wrong.append(f"{where}: {o.largest_torque:.3f} N m given, the cap is {CAP} N m")
    return wrong


def summary(outcomes: Sequence[Outcome]) -> list[tuple[str, str, str, float | None, float | None, float]]:
    """Per fault: (fault, what it does, on how many it tripped, p50 and max ms to zero torque, largest N m)."""
    rows = []
    for fault in dict.fromkeys(o.fault for o in outcomes):
        those = [o for o in outcomes if o.fault == fault]
        times = np.array([o.time_to_zero for o in those if not math.isnan(o.time_to_zero)]) * 1e3
        half, most = (float(np.median(times)), float(times.max())) if times.size else (None, None)
        does = FAULTS[fault].does if fault in FAULTS else "a fault of the program"
        tripped = f"{len(times)} of {len(those)}"
        rows.append((fault, does, tripped, half, most, max(o.largest_torque for o in those)))
    return rows


COLUMNS = ("fault", "what it does", "stopped", "p50 / ms", "max / ms", "largest / N m")


def page(outcomes: Sequence[Outcome], wrong: Sequence[str]) -> Report:
    """The report: one row per fault, then why each motor stopped."""
    report = Report("Faults of a rig", "time from each fault to zero torque, on every motor")
    report.text(__doc__.split("\n\n", 2)[2])
    report.key_numbers([(str(len(outcomes)), "runs"), (str(len(wrong)), "not as they must be")])
    report.table(COLUMNS, summary(outcomes), "All motors and repeats together", dense=True)
    report.section("Why it stopped")
    rows = [(o.fault, o.motor, o.tripped or "rode through", o.time_to_zero * 1e3) for o in outcomes if o.repeat == 0]
    report.table(("fault", "motor", "reason", "ms to zero"), rows, "First repeat of each", dense=True)
    if wrong:
        report.section("Not as they must be").table(("what",), [(line,) for line in wrong])
    return report


@click.command()
@click.option("--motor", "names", multiple=True, type=click.Choice(list(OPTIONS)), help="All if not given.")
@click.option("--repeats", default=3, show_default=True, help="Runs of each, with the fault at another phase.")
@common_options
def main(names: tuple[str, ...], repeats: int, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool) -> None:
    """Run the fault matrix."""
    cases = list(product(names or OPTIONS, (*FAULTS, *HOST_FAULTS), range(seed, seed + repeats)))
    outcomes = []
    with (
        progress("rig_faults", len(cases), quiet) as advance,
        worker_pool(jobs) as pool,
    ):
        for done in pool.map(_outcome, cases):
            outcomes.append(done)
            advance(note=f"{done.motor} {done.fault}")
    wrong = failures(outcomes)
    out.mkdir(parents=True, exist_ok=True)
    path = page(outcomes, wrong).write(out / "report.html")
    if as_json:
        rows = [
            o._replace(time_to_zero=-1.0 if math.isnan(o.time_to_zero) else o.time_to_zero)._asdict() for o in outcomes
        ]
        print_json({"outcomes": rows, "failures": wrong, "report": str(path)})
        return
    print_table(COLUMNS, summary(outcomes))
    for line in wrong:
        click.echo(line)
    click.echo(f"{len(outcomes)} runs, {len(wrong)} not as they must be; {path}")


if __name__ == "__main__":
    main()
