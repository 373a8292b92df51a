"""steer-env rig configure: set a CANopen drive up for cyclic synchronous torque, before a run."""

from __future__ import annotations

from pathlib import Path

import click

from experiments.cli_options import common_options, print_json


@click.command()
@click.option("--node", type=click.IntRange(1, 127), default=1, show_default=True, help="Of the drive.")
@click.option(
    "--torque-limit-percent",
    type=click.FloatRange(0.0, 100.0, min_open=True),
    default=100.0,
    show_default=True,
    help="The drive's own limit, of its rated torque.",
)
@click.option("--interface", default="socketcan", show_default=True, metavar="NAME", help="python-can's.")
@click.option("--channel", default="can0", show_default=True, metavar="NAME")
@click.option("--bitrate", type=click.IntRange(10_000, 1_000_000), default=1_000_000, show_default=True, metavar="N")
@common_options
def command(
    node: int,
    torque_limit_percent: float,
    interface: str,
    channel: str,
    bitrate: int,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Write the PDO map that --motor cia402 speaks, its mode and its torque limit into a drive, and read them back.

    The drive stays without current. The map is not stored: repeat this after a power cycle.
    """
    from steer_env.rig.bus import open_bus
    from steer_env.rig.motors.cia402_setup import configure

    del out, seed, jobs, quiet
    found = configure(open_bus(interface, channel, bitrate), node, torque_limit_percent / 100.0)
    if as_json:
        print_json(found._asdict())
        return
    click.echo(f"node {node}: {found.writes} objects written and read back")
    click.echo(
        f"its rated torque (0x6076) is {found.rated_raw}: {found.rated_as_mNm:g} N m if the maker follows the profile; "
        "some put a current there. Give the right one by --set rated_torque=..."
    )
