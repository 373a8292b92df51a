"""steer-env rig record: write down what passes on a bus, without sending anything."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import click

from experiments.cli_options import common_options, print_json, print_table
from experiments.rig_options import bus_options

LOOK = 0.2  # s that one wait for a frame takes at most


@click.command()
@bus_options
@click.option("--seconds", type=click.FloatRange(min=0.0, min_open=True), default=None, help="[default: until Ctrl-C]")
@common_options
def command(
    motor: str, settings: dict[str, Any], interface: str, channel: str, bitrate: int | None, port: int,
    seconds: float | None, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Log every frame on a bus as BLF and candump; nothing is sent. --motor sets the bit rates."""
    from steer_env.rig.bus import open_bus
    from steer_env.rig.motors import make
    from steer_env.rig.recorder import Recorder

    drive = make(motor, **settings)
    began = time.monotonic()
    with (
        open_bus(interface, channel, bitrate or drive.bitrate, drive.data_bitrate, port) as bus,
        Recorder(out) as recorder,
    ):
        try:
            while seconds is None or time.monotonic() - began < seconds:
                received = bus.receive(LOOK)
                if received is not None:
                    recorder.frame(received.frame, received.host_time, sent=False)
        except KeyboardInterrupt:
            pass  # the way to end a recording that has no length
        errors = bus.health().error_frames
    result = {
        "frames": recorder.frames,
        "error_frames": errors,
        "seconds": round(time.monotonic() - began, 2),
        "log": str(recorder.paths[0]),
    }
    print_json(result) if as_json else print_table(list(result), [list(result.values())])
