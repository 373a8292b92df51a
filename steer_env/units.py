"""Units, the sign convention, and what a parameter must say about itself.

Signs follow ISO 8855: x forward, y left, z up; a steering angle, torque or yaw rate to the left is
positive. Inside the package every number is SI. Other units (km/h, degrees, per cent) exist only at
the edges, and then the unit stands in the name of the column, key or argument.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any, get_type_hints

from steer_env.errors import InputError

GRAVITY = 9.80665  # m/s2, standard gravity (ISO 80000-3)


@dataclass(frozen=True)
class Quantity:
    """What one parameter means: unit, meaning, valid range (inclusive), source of its default.

    ``source`` begins with "assumption" where the default is ours and not a published number.
    """

    unit: str
    meaning: str
    low: float
    high: float
    source: str


@cache
def quantities(parameter_set: type) -> dict[str, Quantity]:
    """The Quantity of each annotated field of a parameter NamedTuple, by field name."""
    found = {}
    for name, hint in get_type_hints(parameter_set, include_extras=True).items():
        for note in getattr(hint, "__metadata__", ()):
            if isinstance(note, Quantity):
                found[name] = note
    return found


def check_ranges(parameters: Any, where: str) -> None:
    """Raise InputError where a field is not finite or out of range; ``where`` names the origin."""
    kind: Any = type(parameters)
    for name, quantity in quantities(kind).items():
        value = float(getattr(parameters, name))
        if not math.isfinite(value):
            raise InputError(
                where, f"{name} is {value}", f"give a finite number in {quantity.unit}"
            )
        if not quantity.low <= value <= quantity.high:
            raise InputError(
                where,
                f"{name} = {value:g} {quantity.unit} ({quantity.meaning}) is out of range",
                f"give a value from {quantity.low:g} to {quantity.high:g} {quantity.unit}",
            )


def from_kmh(speed_kmh: float) -> float:
    """Kilometres per hour to m/s."""
    return speed_kmh / 3.6


def to_kmh(speed: float) -> float:
    """m/s to kilometres per hour."""
    return speed * 3.6


def from_deg(angle_deg: float) -> float:
    """Degrees to rad."""
    return angle_deg * (math.pi / 180.0)


def to_deg(angle: float) -> float:
    """Rad to degrees."""
    return angle * (180.0 / math.pi)
