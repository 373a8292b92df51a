"""The state-space views against matrices typed from the paper (Eqs. 6 and 10)."""

from __future__ import annotations

import control
import numpy as np
import pytest

from steer_env.physics import linear
from steer_env.physics.reference import ReferenceParameters
from steer_env.physics.vehicle import SingleTrack
from steer_env.plants import Reference

SPEEDS = [4.0, 12.5, 75.0 / 3.6, 105.0 / 3.6]


def eq_6(v: float, p: SingleTrack) -> tuple[np.ndarray, np.ndarray]:
    A = np.array(
        [
            [0.0, -v, p.C_f / p.m, p.C_r / p.m],
            [0.0, 0.0, p.C_f * p.l_f / p.J_z, -p.C_r * p.l_r / p.J_z],
            [-1.0 / p.sigma_f, -p.l_f / p.sigma_f, -v / p.sigma_f, 0.0],
            [-1.0 / p.sigma_r, p.l_r / p.sigma_r, 0.0, -v / p.sigma_r],
        ]
    )
    return A, np.array([[0.0], [0.0], [v / p.sigma_f], [0.0]])


def eq_10(v: float, p: ReferenceParameters) -> tuple[np.ndarray, np.ndarray]:
    """States pinion angle and rate, lateral speed, yaw rate, slips, as the paper orders them."""
    cf = p.C_f * p.n_t / p.i_s
    c, J = p.C_f, p.J_ref
    if p.relaxed:
        load = [-p.c_extra / J, -p.b_ref / J, 0.0, 0.0, -cf / J, 0.0]
    else:
        stiffness = cf / p.i_s + p.c_extra
        load = [-stiffness / J, -p.b_ref / J, cf / (J * v), cf * p.l_f / (J * v), 0.0, 0.0]
    A = np.array(
        [
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            load,
            [0.0, 0.0, 0.0, -v, c / p.m, p.C_r / p.m],
            [0.0, 0.0, 0.0, 0.0, c * p.l_f / p.J_z, -p.C_r * p.l_r / p.J_z],
            [v / (p.i_s * p.sigma_f), 0.0, -1 / p.sigma_f, -p.l_f / p.sigma_f, -v / p.sigma_f, 0.0],
            [0.0, 0.0, -1 / p.sigma_r, p.l_r / p.sigma_r, 0.0, -v / p.sigma_r],
        ]
    )
    return A, np.array([[0.0], [(1.0 + p.k_gain) / J], [0.0], [0.0], [0.0], [0.0]])


@pytest.mark.parametrize("speed", SPEEDS)
def test_vehicle_matrices_are_eq_6(speed):
    """Catches a sign or a swapped axle in the single track, by a second derivation."""
    p = SingleTrack(l_f=1.2, l_r=1.6)
    A, B, C, D = linear.single_track_matrices(speed, p)
    expected_A, expected_B = eq_6(speed, p)
    np.testing.assert_allclose(A, expected_A, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(B, expected_B, rtol=1e-12, atol=1e-12)
    outputs = [
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, p.C_f / p.m, p.C_r / p.m],
        [1.0 / speed, 0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]
    np.testing.assert_allclose(C, outputs, rtol=1e-12, atol=1e-12)
    assert not D.any()


@pytest.mark.parametrize("relaxed", [0.0, 1.0])
@pytest.mark.parametrize("speed", SPEEDS)
def test_reference_matrices_are_eq_10(speed, relaxed):
    """Catches the two slip forms mixed up, and c_extra or the gain in the wrong place."""
    p = ReferenceParameters(relaxed=relaxed, c_extra=1.6)
    A, B, C, D = linear.reference_matrices(speed, p, 1.0 + p.k_gain)
    expected_A, expected_B = eq_10(speed, p)
    np.testing.assert_allclose(A, expected_A, rtol=1e-11, atol=1e-10)
    np.testing.assert_allclose(B, expected_B, rtol=1e-12)
    np.testing.assert_allclose(C, np.eye(6)[:2], atol=1e-15)
    assert not D.any()


def test_steady_state_of_the_vehicle_is_the_textbook_yaw_gain():
    """psi_dot / delta = v / (L + K v^2) with K = m (l_r C_r - l_f C_f) / (L C_f C_r)."""
    p, v = SingleTrack(), 25.0
    A, B, C, _ = linear.single_track_matrices(v, p)
    gain = (C @ -np.linalg.solve(A, B))[0, 0]
    L = p.l_f + p.l_r
    K = p.m * (p.l_r * p.C_r - p.l_f * p.C_f) / (L * p.C_f * p.C_r)
    assert gain == pytest.approx(v / (L + K * v * v), rel=1e-10)


def test_frequency_response_is_that_of_python_control():
    """Catches a transposed axis or Hz taken for rad/s; to_statespace is the same system."""
    speed, reference = 75.0 / 3.6, Reference()
    p = reference.at(speed)
    frequencies = np.array([0.2, 1.0, 4.3])
    ours = linear.frequency_response(
        linear.reference_matrices(speed, p, 1.0 + p.k_gain), frequencies
    )
    system = reference.to_statespace(speed)
    theirs = control.frequency_response(system, 2.0 * np.pi * frequencies).complex
    np.testing.assert_allclose(ours[:, :, 0].T, theirs[:, 0, :], rtol=1e-9)
    assert system.input_labels == ["torsion_bar_torque"]
    assert system.output_labels == ["pinion_angle", "pinion_rate"]
    assert system.state_labels == list(linear.REFERENCE_STATES)


def test_differences_all_at_once_are_those_one_by_one():
    """Catches a transposed matrix, and a sum in another order."""
    A = np.random.default_rng(2).normal(size=(3, 4))

    def rows(z):
        return [a[0] * z[0] + a[1] * z[1] + a[2] * z[2] + a[3] * z[3] for a in A]

    at_once = linear.jacobian_at_once(rows, 4)
    assert (at_once == linear.jacobian(rows, 4)).all()
    assert (at_once == A).all()
