"""Sequences of the physics as Python and as machine code: each `run_*` is both (`*_compiled`)."""

from __future__ import annotations

import numpy as np

from steer_env.physics._jit import compiled, scalar
from steer_env.physics.driver import Driver, Hand
from steer_env.physics.motor import Motor, lag_decay
from steer_env.physics.plant import PlantState, plant_step
from steer_env.physics.reference import (
    ReferenceParameters,
    ReferenceState,
    TrackMap,
    admittance_step,
    impedance_step,
)
from steer_env.physics.steering import Steering

REST = PlantState(*[0.0] * len(PlantState._fields))
GENERATOR_AT_REST = ReferenceState(*[0.0] * len(ReferenceState._fields))
RELEASED = Hand(0.0, 0.0, 0.0, 0.0)
NOBODY = Driver(0.0, 0.0, 0.0, 0.0)


@scalar
def run_plant(
    x: PlantState,
    hands: np.ndarray,
    targets: np.ndarray,
    speed: float,
    rack_share: float,
    steering: Steering,
    motor: Motor,
    driver: Driver,
    car: ReferenceParameters,
    h: float,
    states: np.ndarray,
) -> None:
    """Fill states [n + 1, 11] with hands [n, 4] and motor targets [n] over steps of h seconds."""
    decay = lag_decay(motor.bandwidth_Hz, 0.5 * h)
    for j in range(len(x)):
        states[0, j] = x[j]
    for k in range(len(targets)):
        hand = Hand(hands[k, 0], hands[k, 1], hands[k, 2], hands[k, 3])
        x = plant_step(x, targets[k], decay, hand, speed, rack_share, steering, driver, car, h)
        for j in range(len(x)):
            states[k + 1, j] = x[j]


@scalar
def run_impedance(
    motion: np.ndarray,
    x: ReferenceState,
    speed: float,
    p: ReferenceParameters,
    track: TrackMap,
    torques: np.ndarray,
) -> None:
    """Fill torques [n, 2] (M_tb, M_eff) for pinion angle, rate and acceleration [n, 3]."""
    for k in range(len(motion)):
        M_tb, M_eff, x = impedance_step(motion[k, 0], motion[k, 1], motion[k, 2], x, speed, p, track)
        torques[k, 0] = M_tb
        torques[k, 1] = M_eff


@scalar
def run_admittance(
    torques: np.ndarray,
    x: ReferenceState,
    speed: float,
    p: ReferenceParameters,
    dt: float,
    motion: np.ndarray,
) -> None:
    """Fill motion [n, 3] (pinion angle, rate, acceleration) for torsion-bar torques [n]."""
    for k in range(len(torques)):
        acceleration, x = admittance_step(torques[k], x, speed, p, dt)
        motion[k, 0] = x.pinion_angle
        motion[k, 1] = x.pinion_rate
        motion[k, 2] = acceleration


@compiled
def run_plant_compiled(x, hands, targets, speed, rack_share, steering, motor, driver, car, h, out):
    run_plant(x, hands, targets, speed, rack_share, steering, motor, driver, car, h, out)


@compiled
def run_impedance_compiled(motion, x, speed, p, track, torques):
    run_impedance(motion, x, speed, p, track, torques)


@compiled
def run_admittance_compiled(torques, x, speed, p, dt, motion):
    run_admittance(torques, x, speed, p, dt, motion)


def plant_run(
    x: PlantState,
    hands: np.ndarray,
    targets: np.ndarray,
    h: float,
    *,
    speed: float = 75.0 / 3.6,
    rack_share: float = 1.0,
    steering: Steering | None = None,
    motor: Motor | None = None,
    driver: Driver = NOBODY,
    car: ReferenceParameters | None = None,
    run=run_plant_compiled,
) -> np.ndarray:
    """States [n + 1, 11] of a plant driven by hands [n, 4] and motor targets [n]."""
    states = np.zeros((len(targets) + 1, len(x)))
    run(
        x,
        np.ascontiguousarray(hands),
        np.ascontiguousarray(targets),
        float(speed),
        float(rack_share),
        steering or Steering(),
        motor or Motor(),
        driver,
        car or ReferenceParameters(),
        float(h),
        states,
    )
    return states


def free(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Hands and motor targets of a plant that nobody touches for n steps."""
    return np.zeros((n, 4)), np.zeros(n)


def column(states: np.ndarray, name: str) -> np.ndarray:
    """One state of a plant over time."""
    return states[:, PlantState._fields.index(name)]
