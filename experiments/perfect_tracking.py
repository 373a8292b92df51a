"""What no controller can mend: the wheel and an arm on the reference itself, perfectly tracked.

Wheel (with the arm's inertia, damping and stiffness), torsion bar and, in place of the lower body,
the reference of Eq. 10 with the assist's slope as its gain. Where friction sticks it is a spring, on
the wheel and in the reference. An arm that makes this unstable does so with any controller that
tracks well: a property of the reference, not a fault of the controller.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from experiments.linear_loop import AT_REST, BAR_TORQUE, PINION_RATE, WHEEL_RATE
from experiments.operating_points import Place
from steer_env.physics.driver import Driver
from steer_env.physics.linear import Matrices, frequency_response, reference_matrices

Array = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_reference = lru_cache(maxsize=256)(reference_matrices)
NO_ARM = Driver(J=0.0, b=0.0, k=0.0)


def tracked(place: Place, arm: Driver = NO_ARM) -> Matrices:
    """Hand torque in N m to wheel rate, pinion rate (rad/s) and torsion-bar torque (N m), as PORTS are.

    States: wheel angle and rate, then the reference's.
    """
    s, p = place.steering, place.reference
    A_ref, B_ref, _, _ = _reference(place.observation.speed, p, place.slope)
    friction = p.c_fric if place.stuck and p.linear < 0.5 and p.M_fric_C > 0.0 else 0.0
    spring = s.c_s_fric if place.stuck and s.M_s_fric > 0.0 else 0.0
    n = 2 + len(A_ref)
    bar = np.zeros(n)  # M_tb of the states
    bar[:4] = s.c_tb, s.b_tb, -s.c_tb, -s.b_tb
    A = np.zeros((n, n))
    A[2:, 2:] = A_ref
    A[2:] += B_ref @ bar[None, :]
    A[2:, 2] -= friction / place.slope * B_ref[:, 0]
    inertia = s.J_s + arm.J
    A[0, 1] = 1.0
    A[1] = -bar / inertia
    A[1, :2] -= np.array([arm.k + spring, arm.b + s.b_s]) / inertia
    B = np.zeros((n, 1))
    B[1, 0] = 1.0 / inertia
    return A, B, np.vstack([np.eye(n)[1], np.eye(n)[3], bar]), np.zeros((3, 1))


def impedances(place: Place, omega: Array) -> tuple[Complexes, Complexes]:
    """As ``linear_loop.impedances``, at omega [f] in rad/s and without an arm."""
    ports = frequency_response(tracked(place), omega / (2.0 * np.pi))[:, :, 0]
    return 1.0 / ports[:, WHEEL_RATE], ports[:, BAR_TORQUE] / ports[:, PINION_RATE]


def growths(place: Place, arms: Sequence[Driver]) -> Array:
    """Largest growth in 1/s with each arm [m], modes slower than AT_REST left out."""
    values = np.linalg.eigvals(np.stack([tracked(place, arm)[0] for arm in arms]))
    return np.where(np.abs(values) > AT_REST, values.real, -np.inf).max(axis=1)
