"""Kalman and LQ gains for lqg, from the plant's linear model (steer_env.physics.linear)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from controllers.blocks import Notch
from controllers.hardware import bar_notch
from controllers.law import Gain, with_gains
from steer_env.physics.linear import plant_matrices
from steer_env.plants import Plant

Matrix = NDArray[np.float64]
HAND_INERTIA = 0.05  # kg m2 on the wheel that the design counts with: a light grip


class Design(NamedTuple):
    """The weights: tuning axes of the controller; units as in LqgParameters."""

    effort: float
    corner: float
    hand: float = 30.0
    load: float = 3.0


def discrete(A: Matrix, B: Matrix, period: float) -> tuple[Matrix, Matrix]:
    """Matrices one period on, inputs held."""
    n, m = B.shape
    both = expm(period * np.block([[A, B], [np.zeros((m, n + m))]]))
    return both[:n, :n], both[:n, n:]


def design(
    plant: Plant, causality: str, period: float, delay: float, weights: Mapping[str, Gain]
) -> tuple[Design, dict[str, Any]]:
    """(Weights, parameters of LqgParameters that follow from them)."""
    stiff = bar_notch(plant, period) != Notch()
    soft = 4.0 if causality == "impedance" else 3.0
    chosen = with_gains(Design(effort=0.1 if stiff else soft, corner=0.01 / delay), weights, "lqg")
    A, B, C, _ = plant_matrices(plant.steering, plant.motor, HAND_INERTIA)
    A, B = np.asarray(A), np.asarray(B)
    # Hand torque and unknown load as states that wander.
    wide = np.block([[A, B[:, 1:]], [np.zeros((2, 7))]])
    step, held = discrete(wide, np.vstack([B[:, [0, 2]], np.zeros((2, 2))]), period)
    outputs = np.hstack([C, np.zeros((2, 2))])
    sensors = plant.sensors
    noise = [
        sensors.torque_noise**2 + sensors.torque_step**2 / 12.0 + 1e-6,
        sensors.angle_noise**2 + sensors.angle_step**2 / 12.0 + 1e-10,
    ]
    wander = np.diag([0.0, 0.0, 0.0, 0.0, 1e-8, chosen.hand**2 * period, chosen.load**2 * period])
    P = solve_discrete_are(step.T, outputs.T, wander, np.diag(noise))
    correction = P @ outputs.T @ np.linalg.inv(outputs @ P @ outputs.T + np.diag(noise))

    # Twist, its rate, the motor's torque and the integral of the torque error.
    pick = np.array([[1.0, 0, -1.0, 0, 0], [0, 1.0, 0, -1.0, 0], [0, 0, 0, 0, 1.0]])
    place = np.linalg.pinv(pick)
    torque = C[:1] @ place
    narrow = np.block([[pick @ A @ place, np.zeros((3, 1))], [torque, np.zeros((1, 1))]])
    A_t, B_t = discrete(narrow, np.vstack([pick @ B[:, :1], [[0.0]]]), period)
    cost = np.zeros((4, 4))
    cost[:3, :3] = torque.T @ torque
    cost[3, 3] = chosen.corner**2
    R = np.array([[(plant.steering.motor_ratio / chosen.effort) ** 2]])
    S = solve_discrete_are(A_t, B_t, cost, R)
    K = np.linalg.solve(R + B_t.T @ S @ B_t, B_t.T @ S @ A_t)[0]
    names = ("K_twist", "K_rate", "K_motor", "K_integral")
    found = {name: float(k) for name, k in zip(names, K, strict=True)}
    return chosen, {"step": np.hstack([step, held]), "correction": correction, "outputs": outputs, **found}
