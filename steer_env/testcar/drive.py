"""One planned run, driven and logged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from steer_env.manoeuvres import MANOEUVRES
from steer_env.testcar.kernel import machine_at, rollout
from steer_env.testcar.logger import disturbances, log
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import PlannedRun, robot_target
from steer_env.units import from_kmh


def generator_of(run: PlannedRun, seed: int) -> np.random.Generator:
    """The run's own random numbers: the same whatever else is driven."""
    manoeuvre = list(MANOEUVRES).index(run.manoeuvre)
    key = (round(1000.0 * run.speed_kmh), manoeuvre, run.number)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def drive(
    run: PlannedRun, car: VirtualCar, rng: np.random.Generator | None
) -> dict[str, NDArray[np.floating]]:
    """Columns of the run's file; ``rng`` None: no disturbance, and a clean log."""
    speed = from_kmh(run.speed_kmh)
    target, rate = robot_target(run.manoeuvre, run.amplitude)
    road_torque, side_force = disturbances(len(target), car.disturbance, rng)
    record = rollout(target, rate, road_torque, side_force, speed, machine_at(speed, car))
    return log(record, speed, car.i_rp, rng)
