"""The generalised plant of h_infinity: hardware, arm, delay, what the law adds by itself, and the weights.

The law adds to its H-infinity part v a feed-forward of the acceleration that the reference would
have under the measured torque,

    a = M_tb / J_f - (b_ref w + c d) / J_ref,    v_ff = J_pin a + b_pin w + share c d - M_tb,

with J_f = J_ref / (dM_eff/dM_tb) the felt inertia, at the reference's motion (admittance) or at the
measured one (impedance). The reference's angle is a twice integrated; the two measured signals are
its distance to the pinion's angle and v_ff, in which the sensed torque sits.

Disturbances w: torque of the hand, torque at the lower body, noise of angle and of torque.
Results z, each at most 1 for w at most 1 where gamma is 1:

    error       accuracy J_f (e'' + 2 z n e' + n^2 e), the torque that the angle error stands for,
                below ``bandwidth``, and its integral
    arm         inertia of wheel and arm between bare wheel and the heaviest arm: 1/J = (1 + r d) / J_0,
                |d| < 1, is a torque d (r M_tb) beside the hand's: stable with all where r M_tb / M_hand < 1
    gain        v + v_ff through a high-pass that says how well the motor's path is known: stable while
                its error is less than the weight
    inertia     the same as arm for the lower body

Written as scalar equations and differentiated (steer_env.physics.linear.jacobian). Everything goes
through two ports besides: the torque that is ordered and the one that arrives, between which a Padé
approximation of the delay is put for the design, and the delay itself to check it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.synthesis import Matrix, Problem
from steer_env.physics.linear import jacobian, plant_matrices
from steer_env.plants import Plant

ARM_LIMIT = 0.135  # kg m2, the heaviest arm that holds the wheel; the design's spring and damper are a relaxed one's
ARM_STIFFNESS, ARM_DAMPING = 7.0, 4.0  # N m/rad, N m s/rad
DAMPING_RATIO = 0.7  # z of the error's weight
STEEPEST = 3000.0  # rad/s, where the gain's weight ends
LEAK = 0.2  # 1/s, of the integral, which may not be one
RESULTS = ("error", "arm", "gain", "inertia")
DISTURBANCES = ("hand", "load", "angle_noise", "torque_noise")
N_BODY, N_DELAY, N_WEIGHTS = 7, 2, 5  # states: hardware (5) and reference (2), Padé, weights


class Weights(NamedTuple):
    """What is asked for; the tuning axes of the controller. Units as in HInfinityParameters."""

    felt_inertia: float
    accuracy: float
    natural: float
    bandwidth: float
    integral: float
    gain_error: float
    gain_bandwidth: float
    inertia_error: float
    load: float
    angle_noise: float
    torque_noise: float
    late: float = 0.0


class Felt(NamedTuple):
    """The reference as the design sees it: b_ref / J_ref in 1/s and c / J_ref in 1/s2."""

    damping: float
    stiffness: float


class Ports(NamedTuple):
    """x' = A x + B (w, v, arrived), (z, y, ordered) = C x + D (w, v, arrived)."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


def arm_range(plant: Plant) -> tuple[float, float]:
    """(Nominal inertia of wheel and arm in kg m2, r): the inverse inertia is (1 +- r) / nominal."""
    light, heavy = 1.0 / plant.steering.J_s, 1.0 / (plant.steering.J_s + ARM_LIMIT)
    return 2.0 / (light + heavy), (light - heavy) / (light + heavy)


def ports(plant: Plant, felt: Felt, w: Weights, impedance: bool, leak: float) -> Ports:
    """The generalised plant with the delay's two ports open; ``leak`` in 1/s as in the law (impedance)."""
    s = plant.steering
    J_0, r = arm_range(plant)
    A, B, C, _ = plant_matrices(s, plant.motor, J_0 - s.J_s)
    share, own = plant.rack_share, felt.stiffness * s.J_pin
    pull = leak if impedance else 0.0
    low = w.gain_bandwidth / math.sqrt(1.0 / w.gain_error - 1.0)
    n = N_BODY + N_WEIGHTS

    def flow(x: NDArray[np.float64]) -> Any:
        body, (angle, rate, slow_1, slow_2, integral, high_1, high_2) = x[:5], x[5:n]
        hand, load, angle_noise, torque_noise, v, arrived = x[n:]
        M_tb = float(C[0] @ body)
        a = M_tb / w.felt_inertia - felt.damping * rate - felt.stiffness * angle
        forward = s.J_pin * a + s.b_pin * rate + share * own * angle - M_tb
        ordered = v + forward
        grip = hand - ARM_STIFFNESS * body[0] - ARM_DAMPING * body[1]
        rack = share * own * body[2]
        moved = A @ body + B @ np.array([arrived / s.motor_ratio, grip, w.load * load + rack])
        e, e_rate = angle - body[2], rate - body[3]
        e_acceleration = a - pull * e_rate - moved[3]
        stiffness = w.natural * w.natural * e + 2.0 * DAMPING_RATIO * w.natural * e_rate
        error = w.accuracy * w.felt_inertia * (e_acceleration + stiffness)
        net = M_tb + s.motor_ratio * body[4] - s.b_pin * body[3] - rack
        ratio = STEEPEST / low
        first = high_1 + ratio * (ordered - high_1)
        second = high_2 + ratio * (first - high_2)
        rates = (
            *moved, rate - pull * e, a - pull * e_rate,
            w.bandwidth * (error - slow_1), w.bandwidth * (slow_1 - slow_2), w.integral * slow_2 - LEAK * integral,
            STEEPEST * (ordered - high_1), STEEPEST * (first - high_2),
        )  # fmt: skip
        z = slow_2 + integral, r * M_tb, w.gain_error * second / w.load, w.inertia_error * net / w.load
        y = e + w.angle_noise * angle_noise, forward + w.torque_noise * torque_noise
        return (*rates, *z, *y, ordered)

    J = jacobian(flow, n + 6)
    return Ports(J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:])


def delay(plant: Plant, period: float) -> float:
    """Seconds from a motion to the torque that answers it, without the motor's lag: delays and half a hold."""
    sensors = plant.sensors
    return (max(sensors.angle_delay, sensors.torque_delay) + plant.motor.dead_time + 0.5) * period


def problem(p: Ports, time: float) -> Problem:
    """The ports closed by a Padé approximation of second order of a delay of ``time`` s."""
    n, a = len(p.A), 1.0 / time
    w, v = slice(0, 4), slice(4, 5)
    z, y = slice(0, 4), slice(4, 6)
    ordered, arrives = slice(6, 7), slice(5, 6)
    # q' = a (q_2, -12 q_1 - 6 q_2 + ordered), arrived = ordered - 12 q_2.
    inner, enter, leave = np.array([[0.0, a], [-12.0 * a, -6.0 * a]]), np.array([[0.0], [a]]), np.array([[0.0, -12.0]])
    B_in, C_out, D_v = p.B[:, arrives], p.C[ordered], p.D[ordered, v]
    A = np.block([[p.A + B_in @ C_out, B_in @ leave], [enter @ C_out, inner]])
    B1 = np.vstack([p.B[:, w], np.zeros((2, 4))])
    B2 = np.vstack([p.B[:, v] + B_in @ D_v, enter @ D_v])
    C1, C2 = (np.hstack([p.C[rows], np.zeros((len(p.C[rows]), 2))]) for rows in (z, y))
    assert len(A) == n + N_DELAY
    return Problem(A, B1, B2, C1, C2, p.D[z, v], p.D[y, w])
