"""steer-env rig: a force-feedback motor on a CAN bus, real or virtual. One file per subcommand."""

import click

from experiments.cli_table import Entry, TableGroup

SUBCOMMANDS = {
    "virtual": Entry("experiments.rig_virtual:command", "A virtual motor on a bus, as a process of its own."),
    "configure": Entry("experiments.rig_configure:command", "Set a CANopen drive up: PDO map, mode, torque limit."),
    "check": Entry("experiments.rig_check:command", "Walk through bus, motor, calibration, timing and limits."),
    "run": Entry("experiments.rig_run:command", "Run a controller on the motor."),
    "excite": Entry("experiments.rig_excite:command", "Turn a free wheel by torques that tell its parameters."),
    "record": Entry("experiments.rig_record:command", "Log what passes on a bus; nothing is sent."),
    "replay": Entry("experiments.rig_replay:command", "Play a log back into the decoders."),
}


@click.group(cls=TableGroup, table=SUBCOMMANDS)
def command() -> None:
    """A force-feedback motor on a CAN bus: virtual ones to try it on, and real ones."""
