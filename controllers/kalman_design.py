"""Discrete models for a design, from the plant's linear model (steer_env.physics.linear): filter and twist."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from steer_env.physics.linear import plant_matrices
from steer_env.plants import Plant

Matrix = NDArray[np.float64]
HAND_INERTIA = 0.05  # kg m2 on the wheel that the design counts with: a light grip


def discrete(A: Matrix, B: Matrix, period: float) -> tuple[Matrix, Matrix]:
    """Matrices one period on, inputs held."""
    n, m = B.shape
    both = expm(period * np.block([[A, B], [np.zeros((m, n + m))]]))
    return both[:n, :n], both[:n, n:]


def kalman_gains(plant: Plant, period: float, hand: float, load: float) -> dict[str, Any]:
    """The arrays that controllers.kalman reads: step [7, 9], correction [7, 2], outputs [2, 7].

    ``hand`` and ``load`` are the wander of the hand's torque and of the unknown load in N m per root s.
    """
    A, B, C, _ = plant_matrices(plant.steering, plant.motor, HAND_INERTIA)
    # Hand torque and unknown load as states that wander.
    wide = np.block([[A, B[:, 1:]], [np.zeros((2, 7))]])
    step, held = discrete(wide, np.vstack([B[:, [0, 2]], np.zeros((2, 2))]), period)
    outputs = np.hstack([C, np.zeros((2, 2))])
    sensors = plant.sensors
    noise = [
        sensors.torque_noise**2 + sensors.torque_step**2 / 12.0 + 1e-6,
        sensors.angle_noise**2 + sensors.angle_step**2 / 12.0 + 1e-10,
    ]
    wander = np.diag([0.0, 0.0, 0.0, 0.0, 1e-8, hand**2 * period, load**2 * period])
    P = solve_discrete_are(step.T, outputs.T, wander, np.diag(noise))
    correction = P @ outputs.T @ np.linalg.inv(outputs @ P @ outputs.T + np.diag(noise))
    return {"step": np.hstack([step, held]), "correction": correction, "outputs": outputs}


def twist_matrices(plant: Plant) -> tuple[Matrix, Matrix, Matrix]:
    """(A [3, 3], B [3, 1], C [1, 3]) of twist in rad, its rate and the motor's torque: motor target to M_tb.

    What the two bodies do together is left out: the twist answers to it only through their damping.
    """
    A, B, C, _ = plant_matrices(plant.steering, plant.motor, HAND_INERTIA)
    pick = np.array([[1.0, 0, -1.0, 0, 0], [0, 1.0, 0, -1.0, 0], [0, 0, 0, 0, 1.0]])
    place = np.linalg.pinv(pick)
    return pick @ A @ place, pick @ B[:, :1], C[:1] @ place
