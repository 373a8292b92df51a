"""State-space views of the equations: the scalar functions differentiated, never retyped.

The functions are linear (or linearised about rest), so a unit step in one variable is its column of
the matrix, exact to rounding. Matrices come as numpy arrays (A [n, n], B [n, n_u], C [n_y, n], D
[n_y, n_u]); ``to_statespace`` names them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.physics import vehicle
from steer_env.physics.motor import Motor
from steer_env.physics.reference import (
    ReferenceParameters,
    reference_load,
    reference_rates,
    single_track_of,
)
from steer_env.physics.steering import Steering, SteeringMotion, steering_rates, torsion_bar_torque
from steer_env.physics.vehicle import SingleTrack, SingleTrackState

Matrix = NDArray[np.float64]
Matrices = tuple[Matrix, Matrix, Matrix, Matrix]

VEHICLE_OUTPUTS = ("yaw_rate", "lateral_acceleration", "sideslip_angle", "slip_front")
PLANT_STATES = ("steering_angle", "steering_rate", "pinion_angle", "pinion_rate", "motor_torque")
PLANT_OUTPUTS = ("torsion_bar_torque", "pinion_angle")
REFERENCE_STATES = (
    "pinion_angle",
    "pinion_rate",
    "lateral_speed",
    "yaw_rate",
    "slip_front",
    "slip_rear",
)


def jacobian(function: Callable[[NDArray[np.float64]], Sequence[float]], n: int, step: float = 1.0) -> Matrix:
    """Matrix of a linear map of n variables: central differences about zero with the given step."""
    columns = []
    for k in range(n):
        unit = np.zeros(n)
        unit[k] = step
        columns.append((np.asarray(function(unit)) - np.asarray(function(-unit))) / (2.0 * step))
    return np.column_stack(columns)


def jacobian_at_once(function: Callable[[Matrix], Sequence[Any]], n: int) -> Matrix:
    """As ``jacobian`` of a function without choices: it takes a column of arrays, and all differences in one call."""
    unit = np.eye(n)
    return (np.array(function(unit)) - np.array(function(-unit))) / 2.0


def single_track_matrices(speed: float, p: SingleTrack) -> Matrices:
    """Eq. 6 from road-wheel angle in rad to VEHICLE_OUTPUTS at a speed > 0 in m/s."""

    def rates(z: Matrix) -> Sequence[Any]:
        return vehicle.single_track_rates(SingleTrackState(*z[:4]), z[4], speed, p)

    def outputs(z: Matrix) -> Sequence[Any]:
        x = SingleTrackState(*z[:4])
        return (
            x.yaw_rate,
            vehicle.lateral_acceleration(x, p),
            x.lateral_speed / speed,
            x.slip_front,
        )

    return _split(jacobian_at_once(rates, 5), jacobian_at_once(outputs, 5), 4)


def load_matrices(speed: float, p: ReferenceParameters) -> Matrices:
    """Eqs. 6 and 9: pinion angle in rad to load at the pinion, M_rack + c_extra d, in N m."""

    def rates(z: Matrix) -> Sequence[Any]:
        return vehicle.single_track_rates(SingleTrackState(*z[:4]), z[4] / p.i_s, speed, single_track_of(p))

    def outputs(z: Matrix) -> Sequence[Any]:
        return (reference_load(z[4], SingleTrackState(*z[:4]), speed, p),)

    return _split(jacobian_at_once(rates, 5), jacobian_at_once(outputs, 5), 4)


def reference_matrices(speed: float, p: ReferenceParameters, K: float) -> Matrices:
    """Eq. 10: torsion-bar torque in N m to pinion angle and rate, no friction; K = 1 + k_gain."""

    def rates(z: Matrix) -> Sequence[Any]:
        x = SingleTrackState(*z[2:6])
        acceleration, slip_rates = reference_rates(z[0], z[1], x, K * z[6], 0.0, speed, p)
        return (z[1], acceleration, *slip_rates)

    def outputs(z: Matrix) -> Sequence[Any]:
        return (z[0], z[1])

    return _split(jacobian_at_once(rates, 7), jacobian_at_once(outputs, 7), 6)


def plant_matrices(steering: Steering, motor: Motor, J_driver: float = 0.0, stuck: bool = False) -> Matrices:
    """Eq. 2 with the motor's lag: motor target, hand and load torque (N m) to PLANT_OUTPUTS.

    Frictions slide (constant, so they vanish here), or are ``stuck`` and act as their springs.
    """
    w = 2.0 * np.pi * motor.bandwidth_Hz
    c_s = steering.c_s_fric if stuck and steering.M_s_fric > 0.0 else 0.0
    c_p = steering.c_fric if stuck and steering.M_fric > 0.0 else 0.0

    def rates(z: NDArray[np.float64]) -> Sequence[float]:
        x = SteeringMotion(*z[:4])
        friction = c_s * x.steering_angle, c_p * x.pinion_angle
        return (*steering_rates(x, z[6], *friction, z[7], z[4], J_driver, steering), w * (z[5] - z[4]))

    def outputs(z: NDArray[np.float64]) -> Sequence[float]:
        return torsion_bar_torque(SteeringMotion(*z[:4]), steering), z[2]

    return _split(jacobian(rates, 8), jacobian(outputs, 8), 5)


def frequency_response(matrices: Matrices, frequency_Hz: ArrayLike) -> NDArray[np.complex128]:
    """C (jw - A)^-1 B + D at frequencies [n_f] in Hz, as [n_f, n_y, n_u]."""
    A, B, C, D = matrices
    s = 2j * np.pi * np.atleast_1d(np.asarray(frequency_Hz, dtype=float))[:, None, None]
    inputs = np.broadcast_to(B, (s.shape[0], *B.shape))
    return np.asarray(C @ np.linalg.solve(s * np.eye(len(A)) - A, inputs) + D, dtype=complex)


def _split(rates: Matrix, outputs: Matrix, n: int) -> Matrices:
    return rates[:, :n], rates[:, n:], outputs[:, :n], outputs[:, n:]
