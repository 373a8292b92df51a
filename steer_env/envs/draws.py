"""What an episode draws at random where its task says so."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from steer_env.envs.layout import CarSpread
from steer_env.errors import InputError
from steer_env.physics.driver import Driver
from steer_env.plants import DRIVERS, Reference
from steer_env.units import from_kmh

RANDOMISABLE = ("plant", "driver", "car", "speed", "manoeuvre")
CAR_FACTORS = {
    "mass": (0.9, 1.2),
    "grip": (0.8, 1.15),
    "trail": (0.85, 1.15),
}  # assumption: load, tyres, pressure
RANDOM_ARMS = ("one_hand_light", "relaxed", "tense")


def randomised_names(randomise: str | Iterable[str]) -> tuple[str, ...]:
    """Names out of RANDOMISABLE; an unknown one is an InputError."""
    names = (randomise,) if isinstance(randomise, str) else tuple(randomise)
    if names == ("all",):
        return RANDOMISABLE
    for name in names:
        if name not in RANDOMISABLE:
            raise InputError("randomise", f"{name!r} is not known", f"use 'all' or names out of {RANDOMISABLE}")
    return names


def random_speed(reference: Reference, rng: np.random.Generator) -> float:
    """A speed in m/s that the reference knows."""
    known = [row.speed_kmh for row in reference.file.rows]
    return from_kmh(rng.uniform(min(known), max(known)))


def random_car(rng: np.random.Generator) -> CarSpread:
    """A car that is not quite the one that the reference was identified on."""
    return CarSpread(**{name: rng.uniform(*span) for name, span in CAR_FACTORS.items()})


def random_driver(rng: np.random.Generator) -> Driver:
    """A blend of two arms of the grid."""
    first, second = rng.integers(0, len(RANDOM_ARMS), 2).tolist()
    share = rng.uniform()
    a, b = DRIVERS[RANDOM_ARMS[first]], DRIVERS[RANDOM_ARMS[second]]
    return Driver(*(x + share * (y - x) for x, y in zip(a, b, strict=True)))
