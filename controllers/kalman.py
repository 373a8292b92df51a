"""Kalman filter of two bodies on a torsion bar, one period at a time, with gains as arrays.

``p`` is the record of the law that calls; it has step [7, 9], correction [7, 2] and outputs [2, 7].
"""

from __future__ import annotations

from typing import Any, NamedTuple

from steer_env.physics._jit import scalar


class Estimate(NamedTuple):
    """PLANT_STATES (motor torque at its shaft), hand torque and unknown load: rad, rad/s, N m."""

    steering_angle: float = 0.0
    steering_rate: float = 0.0
    pinion_angle: float = 0.0
    pinion_rate: float = 0.0
    motor_torque: float = 0.0
    hand: float = 0.0
    load: float = 0.0


@scalar
def _row(i: int, x: Estimate, command: float, known: float, p: Any) -> float:
    total: float = p.step[i, 7] * command + p.step[i, 8] * known
    for j in range(7):
        total += p.step[i, j] * x[j]
    return total


@scalar
def carried_on(x: Estimate, command: float, known: float, p: Any) -> Estimate:
    """The estimate one period on under a motor target and a known load in N m."""
    return Estimate(
        _row(0, x, command, known, p),
        _row(1, x, command, known, p),
        _row(2, x, command, known, p),
        _row(3, x, command, known, p),
        _row(4, x, command, known, p),
        _row(5, x, command, known, p),
        _row(6, x, command, known, p),
    )


@scalar
def _output(i: int, x: Estimate, p: Any) -> float:
    total = 0.0
    for j in range(7):
        total += p.outputs[i, j] * x[j]
    return total


@scalar
def corrected(x: Estimate, torque: float, angle: float, p: Any) -> Estimate:
    """The estimate after a measured torque (N m) and angle (rad)."""
    e, f, K = torque - _output(0, x, p), angle - _output(1, x, p), p.correction
    return Estimate(
        x.steering_angle + K[0, 0] * e + K[0, 1] * f,
        x.steering_rate + K[1, 0] * e + K[1, 1] * f,
        x.pinion_angle + K[2, 0] * e + K[2, 1] * f,
        x.pinion_rate + K[3, 0] * e + K[3, 1] * f,
        x.motor_torque + K[4, 0] * e + K[4, 1] * f,
        x.hand + K[5, 0] * e + K[5, 1] * f,
        x.load + K[6, 0] * e + K[6, 1] * f,
    )
