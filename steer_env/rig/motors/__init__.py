"""Motors by name.

To add one: a file here with an Options dataclass and a class that is a ``motor.Motor``, a .dbc
beside it where a DBC can describe its frames, its drive's side in ``steer_env/rig/virtual``, and a row in ``MOTORS``.
Contract tests then run over it: golden frames, round trips, watchdog, limits, faults.

What no source tells about a drive is an option without a default, or is read from the drive; it is never invented.
"""

from __future__ import annotations

import importlib
from dataclasses import fields
from typing import Any, NamedTuple

from steer_env.errors import InputError
from steer_env.rig.motors.motor import Motor


class Row(NamedTuple):
    """Where a motor is: module, class and options class, loaded when it is made."""

    module: str
    motor: str
    options: str
    fixed: tuple[tuple[str, Any], ...] = ()


MOTORS: dict[str, Row] = {
    "simulated": Row("simulated", "Simulated", "SimulatedOptions"),
    "senso_wheel": Row("senso_wheel", "SensoWheel", "SensoOptions"),
    "odrive": Row("odrive", "Odrive", "OdriveOptions"),
    "odrive_05": Row("odrive", "Odrive", "OdriveOptions", (("firmware", "0.5"), ("node", 1))),  # not 0: see bring_up
    "moteus": Row("moteus", "Moteus", "MoteusOptions"),
    "cia402": Row("cia402", "Cia402", "Cia402Options"),
}


def make(name: str, **options: Any) -> Motor:
    """The motor of a name with its options; raises InputError for an unknown name or option."""
    if name not in MOTORS:
        raise InputError("motor", f"there is no {name!r}", f"choose from {', '.join(MOTORS)}")
    row = MOTORS[name]
    module = importlib.import_module(f"steer_env.rig.motors.{row.module}")
    kind = getattr(module, row.options)
    known = [field.name for field in fields(kind)]
    for option in options:
        if option not in known:
            raise InputError(f"motor {name}", f"there is no option {option!r}", f"choose from {', '.join(known)}")
    made: Motor = getattr(module, row.motor)(kind(**{**dict(row.fixed), **options}))
    return made
