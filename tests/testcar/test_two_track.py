"""The two-track car: loads, mirror symmetry, and its limit, the linear single track."""

import numpy as np
import pytest

from steer_env.physics.linear import frequency_response, single_track_matrices
from steer_env.physics.two_track import TwoTrackState, two_track_rates, wheel_loads
from steer_env.physics.two_track_parameters import TwoTrack
from steer_env.physics.tyre import Tyre, cornering_stiffness
from steer_env.physics.vehicle import SingleTrack, SingleTrackState, single_track_rates
from steer_env.testcar.harmonics import VEHICLE_RECORD, car_harmonics, vehicle_rollout
from steer_env.units import GRAVITY

CAR = TwoTrack()
STIFF_TYRE = Tyre(trail=0.0)
# No roll steer, no compliance, no pneumatic trail, parallel steering: what is left is the single
# track.
PLAIN = CAR._replace(
    compliance_f=0.0,
    compliance_r=0.0,
    roll_steer_f=0.0,
    roll_steer_r=0.0,
    ackermann=0.0,
    front=STIFF_TYRE,
    rear=STIFF_TYRE,
)
STATES = (
    TwoTrackState(0.3, 0.2, 0.03, -0.1, 0.02, 0.03, 0.01, 0.02),
    TwoTrackState(-1.0, 0.5, -0.05, 0.4, -0.08, 0.01, 0.1, -0.03),
)


def single_track_of(p: TwoTrack) -> SingleTrack:
    """The single track that ``p`` becomes for small slip when its extras are switched off."""
    load_f = 0.5 * p.m * GRAVITY * p.l_r / (p.l_f + p.l_r)
    load_r = 0.5 * p.m * GRAVITY * p.l_f / (p.l_f + p.l_r)
    return SingleTrack(
        m=p.m,
        l_f=p.l_f,
        l_r=p.l_r,
        J_z=p.J_z,
        C_f=2.0 * cornering_stiffness(load_f, p.front),
        C_r=2.0 * cornering_stiffness(load_r, p.rear),
        sigma_f=p.front.relaxation,
        sigma_r=p.rear.relaxation,
        n_t=p.mechanical_trail,
        i_s=p.i_s,
    )


@pytest.mark.parametrize("x", STATES)
def test_loads_sum_to_the_weight(x: TwoTrackState) -> None:
    """Load transfer moves load, it makes none; catches a sign slip between left and right."""
    loads = wheel_loads(x, CAR)
    assert sum(loads) == pytest.approx(CAR.m * GRAVITY, rel=1e-12)
    assert loads.fl + loads.fr == pytest.approx(
        CAR.m * GRAVITY * CAR.l_r / (CAR.l_f + CAR.l_r), rel=1e-12
    )


@pytest.mark.parametrize("x", STATES)
def test_mirror_symmetry(x: TwoTrackState) -> None:
    """A mirrored state must move in mirror image: catches any left-right slip in forces, loads or
    steering.
    """
    v_y, r, roll, roll_rate, fl, fr, rl, rr = x
    mirrored = TwoTrackState(-v_y, -r, -roll, -roll_rate, -fr, -fl, -rr, -rl)
    rates, a_y, M_rack = two_track_rates(x, 0.07, 20.0, 100.0, CAR)
    other, other_a_y, other_M_rack = two_track_rates(mirrored, -0.07, 20.0, -100.0, CAR)
    assert (other_a_y, other_M_rack) == pytest.approx((-a_y, -M_rack), rel=1e-12)
    expected = TwoTrackState(
        *(-d for d in rates[:4]), -rates.slip_fr, -rates.slip_fl, -rates.slip_rr, -rates.slip_rl
    )
    assert tuple(other) == pytest.approx(tuple(expected), rel=1e-12, abs=1e-12)


def test_small_motion_without_roll_is_the_single_track() -> None:
    """Equation by equation: two independent derivations of lateral, yaw and slip rates."""
    p = PLAIN._replace(roll_arm=0.0)
    v_y, r, a_f, a_r, tyre_angle, speed = 2e-5, 1e-5, 3e-5, -2e-5, 4e-5, 25.0
    x = TwoTrackState(v_y, r, 0.0, 0.0, a_f, a_f, a_r, a_r)
    rates, a_y, M_rack = two_track_rates(x, tyre_angle, speed, 0.0, p)
    one = single_track_of(p)
    expected = single_track_rates(SingleTrackState(v_y, r, a_f, a_r), tyre_angle, speed, one)
    assert rates.lateral_speed == pytest.approx(expected.lateral_speed, rel=1e-6)
    assert rates.yaw_rate == pytest.approx(expected.yaw_rate, rel=1e-6)
    assert 0.5 * (rates.slip_fl + rates.slip_fr) == pytest.approx(expected.slip_front, rel=1e-6)
    assert 0.5 * (rates.slip_rl + rates.slip_rr) == pytest.approx(expected.slip_rear, rel=1e-6)
    assert a_y == pytest.approx((one.C_f * a_f + one.C_r * a_r) / one.m, rel=1e-6)
    assert M_rack == pytest.approx(one.C_f * one.n_t * a_f / one.i_s, rel=1e-6)


@pytest.mark.parametrize("frequency_Hz", [0.2, 1.0, 3.0])
def test_stiff_roll_is_the_single_track_over_frequency(frequency_Hz: float) -> None:
    """With roll springs a thousand times stiffer the simulated response must be the closed-form
    one.
    """
    p = PLAIN._replace(c_roll_f=3e7, c_roll_r=3e7, b_roll_f=1e5, b_roll_r=1e5)
    speed = 25.0
    h = car_harmonics(speed, 1e-4, frequency_Hz, p)
    closed = frequency_response(single_track_matrices(speed, single_track_of(p)), frequency_Hz)[
        0, :, 0
    ]
    measured = np.array([h.yaw_rate, h.lateral_acceleration, h.lateral_speed / speed]) / (
        h.pinion_angle / p.i_s
    )
    assert np.abs(measured / closed[:3] - 1.0).max() < 2e-3


def test_steady_cornering_balances_the_roll_moment() -> None:
    """A held turn near 3 m/s2: springs carry what inertia and gravity put on the roll axis, at an
    ordinary gradient.
    """
    record = vehicle_rollout(np.full(8000, 0.45), 20.0, CAR)
    a_y, roll = (
        record[-1, VEHICLE_RECORD.index(name)] for name in ("lateral_acceleration", "roll")
    )
    assert record[-1, VEHICLE_RECORD.index("yaw_rate")] * 20.0 == pytest.approx(a_y, rel=1e-4)
    assert 2.5 < a_y < 4.5
    stiffness = CAR.c_roll_f + CAR.c_roll_r - CAR.m_s * GRAVITY * CAR.roll_arm
    assert roll == pytest.approx(CAR.m_s * CAR.roll_arm * a_y / stiffness, rel=1e-3)
    assert 1.0 < np.rad2deg(roll) / (a_y / GRAVITY) < 6.0


def test_left_turn_loads_the_right_side() -> None:
    """ISO 8855 signs: positive lateral acceleration leans the body to the right."""
    x = TwoTrackState(0.0, 0.2, 0.0, 0.0, 0.03, 0.03, 0.03, 0.03)
    rates, a_y, M_rack = two_track_rates(x, 0.03, 20.0, 0.0, CAR)
    assert a_y > 0.0
    assert rates.roll_rate > 0.0
    assert M_rack > 0.0
    loads = wheel_loads(x._replace(roll=0.02), CAR)
    assert loads.fr > loads.fl
    assert loads.rr > loads.rl
