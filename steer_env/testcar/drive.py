"""One planned run, driven and logged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics.effects import SensorError
from steer_env.physics.effects.vehicle_ports import effect_row
from steer_env.physics.effects.vehicle_table import VEHICLE_EFFECTS
from steer_env.testcar.kernel import machine_at, rollout
from steer_env.testcar.logger import ALIKE_CHANNELS, CHANNELS, Channel, disturbances, log
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import PlannedRun, robot_target
from steer_env.units import from_kmh


def generator_of(run: PlannedRun, seed: int) -> np.random.Generator:
    """The run's own random numbers: the same whatever else is driven."""
    manoeuvre = list(MANOEUVRES).index(run.manoeuvre)
    key = (round(1000.0 * run.speed_kmh), manoeuvre, run.number)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


class Hidden(NamedTuple):
    """What a blind test hides in a car and its logger: the effects' row and sensor errors, and plain channels."""

    row: NDArray[np.floating] | None = None
    errors: tuple[tuple[SensorError, Any], ...] = ()
    channels: tuple[Channel, ...] = CHANNELS


NOTHING = Hidden()


def hidden_of(present: Mapping[str, Mapping[str, float]]) -> Hidden:
    """The hidden part of a blind test from effects by name, as parameters; channels are late alike."""
    errors = tuple(
        (effect.sensor, effect.at(present[name]))
        for name, effect in VEHICLE_EFFECTS.items()
        if name in present and effect.sensor is not None
    )
    mechanical = any(VEHICLE_EFFECTS[name].ports for name in present)
    return Hidden(effect_row(present) if mechanical else None, errors, ALIKE_CHANNELS)


def drive(
    run: PlannedRun, car: VirtualCar, rng: np.random.Generator | None, hidden: Hidden = NOTHING
) -> dict[str, NDArray[np.floating]]:
    """Columns of the run's file; ``rng`` None: no disturbance, and a clean log."""
    speed = from_kmh(run.speed_kmh)
    target, rate = robot_target(run.manoeuvre, run.amplitude)
    road_torque, side_force = disturbances(len(target), car.disturbance, rng)
    record = rollout(target, rate, road_torque, side_force, speed, machine_at(speed, car), hidden.row)
    return log(record, speed, car.i_rp, rng, hidden.channels, hidden.errors)
