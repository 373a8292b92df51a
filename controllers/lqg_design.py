"""Kalman and LQ gains for lqg, from the plant's linear model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from controllers.blocks import Notch
from controllers.hardware import bar_notch
from controllers.kalman_design import discrete, kalman_gains, twist_matrices
from controllers.law import Gain, with_gains
from steer_env.plants import Plant


class Design(NamedTuple):
    """The weights: tuning axes of the controller; units as in LqgParameters."""

    effort: float
    corner: float
    hand: float = 30.0
    load: float = 3.0


def design(
    plant: Plant, causality: str, period: float, delay: float, weights: Mapping[str, Gain]
) -> tuple[Design, dict[str, Any]]:
    """(Weights, parameters of LqgParameters that follow from them)."""
    stiff = bar_notch(plant, period) != Notch()
    soft = 4.0 if causality == "impedance" else 3.0
    chosen = with_gains(Design(effort=0.1 if stiff else soft, corner=0.01 / delay), weights, "lqg")

    # Twist, its rate, the motor's torque and the integral of the torque error.
    A, B, torque = twist_matrices(plant)
    narrow = np.block([[A, np.zeros((3, 1))], [torque, np.zeros((1, 1))]])
    # Nothing weighs the integral at no corner: it stays out, or no gain would be the least.
    n = 4 if chosen.corner > 0.0 else 3
    A_t, B_t = discrete(narrow[:n, :n], np.vstack([B, [[0.0]]])[:n], period)
    cost = np.zeros((4, 4))
    cost[:3, :3] = torque.T @ torque
    cost[3, 3] = chosen.corner**2
    R = np.array([[(plant.steering.motor_ratio / chosen.effort) ** 2]])
    S = solve_discrete_are(A_t, B_t, cost[:n, :n], R)
    K = np.zeros(4)
    K[:n] = np.linalg.solve(R + B_t.T @ S @ B_t, B_t.T @ S @ A_t)[0]
    names = ("K_twist", "K_rate", "K_motor", "K_integral")
    found = {name: float(k) for name, k in zip(names, K, strict=True)}
    return chosen, {**kalman_gains(plant, period, chosen.hand, chosen.load), **found}
