"""Every plant, driver and reference row: in range, with unit and source, physically sound."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from steer_env.envs.layout import CarSpread, Episode, Reward
from steer_env.errors import InputError
from steer_env.manoeuvres import ManoeuvreParameters
from steer_env.physics import linear
from steer_env.physics.driver import Driver
from steer_env.physics.motor import Motor
from steer_env.physics.reference import ReferenceParameters, single_track_of
from steer_env.physics.sensors import Observer, Sensors
from steer_env.physics.steering import Steering
from steer_env.physics.vehicle import SingleTrack
from steer_env.plants import DRIVERS, PLANTS, Reference
from steer_env.plants.amplitude import (
    LARGEST_RATE,
    hand_amplitude,
    paper_acceleration,
    steering_amplitude,
)
from steer_env.plants.reference import steady_stiffness
from steer_env.units import check_ranges, quantities

PARAMETER_SETS = (
    Steering,
    Motor,
    Driver,
    Sensors,
    Observer,
    SingleTrack,
    ReferenceParameters,
    ManoeuvreParameters,
    Episode,
    CarSpread,
    Reward,
)


@pytest.mark.parametrize("kind", PARAMETER_SETS, ids=lambda kind: kind.__name__)
def test_each_parameter_has_a_unit_a_range_and_a_default_inside_it(kind):
    """Catches a number whose unit nobody knows and a default that its own check refuses."""
    known = quantities(kind)
    assert set(known) == set(kind._fields)
    for name, quantity in known.items():
        assert quantity.unit
        assert quantity.source
        assert quantity.low < quantity.high
        assert quantity.low <= kind._field_defaults[name] <= quantity.high, name
    check_ranges(kind(), kind.__name__)


@pytest.mark.parametrize("name", PLANTS)
def test_plants_are_in_range_wherever_randomisation_draws(name):
    """Catches a spread that leaves the valid range or names a field that does not exist."""
    plant = PLANTS[name]
    for part in ("steering", "motor", "sensors"):
        check_ranges(getattr(plant, part), f"{name}.{part}")
    check_ranges(plant.observer(), name)
    for field, (low, high) in plant.spread.items():
        part, key = field.split(".")
        nominal = getattr(plant, part)
        assert 0.0 < low < 1.0 < high
        for factor in (low, high):
            changed = nominal._replace(**{key: getattr(nominal, key) * factor})
            check_ranges(changed, f"{name}.{field}")
    assert plant.name == name
    assert plant.rack_share in (0.0, 1.0)


@pytest.mark.parametrize("name", PLANTS)
def test_the_motor_can_render_what_it_is_there_for(name):
    """EPAS carries the rack's tens of N m; the feedback wheel a driver's torque."""
    plant = PLANTS[name]
    at_wheel = plant.motor.rated_torque * plant.steering.motor_ratio
    assert at_wheel >= (60.0 if plant.rack_share else 7.0)
    assert plant.steering.M_fric + plant.steering.M_s_fric < 0.1 * at_wheel
    full_swing = 2.0 * plant.motor.rated_torque / plant.motor.slew_rate
    assert full_swing < 0.02  # s; slower would be felt


def test_epas_free_mode_is_that_of_a_torsion_bar():
    """143 N m/rad between 0.04 and 0.065 kg m2 rings at 10 to 13 Hz (field report, 1.3)."""
    s = PLANTS["EPAS"].steering
    frequency = math.sqrt(s.c_tb * (1.0 / s.J_s + 1.0 / s.J_pin)) / (2.0 * math.pi)
    assert 10.0 < frequency < 13.0


@pytest.mark.parametrize("name", DRIVERS)
def test_drivers_are_in_range_and_damped(name):
    """Catches a spring without a damper: nobody's arm rings."""
    driver = DRIVERS[name]
    check_ranges(driver, name)
    if driver.k > 0.0:
        assert driver.b / (2.0 * math.sqrt(driver.k * (driver.J + 0.04))) > 0.25


