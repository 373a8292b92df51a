"""Energy of the plant: what goes in is stored or dissipated, and nothing comes from nowhere."""

from __future__ import annotations

import numpy as np
import pytest

from steer_env.physics.driver import driver_torque
from steer_env.physics.plant import PlantState
from steer_env.physics.reference import ReferenceParameters, reference_load
from steer_env.physics.steering import Steering
from steer_env.physics.vehicle import SingleTrackState
from steer_env.plants import DRIVERS, PLANTS
from tests.physics import machine
from tests.physics.machine import column

H = 5e-4


def stored(x: np.ndarray, p: Steering, J_driver: float = 0.0) -> np.ndarray:
    """Kinetic, torsion-bar and friction-bristle energy in J; a Dahl bristle holds M^2 / 2c."""
    twist = column(x, "steering_angle") - column(x, "pinion_angle")
    energy = 0.5 * (p.J_s + J_driver) * column(x, "steering_rate") ** 2
    energy += 0.5 * p.J_pin * column(x, "pinion_rate") ** 2 + 0.5 * p.c_tb * twist**2
    energy += column(x, "wheel_friction") ** 2 / (2.0 * p.c_s_fric)
    return energy + column(x, "pinion_friction") ** 2 / (2.0 * p.c_fric)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_left_alone_never_gains_energy(name, seed):
    """Catches negative damping, friction that pushes, an integrator that feeds a mode.

    Tolerance per step: what RK4 and a reversal inside a step may leave, 1e-6 of the start.
    """
    rng, p = np.random.default_rng(seed), PLANTS[name].steering
    start = PlantState(
        *rng.normal(0.0, [0.05, 5.0, 0.05, 5.0]),
        *[0.0] * 4,
        p.M_s_fric * rng.uniform(-1, 1),
        p.M_fric * rng.uniform(-1, 1),
        *[0.0] * 3,
    )
    x = machine.plant_run(start, *machine.free(2000), H, rack_share=0.0, steering=p)
    energy = stored(x, p)
    assert np.diff(energy).max() < 1e-6 * energy[0]
    assert energy[-1] < 0.1 * energy[0]


def test_without_damping_and_friction_energy_is_kept():
    """Catches hidden dissipation; RK4 loses (w h)^6 / 72 a step at the bar's mode, 1e-9 here."""
    p = Steering(b_s=0.0, b_tb=0.0, b_pin=0.0, M_s_fric=0.0, M_fric=0.0)
    start = PlantState(0.05, 3.0, -0.05, 1.0, *[0.0] * 9)
    x = machine.plant_run(start, *machine.free(2000), H, rack_share=0.0, steering=p)
    energy = stored(x, p)
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-5


def power(x: np.ndarray, hands: np.ndarray, p: Steering, driver, load=None) -> np.ndarray:
    """Power in W into the steering less what it dissipates, at states [n] with hands [n]."""
    wheel, pinion = column(x, "steering_rate"), column(x, "pinion_rate")
    M_s = [
        driver_torque(s, w, *hand, driver)
        for s, w, hand in zip(column(x, "steering_angle"), wheel, hands, strict=True)
    ]
    given = np.array(M_s) * wheel + p.motor_ratio * column(x, "motor_torque") * pinion
    lost = p.b_s * wheel**2 + p.b_pin * pinion**2 + p.b_tb * (wheel - pinion) ** 2
    # Dahl: M x' minus the change of M^2 / 2c is M^2 |x'| / M_C, never negative.
    lost += column(x, "wheel_friction") ** 2 * np.abs(wheel) / p.M_s_fric
    lost += column(x, "pinion_friction") ** 2 * np.abs(pinion) / p.M_fric
    return given - lost - (0.0 if load is None else load(x) * pinion)


def swelling_hand(h: float, n: int, w: float) -> np.ndarray:
    """Hands [n, 4] that turn 0.4 rad to and fro, from rest."""
    t = h * (np.arange(n) + 0.5)
    angle = 0.4 * np.minimum(t / 0.3, 1.0) ** 2 * np.sin(w * t)
    return np.column_stack([angle, np.gradient(angle, h), 0 * t, 0 * t + 1.0])


def balance(x: np.ndarray, hands: np.ndarray, h: float, p: Steering, driver, load=None):
    """(net work in, energy stored, scale) in J; the trapezium rule with each step's own hand."""
    before = power(x[:-1], hands, p, driver, load)
    after = power(x[1:], hands, p, driver, load)
    energy = stored(x, p, driver.J)
    return 0.5 * h * np.sum(before + after), energy[-1] - energy[0], h * np.sum(np.abs(before))


@pytest.mark.parametrize("arm", ["tense", "robot"])
@pytest.mark.parametrize("name", PLANTS)
def test_work_put_in_is_stored_or_dissipated(name, arm):
    """Catches a torque that acts on one body and not on the other, or twice.

    The check's own trapezium rule over 0.05 ms is second order in the flange mode: 1e-4.
    """
    plant, driver, h, n = PLANTS[name], DRIVERS[arm], 5e-5, 12000
    hands = swelling_hand(h, n, 9.0)
    targets = 0.1 * plant.motor.rated_torque * np.sin(25.0 * h * np.arange(n))
    options = {"rack_share": 0.0, "motor": plant.motor, "driver": driver}
    x = machine.plant_run(machine.REST, hands, targets, h, steering=plant.steering, **options)
    work, energy, scale = balance(x, hands, h, plant.steering, driver)
    assert scale > 0.5
    assert work == pytest.approx(energy, abs=1e-4 * scale)


def test_the_rack_takes_what_the_car_is_given():
    """With the rack on, M_rack times the pinion rate is the work that leaves the steering."""
    p, h, n, driver, car = Steering(), 5e-5, 12000, DRIVERS["tense"], ReferenceParameters()
    hands = swelling_hand(h, n, 6.0)
    x = machine.plant_run(machine.REST, hands, np.zeros(n), h, driver=driver, car=car)

    def M_rack(rows):
        return np.array(
            [
                reference_load(r[2], SingleTrackState(*r[4:8]), 75.0 / 3.6, car)
                for r in rows.tolist()
            ]
        )

    work, energy, scale = balance(x, hands, h, p, driver, M_rack)
    assert work == pytest.approx(energy, abs=1e-4 * scale)
    without = balance(x, hands, h, p, driver)[0]
    assert abs(without - work) > 0.1 * scale  # the rack's share is large enough to be missed
