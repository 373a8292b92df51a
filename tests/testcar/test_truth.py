"""The derived truth must describe the car it was derived from."""

import numpy as np
import pytest

from steer_env.physics.boost_map import smooth_boost
from steer_env.physics.friction import dahl_step
from steer_env.physics.linear import frequency_response, single_track_matrices
from steer_env.physics.vehicle import SingleTrack
from steer_env.testcar.harmonics import car_harmonics
from steer_env.testcar.kernel import PERIOD, RECORD, machine_at, rollout
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import SPEEDS_KMH, robot_target
from steer_env.testcar.truth import (
    SMALL,
    friction_truth,
    off_centre_ratio,
    reference_truth,
    truth_at,
    vehicle_truth,
)
from steer_env.units import from_kmh

CAR = VirtualCar()


def single_track(row: dict[str, float]) -> SingleTrack:
    v = CAR.vehicle
    return SingleTrack(
        v.m,
        v.l_f,
        v.l_r,
        row["J_z_kgm2"],
        row["C_f_N_per_rad"],
        row["C_r_N_per_rad"],
        row["sigma_f_m"],
        row["sigma_r_m"],
        row["n_t_m"],
        v.i_s,
    )


def answers(
    speed_kmh: float, frequency_Hz: float, amplitude: float
) -> tuple[np.ndarray, np.ndarray]:
    """(car, single track with the truth): yaw rate, lateral acceleration, sideslip, rack torque per
    road-wheel angle.
    """
    speed = from_kmh(speed_kmh)
    p = single_track(vehicle_truth(speed, amplitude, CAR.vehicle))
    h = car_harmonics(speed, amplitude, frequency_Hz, CAR.vehicle)
    tyre = h.pinion_angle / p.i_s
    car = (
        np.array([h.yaw_rate, h.lateral_acceleration, h.lateral_speed / speed, h.rack_torque])
        / tyre
    )
    closed = frequency_response(single_track_matrices(speed, p), frequency_Hz)[0, :, 0]
    return car, np.array([*closed[:3], p.C_f * p.n_t / p.i_s * closed[3]])


@pytest.mark.parametrize("speed_kmh", SPEEDS_KMH[:-1])
@pytest.mark.parametrize("frequency_Hz", [0.2, 0.35, 0.5])
def test_single_track_with_the_truth_answers_as_the_car(
    speed_kmh: float, frequency_Hz: float
) -> None:
    """Yaw rate, lateral acceleration and rack torque in the band of steps I-a1 and I-b1: within 1 %
    in small motion.
    """
    car, track = (part[[0, 1, 3]] for part in answers(speed_kmh, frequency_Hz, SMALL))
    assert np.abs(np.abs(car / track) - 1.0).max() < 0.01


@pytest.mark.parametrize("speed_kmh", [105.0, 75.0, 45.0])
@pytest.mark.parametrize("amplitude", [SMALL, 0.3])
def test_the_slow_sine_is_met_in_magnitude_and_phase(speed_kmh: float, amplitude: float) -> None:
    """All four answers at 0.2 Hz, small and driven motion, as complex numbers: within 1 %."""
    car, track = answers(speed_kmh, 0.2, amplitude)
    assert np.abs(car / track - 1.0).max() < 0.01


def test_driven_truth_is_softer_than_small_motion() -> None:
    """Tyre curvature and load transfer cost one to four per cent of stiffness at 3.5 m/s2, and are
    not ignored.
    """
    small, driven = (vehicle_truth(from_kmh(75.0), a, CAR.vehicle) for a in (SMALL, 0.5))
    for key in ("C_f_N_per_rad", "C_r_N_per_rad"):
        assert 0.96 < driven[key] / small[key] < 0.99


def test_reference_without_compensation_is_the_hardware() -> None:
    """Nothing compensated: J_ref = J_pin, b_ref = b_pin, so the projection itself adds nothing."""
    machine = machine_at(20.0, CAR)
    bare = machine._replace(law=machine.law._replace(active_damping=0.0, inertia_compensation=0.0))
    assert reference_truth(bare) == pytest.approx(
        (CAR.steering.J_pin, CAR.steering.b_pin), rel=1e-6
    )


def test_reference_is_hardware_minus_compensation_up_to_the_unit_s_lag() -> None:
    """J_pin - J_comp and b_pin + active damping, changed by less than the filters can explain."""
    machine = machine_at(from_kmh(75.0), CAR)
    J, b = reference_truth(machine)
    assert pytest.approx(CAR.steering.J_pin - machine.law.inertia_compensation, rel=0.06) == J
    assert b == pytest.approx(CAR.steering.b_pin + machine.law.active_damping, abs=0.08)


def test_ratio_of_an_exact_table_is_its_own() -> None:
    """The fit of r returns the r that the table was sampled with, within what straight lines
    between knots cost.
    """
    machine = machine_at(from_kmh(75.0), CAR)
    assert off_centre_ratio(machine, 4.0, 1.8) == pytest.approx(
        CAR.calibration.off_centre_ratio[5], rel=0.02
    )


def test_friction_without_compensation_is_the_hardware() -> None:
    """The fitted level is the hardware's own where nothing is compensated."""
    machine = machine_at(20.0, CAR)
    machine = machine._replace(law=machine.law._replace(friction_compensation=0.0))
    angle, rate = robot_target("steady_state", 0.4)
    quiet = np.zeros_like(angle)
    record = rollout(angle, rate, quiet, quiet, 20.0, machine)
    assert friction_truth(record, machine) == pytest.approx(CAR.steering.M_fric, rel=2e-3)


@pytest.mark.parametrize("speed_kmh", [105.0, 75.0, 45.0])
def test_an_ideal_identification_finds_the_truth(speed_kmh: float) -> None:
    """Least squares with the right structure on undisturbed signals: what is left over is lag and
    knots, not definition.

    Catches a truth that no method could find (a wrong sign of a compensation, a delay forgotten).
    """
    speed = from_kmh(speed_kmh)
    sweep = 0.4
    row = truth_at(speed_kmh, 0.5, sweep, CAR)
    angle, rate = robot_target("frequency_response", sweep)
    quiet = np.zeros_like(angle)
    record = rollout(angle, rate, quiet, quiet, speed, machine_at(speed, CAR))
    x = {name: record[:, k] for k, name in enumerate(RECORD)}
    friction = np.zeros(len(angle))
    for k, step in enumerate(np.diff(x["pinion_angle"])):
        friction[k + 1] = dahl_step(friction[k], step, row["M_fric_C_Nm"], row["c_fric_Nm_per_rad"])
    r = row["c_pin_off_Nm_per_rad"] / row["c_pin_on_Nm_per_rad"]
    M_eff = np.array(
        [M + smooth_boost(M, r, row["sigma_assist_Nm"]) for M in x["torsion_bar_torque"]]
    )
    regressors = np.stack([np.gradient(x["pinion_rate"], PERIOD), x["pinion_rate"]], axis=1)
    (J, b), *_ = np.linalg.lstsq(regressors, M_eff - x["rack_torque"] - friction)
    assert pytest.approx(row["J_ref_kgm2"], rel=0.025) == J
    assert b == pytest.approx(row["b_ref_Nms_per_rad"], abs=0.025)