def test_arms_stiffen_and_damp_with_grip():
    """Stiffness and damping grow together with grip (field report, 1.5)."""
    grid = [DRIVERS[name] for name in ("hands_off", "one_hand_light", "relaxed", "tense")]
    for field in ("J", "b", "k"):
        values = [getattr(driver, field) for driver in grid]
        assert values == sorted(values)
        assert len(set(values)) == len(values)


@pytest.mark.parametrize("linear_form", [False, True])
def test_reference_rows_are_in_range_and_meet_between_speeds(linear_form):
    """Catches a column out of order: rows come back as they are, halves lie in the middle."""
    reference = Reference(linear=linear_form)
    assert len(reference.table) == 7
    assert (np.diff(reference.table[:, 0]) > 0.0).all()
    for speed, *values in reference.table.tolist():
        p = ReferenceParameters(*values)
        check_ranges(p, f"{speed}")
        assert reference.at(speed) == pytest.approx(p)
        assert p.linear == float(linear_form)
    first, second = (ReferenceParameters(*row[1:]) for row in reference.table[2:4].tolist())
    middle = reference.at(0.5 * (reference.table[2, 0] + reference.table[3, 0]))
    assert middle.J_ref == pytest.approx(0.5 * (first.J_ref + second.J_ref))
    assert reference.at(0.1) == pytest.approx(ReferenceParameters(*reference.table[0, 1:]))
    assert reference.at(99.0) == pytest.approx(ReferenceParameters(*reference.table[-1, 1:]))


def test_a_reference_out_of_range_is_refused_with_its_speed():
    """Catches a broken row that reaches the kernels."""
    file = Reference().file
    rows = [file.rows[0]._replace(J_ref=-1.0), *file.rows[1:]]
    broken = Reference(replace(file, rows=rows))
    with pytest.raises(InputError, match="J_ref"):
        _ = broken.table


@pytest.mark.parametrize(("kmh", "degrees"), [(105, 18), (90, 22), (75, 28), (60, 39), (45, 54)])
def test_sweep_amplitudes_are_the_known_ones(kmh, degrees):
    """3.5 m/s2 at 0.2 Hz (3 at 45 km/h) takes this much wheel (field report, 6.1)."""
    speed = kmh / 3.6
    p = Reference().at(speed)
    angle = steering_amplitude(paper_acceleration(speed), speed, p, 0.2)
    assert math.degrees(angle) == pytest.approx(degrees, abs=0.6)
    matrices = linear.single_track_matrices(speed, single_track_of(p))
    gain = abs(linear.frequency_response(matrices, 0.2)[0, 1, 0])
    assert gain * angle / p.i_s == pytest.approx(paper_acceleration(speed), rel=1e-9)


def test_amplitudes_stay_within_what_a_robot_does():
    """A 5 Hz sweep at 15 km/h would need 210 deg at 66 rad/s: capped at the robot's rate."""
    p = Reference().at(15.0 / 3.6)
    angle = steering_amplitude(paper_acceleration(15.0 / 3.6), 15.0 / 3.6, p, 5.0)
    assert 2.0 * math.pi * 5.0 * angle == pytest.approx(LARGEST_RATE)


def test_a_soft_arm_reaches_further_by_the_torque_it_holds():
    """Spring torque at the far hand angle must equal the felt torque at the wanted wheel angle."""
    p = Reference().at(75.0 / 3.6)
    stiffness = steady_stiffness(75.0 / 3.6, p)
    for name in ("one_hand_light", "tense", "robot"):
        driver = DRIVERS[name]
        hand = hand_amplitude(0.4, driver, p, stiffness)
        held = driver.k * (hand - 0.4)
        assert 2.0 < held < 6.0
    assert hand_amplitude(0.4, DRIVERS["torque_source"], p, stiffness) == 0.4
