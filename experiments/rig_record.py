"""steer-env rig record: write down what passes on a bus, without sending anything."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from experiments.cli_options import common_options, print_json, print_table
from experiments.rig_options import bus_options, fresh

LOOK = 0.2  # s that one wait for a frame takes at most


@click.command()
@bus_options
@click.option("--seconds", type=click.FloatRange(min=0.0, min_open=True), default=None, help="[default: until Ctrl-C]")
@click.option("--mf4", is_flag=True, help="Also as MF4, in OUT/mf4 (needs 'steer-env[formats]').")
@common_options
@click.pass_context
def command(
    ctx: click.Context, motor: str, settings: dict[str, Any], interface: str, channel: str, bitrate: int | None,
    port: int, seconds: float | None, mf4: bool, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Log every frame on a bus as BLF and candump, until Ctrl-C; nothing is sent. --motor sets the bit rates."""
    from steer_env.campaign_mf4 import require_asammdf
    from steer_env.rig.arrival import Arrival
    from steer_env.rig.bus import open_bus
    from steer_env.rig.motors import make
    from steer_env.rig.motors.dbc import dbc_of
    from steer_env.rig.recorder import Recorder

    if mf4:
        require_asammdf("--mf4")
    drive, out = make(motor, **settings), fresh(ctx, out)
    arrival, began = Arrival(), time.monotonic()
    with (
        open_bus(interface, channel, bitrate or drive.bitrate, drive.data_bitrate, port) as bus,
        Recorder(out) as recorder,
    ):
        try:
            while seconds is None or time.monotonic() - began < seconds:
                received = bus.receive(LOOK)
                if received is not None:
                    recorder.frame(received.frame, arrival.of(received), sent=False)
        except KeyboardInterrupt:
            pass  # the way to end a recording that has no length
        errors = bus.health().error_frames
    if mf4 and recorder.frames:
        from steer_env.rig.mf4 import as_mf4

        as_mf4(out, recorder.paths[0], dbc_of(motor))
    result = {
        "frames": recorder.frames,
        "error_frames": errors,
        "seconds": round(time.monotonic() - began, 2),
        "log": str(recorder.paths[0]) if recorder.frames else "none: no frame came",
    }
    print_json(result) if as_json else print_table(list(result), [list(result.values())])
