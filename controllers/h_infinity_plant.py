"""The generalised plant of h_infinity: hardware, arm, delay, what the law adds by itself, and the weights.

The law adds to its H-infinity part v a feed-forward of the motion that the reference has under the
measured torque,

    a = M_tb / J_f - (b_ref w + c d) / J_ref,    v_ff = J_pin a + b_pin w + share c J_pin d - M_tb,

with J_f = J_ref / (dM_eff/dM_tb) the felt inertia, w and d the integrals of a. Both measured signals
are made of that: e = d less the pinion's angle, and v_ff, in which the sensed torque is.

Disturbances: torque of the hand, torque at the lower body, noise of e and of v_ff. Results, each at
most gamma for disturbances of size 1:

    error       accuracy J_f (e'' + 2 z n e' + n^2 e), the torque that the angle error stands for, below
                ``bandwidth``, with its integral
    arm         inertia of wheel and arm between the bare wheel and the heaviest arm: with 1/J = (1 + r q) / J_0,
                |q| <= 1, it is a torque q (r M_tb) beside the hand's, so that the loop is stable with
                all of them where r M_tb stays below the hand's torque
    gain        v + v_ff through a high-pass as large as the error of the motor's path may be: stable
                with all such errors while below the torque at the lower body
    inertia     as arm, for the inertia of the lower body

``load`` scales the torque at the lower body against the hand's; gain and inertia are divided by it,
so that what they say does not depend on it.

Scalar equations, differentiated (steer_env.physics.linear.jacobian). Between the torque that is
ordered and the one that arrives two ports stay open: for the design a Padé approximation of the delay
goes there, for the check the delay itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.synthesis import Matrix, Problem
from steer_env.physics.linear import jacobian, plant_matrices
from steer_env.plants import Plant

ARM_LIMIT = 0.135  # kg m2, the heaviest arm that holds the wheel
ARM_STIFFNESS, ARM_DAMPING = 7.0, 4.0  # N m/rad, N m s/rad: a relaxed arm's, damped so that its mode leaves no trace
DAMPING_RATIO = 0.7  # z of the error's weight
STEEPEST = 3000.0  # rad/s, where the gain's weight ends
LEAK = 0.2  # 1/s, of the integral, which may not be one
DISTURBANCES = ("hand", "load", "angle_noise", "torque_noise")
RESULTS = ("error", "arm", "gain", "inertia")
STATES = 12  # hardware 5, reference 2, weights 5


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
    late: float
    heavy: float


class Felt(NamedTuple):
    """The reference as the design sees it: b_ref / J_ref in 1/s and c / J_ref in 1/s2."""

    damping: float
    stiffness: float


class Ports(NamedTuple):
    """x' = A x + B (disturbances, v, arrived), (results, e, v_ff, ordered) = C x + D (...)."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


def arm_range(plant: Plant) -> tuple[float, float]:
    """(J_0, r): nominal inertia of wheel and arm in kg m2, and how far its inverse goes, as a share."""
    light, heavy = 1.0 / plant.steering.J_s, 1.0 / (plant.steering.J_s + ARM_LIMIT)
    return 2.0 / (light + heavy), (light - heavy) / (light + heavy)


def ports(plant: Plant, felt: Felt, w: Weights, leak: float) -> Ports:
    """The generalised plant; ``leak`` in 1/s draws d and w to the measured motion (impedance)."""
    s, share = plant.steering, plant.rack_share
    J_0, r = arm_range(plant)
    A, B, C, _ = plant_matrices(s._replace(J_pin=w.heavy * s.J_pin), plant.motor, J_0 - s.J_s)
    spring = share * felt.stiffness * s.J_pin
    ratio = STEEPEST / w.gain_bandwidth * math.sqrt(1.0 / w.gain_error - 1.0)

    def flow(x: NDArray[np.float64]) -> Sequence[float]:
        body, (angle, rate, slow_1, slow_2, integral, high_1, high_2) = x[:5], x[5:STATES]
        hand, load, angle_noise, torque_noise, v, arrived = x[STATES:]
        M_tb = float(C[0] @ body)
        a = M_tb / w.felt_inertia - felt.damping * rate - felt.stiffness * angle
        forward = s.J_pin * a + s.b_pin * rate + spring * angle - M_tb
        ordered = v + forward
        rack = spring * body[2]
        grip = hand - ARM_STIFFNESS * body[0] - ARM_DAMPING * body[1]
        moved = A @ body + B @ np.array([arrived / s.motor_ratio, grip, w.load * load + rack])
        e, e_rate = angle - body[2], rate - body[3]
        e_acceleration = a - leak * e_rate - moved[3]
        back = w.natural * w.natural * e + 2.0 * DAMPING_RATIO * w.natural * e_rate
        error = w.accuracy * w.felt_inertia * (e_acceleration + back)
        net = M_tb + s.motor_ratio * body[4] - s.b_pin * body[3] - rack
        first = high_1 + ratio * (ordered - high_1)
        second = high_2 + ratio * (first - high_2)
        rates = [*moved, rate - leak * e, a - leak * e_rate]
        rates += [w.bandwidth * (error - slow_1), w.bandwidth * (slow_1 - slow_2)]
        rates += [w.integral * slow_2 - LEAK * integral, STEEPEST * (ordered - high_1), STEEPEST * (first - high_2)]
        results = [slow_2 + integral, r * M_tb, w.gain_error * second / w.load, w.inertia_error * net / w.load]
        seen = [e + w.angle_noise * angle_noise, forward + w.torque_noise * torque_noise]
        return [*rates, *results, *seen, ordered]

    J, n = jacobian(flow, STATES + 6), STATES
    return Ports(J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:])


def delay(plant: Plant, period: float) -> float:
    """Seconds from a motion to the torque that answers it, without the motor's lag: delays and half a hold."""
    sensors = plant.sensors
    return (max(sensors.angle_delay, sensors.torque_delay) + plant.motor.dead_time + 0.5) * period


def problem(p: Ports, time: float) -> Problem:
    """The ports closed by the Padé approximation of second order of a delay of ``time`` s."""
    a, late = 1.0 / time, np.array([[0.0, -12.0]])
    # q_1' = a q_2, q_2' = a (ordered - 12 q_1 - 6 q_2), arrived = ordered - 12 q_2.
    own, enter = a * np.array([[0.0, 1.0], [-12.0, -6.0]]), a * np.array([[0.0], [1.0]])
    disturbances, v, arrives = p.B[:, :4], p.B[:, 4:5], p.B[:, 5:]
    ordered, direct = p.C[6:], p.D[6:, 4:5]
    return Problem(
        A=np.block([[p.A + arrives @ ordered, arrives @ late], [enter @ ordered, own]]),
        B1=np.vstack([disturbances, np.zeros((2, 4))]),
        B2=np.vstack([v + arrives @ direct, enter @ direct]),
        C1=np.hstack([p.C[:4], np.zeros((4, 2))]),
        C2=np.hstack([p.C[4:6], np.zeros((2, 2))]),
        D12=p.D[:4, 4:5],
        D21=p.D[4:6, :4],
    )
