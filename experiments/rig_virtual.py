"""steer-env rig virtual: a virtual motor on a bus, in real time, in a process of its own."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from experiments.cli_options import common_options, print_json, print_table
from experiments.rig_options import bus_options
from steer_env.errors import InputError

if TYPE_CHECKING:
    from steer_env.rig.virtual.faults import Fault

_FAULT = re.compile(r"(?P<kind>\w+)(@(?P<start>[\d.]+))?(\+(?P<duration>[\d.]+))?(=(?P<size>-?[\d.e-]+))?")


def fault_of(text: str) -> Fault:
    """KIND[@START][+DURATION][=SIZE], times in s, as a Fault; raises InputError."""
    from steer_env.rig.virtual.faults import Fault, checked

    found = _FAULT.fullmatch(text)
    if found is None:
        raise InputError(f"--fault {text}", "cannot be read", "write KIND[@START][+DURATION][=SIZE], times in s")
    try:
        given = {name: float(value) for name, value in found.groupdict().items() if value and name != "kind"}
    except ValueError as error:
        raise InputError(f"--fault {text}", str(error), "write numbers for START, DURATION and SIZE") from None
    return checked(Fault(found["kind"], **given))


@click.command()
@bus_options
@click.option("--seconds", type=click.FloatRange(min=0.0, min_open=True), default=None, help="End after this time.")
@click.option(
    "--fault", "faults", multiple=True, metavar="KIND[@START][+DURATION][=SIZE]",
    help="Something that goes wrong, times in s; may be repeated; 'list' names them.",
)  # fmt: skip
@click.option("--watchdog-ms", type=click.FloatRange(min=0.0), default=None, help="Of the drive; 0: none.")
@common_options
def command(
    motor: str,
    settings: dict[str, Any],
    interface: str,
    channel: str,
    bitrate: int | None,
    port: int,
    seconds: float | None,
    faults: tuple[str, ...],
    watchdog_ms: float | None,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Put a virtual motor on a bus: its drive, a wheel on it, and a wire that carries what a real one can.

    It lives until Ctrl-C. Another program talks to it as to the real motor.
    """
    from steer_env.rig.bus import open_bus
    from steer_env.rig.virtual.faults import FAULTS
    from steer_env.rig.virtual.motor import VirtualMotor
    from steer_env.rig.virtual.server import Served, serve

    del out, jobs  # nothing is written
    if "list" in faults:
        rows = [(name, kind.does, kind.unit, kind.size) for name, kind in FAULTS.items()]
        print_table(("fault", "what it does", "size in", "if not given"), rows)
        return
    virtual = VirtualMotor(
        motor, seed, [fault_of(text) for text in faults], bitrate=bitrate,
        watchdog_s=None if watchdog_ms is None else 1e-3 * watchdog_ms, **settings,
    )  # fmt: skip
    virtual.advance(1e-3)  # compiled before the host calls

    def report(now: Served) -> None:
        faulty = f" ({', '.join(now.faults)})" if now.faults else ""
        click.echo(
            f"\r{now.seconds:6.0f} s  {now.state}{faulty}  {now.angle:8.3f} rad  {now.torque:7.3f} N m  "
            f"{now.received} frames in, {now.sent} out   ",
            nl=False,
            err=True,
        )

    with open_bus(interface, channel, bitrate or virtual.wire.bitrate, virtual.wire.data_bitrate, port) as bus:
        if not quiet:
            click.echo(f"{motor} on {interface} {channel}; end it by Ctrl-C", err=True)
        done = serve(virtual, bus, seconds or float("inf"), None if quiet else report)
    if not quiet:
        click.echo(err=True)
    result = {**done._asdict(), "faults": list(done.faults)}
    print_json(result) if as_json else print_table(list(result), [[str(value) for value in result.values()]])
