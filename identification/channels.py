"""The channels of a measurement campaign, their units, and the map from the user's names to ours.

Contract: docs/formats.md, section 1. A stored number becomes ours as

    value in SI = (stored * scale + offset) * factor of the unit,

so ``scale`` and ``offset`` are in the source's unit, as they stand in a CAN database; ``offset =
"first"`` (time only) counts from the first sample.
"""

from collections.abc import Mapping, Sequence
from math import pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.errors import InputError
from steer_env.plants import checked
from steer_env.units import GRAVITY

FloatArray = NDArray[np.float64]


class Channel(NamedTuple):
    """Dimension of a channel, and the largest size its value can sensibly have, in SI."""

    dimension: str
    limit: float


# Limits: assumption, about three times what an ordinary road vehicle or rig reaches. They exist to
# find a wrong unit, so they stay below what one degree taken for one radian makes of a large value.
CHANNELS: dict[str, Channel] = {
    "time_s": Channel("time", np.inf),
    "steering_angle_rad": Channel("angle", 20.0),
    "steering_torque_Nm": Channel("torque", 200.0),
    "pinion_angle_rad": Channel("angle", 20.0),
    "torsion_bar_torque_Nm": Channel("torque", 100.0),
    "rack_force_N": Channel("force", 1e5),
    "vehicle_speed_mps": Channel("speed", 120.0),
    "lateral_speed_mps": Channel("speed", 40.0),
    "yaw_rate_radps": Channel("angular rate", 5.0),
    "lateral_acceleration_mps2": Channel("acceleration", 40.0),
    "sideslip_angle_rad": Channel("angle", 1.6),
    "motor_angle_rad": Channel("angle", 1e4),
    "motor_torque_Nm": Channel("torque", 500.0),
    "sensor_torque_Nm": Channel("torque", 500.0),
    "motor_velocity_radps": Channel("angular rate", 1e3),
}

# What the steps of each kind read (docs/formats.md, section 1).
KIND_CHANNELS: dict[str, tuple[str, ...]] = {
    "vehicle": tuple(name for name in CHANNELS if not name.startswith(("motor_", "sensor_"))),
    "rig": (
        "time_s",
        "motor_angle_rad",
        "motor_torque_Nm",
        "sensor_torque_Nm",
        "motor_velocity_radps",
    ),
    "drive": ("time_s", "steering_angle_rad", "steering_torque_Nm", "vehicle_speed_mps"),
}

# Factor to SI of each unit, by dimension; the first of a row is SI.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0, "°": pi / 180.0},
    "angular rate": {
        "rad/s": 1.0,
        "mrad/s": 1e-3,
        "deg/s": pi / 180.0,
        "°/s": pi / 180.0,
        "rpm": pi / 30.0,
    },
    "torque": {"N*m": 1.0, "Nm": 1.0, "cNm": 1e-2, "mNm": 1e-3, "kNm": 1e3},
    "force": {"N": 1.0, "kN": 1e3},
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "kph": 1.0 / 3.6, "mph": 0.44704},
    "acceleration": {"m/s^2": 1.0, "m/s2": 1.0, "m/s²": 1.0, "g": GRAVITY},
}


class ChannelMap(NamedTuple):
    """Where a channel comes from; ``factor`` is the unit's, ``from_first`` counts from sample 0."""

    source: str
    factor: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    from_first: bool = False

    def to_si(self, stored: FloatArray) -> FloatArray:
        """Return the stored numbers in SI."""
        # The first sample goes before scaling: a stamp of 1.5e18 ns keeps no digits to spare.
        counted = stored - stored[0] if self.from_first else stored
        return (counted * self.scale + self.offset) * self.factor


def read_channel_maps(table: object, where: str) -> dict[str, ChannelMap]:
    """Read the [channels] table: our channel name -> where it comes from."""
    found = checked.check_keys(table, (), CHANNELS, where)
    maps = {name: _read_map(found[name], name, f"{where}.{name}") for name in found}
    sources = [entry.source for entry in maps.values()]
    for name, entry in maps.items():
        if sources.count(entry.source) > 1:
            raise InputError(
                f"{where}: key '{name}'",
                f"the column '{entry.source}' is the source of two channels",
                "map each column once; check for a copied line",
            )
    return maps


def _read_map(table: object, name: str, where: str) -> ChannelMap:
    entry = checked.check_keys(table, ("source",), ("unit", "scale", "offset"), where)
    source = checked.text(entry, "source", where)
    factor = _unit_factor(entry, name, where) if "unit" in entry else 1.0
    scale = checked.number(entry, "scale", where) if "scale" in entry else 1.0
    if scale == 0.0:
        raise InputError(
            f"{where}: key 'scale'",
            "a scale of 0 makes every value 0",
            "write 1, or -1 to turn the sign round",
        )
    if entry.get("offset") == "first":
        if name != "time_s":
            raise InputError(
                f"{where}: key 'offset'",
                "'first' is for time_s only",
                "write the offset as a number in the unit of the column",
            )
        return ChannelMap(source, factor, scale, 0.0, from_first=True)
    offset = checked.number(entry, "offset", where) if "offset" in entry else 0.0
    return ChannelMap(source, factor, scale, offset)


def _unit_factor(entry: Mapping[str, Any], name: str, where: str) -> float:
    unit = checked.text(entry, "unit", where)
    dimension = CHANNELS[name].dimension
    known = UNITS[dimension]
    plain = unit.replace(" ", "").replace("·", "*").replace("N.m", "N*m")
    if plain in known:
        return known[plain]
    other = next((d for d, units in UNITS.items() if plain in units), None)
    what = f"'{unit}' is a unit of {other}" if other else f"'{unit}' is not a unit known here"
    raise InputError(
        f"{where}: key 'unit'",
        f"{what}; {name} is of dimension {dimension}",
        f"write one of {checked.listed(known)}, or another unit by means of scale",
    )


def refuse_near_misses(
    header: Sequence[str], maps: Mapping[str, ChannelMap], kind: str, where: str
) -> None:
    """Refuse a column that is meant as a channel but carries another unit or spelling."""
    taken = {entry.source for entry in maps.values()}
    wanted = [name for name in KIND_CHANNELS[kind] if name not in header and name not in maps]
    for column in header:
        if column in CHANNELS or column in taken:
            continue
        for name in wanted:
            stem = name.rpartition("_")[0]
            if column.lower() in (name.lower(), stem) or column.lower().rpartition("_")[0] == stem:
                raise InputError(
                    f"{where}: column '{column}'",
                    f"the name is close to '{name}', but the unit or the spelling differs",
                    f"rename the column, or map it in campaign.toml: [channels] {name} = "
                    f'{{ source = "{column}", unit = "..." }}',
                )
