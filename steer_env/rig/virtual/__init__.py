"""The other end of the bus: a virtual motor with the drive's state machine and watchdog, a plant and a wire.

drive.py + <module of MOTORS>.py    the drive's side of each protocol, from the same frame layouts as the host's
wheel.py                            rotor, wheel and torque sensor: the steer-by-wire plant of the environments
wire.py                             how long frames take and who goes first
faults.py                           what can go wrong, seeded
motor.py, link.py                   all of it on a virtual clock, bare and with the manners of a bus
server.py                           all of it on a real bus, in real time
"""

from __future__ import annotations

import importlib
from typing import Any

from steer_env.rig.motors import MOTORS, make


def drive_class(name: str) -> Any:
    """The virtual drive of a row of MOTORS; raises InputError for an unknown name."""
    if name not in MOTORS:
        make(name)
    return importlib.import_module(f"steer_env.rig.virtual.{MOTORS[name].module}").VirtualDrive


def settings(name: str) -> dict[str, Any]:
    """What the virtual drive is set to where the motor's options have no default: hand it to ``motors.make``."""
    return dict(drive_class(name).SETTINGS)
