"""Plain Python and machine code are the same physics, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steer_env.manoeuvres import MANOEUVRES, hand_at
from steer_env.physics import assist, friction, motor, sensors, steering, vehicle
from steer_env.physics._jit import compiled, scalar
from steer_env.physics.driver import Driver, driver_torque
from steer_env.physics.plant import PlantState
from steer_env.physics.reference import ReferenceParameters, track_map
from steer_env.plants import DRIVERS, PLANTS, Reference
from tests.physics import machine

UNIT = st.floats(-1.0, 1.0, allow_subnormal=False)
draws = st.tuples(*[UNIT] * 12)


@scalar
def _friction(z):
    a, b, c, d, e, f = z[0], z[1], 2.0 + z[2], 2.5 + z[3], 0.2 + 0.1 * z[4], 200.0 + 100.0 * z[5]
    deflection = friction.lugre_step(0.01 * a, 20.0 * b, 1e-3, c, d, e, f)
    return (
        friction.dahl_step(c * a, b * z[6] * z[6], c, f),
        friction.stribeck_level(b, c, d, e),
        deflection,
        friction.lugre_torque(deflection, b, c, d, e, f, 0.3),
    )


@scalar
def _assist(z):
    r, sigma, M = 0.5 + 0.5 * z[0], 2.0 + 1.5 * z[1], 40.0 * z[2] * abs(z[3])
    return (
        assist.softening(M, r, sigma),
        assist.assist(M, r, sigma),
        assist.incremental_assist(M, r, sigma),
        assist.inverse_assist(M, r, sigma),
        assist.inverse_assist(M, 0.0, sigma),
    )


@scalar
def _vehicle(z):
    C_f, n_t = 1.4e5 + 2e4 * z[0], 0.08 + 0.02 * z[1]
    p = vehicle.SingleTrack(1784.0, 1.27, 1.5, 3300.0, C_f, 1.6e5, 0.03, 0.37, n_t, 16.5)
    x = vehicle.SingleTrackState(z[2], 0.5 * z[3], 0.1 * z[4], 0.1 * z[5])
    speed = 20.0 + 15.0 * z[6]
    y = vehicle.single_track_step(x, 0.1 * z[7], 0.1 * z[8], 0.1 * z[9], speed, p, 5e-4)
    return (
        vehicle.single_track_rates(x, 0.1 * z[7], speed, p),
        y,
        vehicle.lateral_acceleration(y, p),
        vehicle.rack_torque(vehicle.kinematic_front_slip(y, 0.1 * z[7], speed, p), p),
    )


@scalar
def _steering(z):
    c_tb = 150.0 + 100.0 * z[0]
    p = steering.Steering(
        0.04, 0.1, 0.15, 30.0, c_tb, 0.1, 0.065, 0.4, 2.0, 200.0, 21.0, 0.5, 400.0, 4.0
    )
    x = steering.SteeringMotion(z[1], 10.0 * z[2], z[3], 10.0 * z[4])
    return (
        steering.torsion_bar_torque(x, p),
        steering.end_stop_torque(x.pinion_angle, x.pinion_rate, p),
        steering.steering_rates(x, z[5], z[6], z[7], 20.0 * z[8], z[9], 0.1, p),
    )


@scalar
def _devices(z):
    m = motor.Motor(5.0, 1000.0, 200.0, 1.0)
    observer = sensors.Observer(0.065, 0.4, 21.0, 60.0 + 50.0 * z[0], 1.0 if z[7] > 0.0 else 0.0)
    seen = sensors.ObserverState(z[1], 10.0 * z[2], 10.0 * z[3])
    acceleration, new = sensors.observer_step(seen, z[4], 5.0 * z[5], z[6], observer, 1e-3)
    arm = Driver(0.1, 1.0 + z[7], 20.0 + 20.0 * z[8], 10.0)
    return (
        motor.limited_command(7.0 * z[9], 5.0 * z[10], m, 1e-3),
        motor.lag_step(z[9], z[10], motor.lag_decay(300.0 + 200.0 * z[11], 2.5e-4)),
        sensors.measured(z[1], 0.03, 0.01, 3.0 * z[2]),
        driver_torque(z[1], 10.0 * z[2], z[3], 10.0 * z[4], z[5], abs(z[6]), arm),
        acceleration,
        new,
    )


@compiled
def friction_compiled(z):
    return _friction(z)


@compiled
def assist_compiled(z):
    return _assist(z)


@compiled
def vehicle_compiled(z):
    return _vehicle(z)


@compiled
def steering_compiled(z):
    return _steering(z)


@compiled
def devices_compiled(z):
    return _devices(z)


@compiled
def hand_compiled(kind, t, p):
    return hand_at(kind, t, p)


FAMILIES = {
    "friction": (_friction, friction_compiled),
    "assist": (_assist, assist_compiled),
    "vehicle": (_vehicle, vehicle_compiled),
    "steering": (_steering, steering_compiled),
    "devices": (_devices, devices_compiled),
}


@pytest.mark.parametrize("family", FAMILIES)
def test_python_and_compiled_equations_agree_to_the_last_bit(family):
    """Catches fast-math, a fused product, x**2 beside x*x, an integer where a float belongs."""
    plain, machine_code = FAMILIES[family]
    machine_code((0.1,) * 12)  # compiles once, outside of hypothesis

    @settings(derandomize=True, deadline=None, max_examples=300, database=None)
    @given(draws)
    def agree(z):
        assert tuple(plain(z)) == tuple(machine_code(z))

    agree()


@pytest.mark.parametrize("name", MANOEUVRES)
def test_python_and_compiled_manoeuvres_agree_to_the_last_bit(name):
    """Catches a dispatch that picks the neighbour's signal, and powers rounded differently."""
    row = MANOEUVRES[name]
    kind = float(list(MANOEUVRES).index(name))
    p = row.parameters._replace(amplitude=1.7, phase=2.3)
    for t in np.random.default_rng(4).uniform(-0.5, p.lead_in + p.duration + 0.5, 300).tolist():
        assert tuple(row.signal(t, p)) == tuple(hand_compiled(kind, t, p))
        assert tuple(row.signal(t, p)) == tuple(hand_at(kind, t, p))


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("arm", ["tense", "robot"])
def test_a_plant_sequence_is_the_same_in_python_and_compiled(name, arm):
    """Catches any difference that builds up over steps: friction, motor lag, end stop, car."""
    plant, rng = PLANTS[name], np.random.default_rng(3)
    n = 250
    hands = np.column_stack(
        [np.cumsum(rng.normal(0, 0.05, n)), *rng.normal(0, 1, (2, n)), np.ones(n)]
    )
    targets = rng.normal(0, 2, n)
    start = PlantState(0.2, 3.0, 0.1, -2.0, 0.1, 0.2, 0.01, 0.02, 0.1, 0.05, 0.3, 0.0, 0.0)
    options = {
        "rack_share": plant.rack_share,
        "steering": plant.steering._replace(angle_limit=0.08),
        "motor": plant.motor,
        "driver": DRIVERS[arm],
        "car": ReferenceParameters(c_extra=1.6),
    }
    python = machine.plant_run(start, hands, targets, 5e-4, run=machine.run_plant, **options)
    compiled_code = machine.plant_run(start, hands, targets, 5e-4, **options)
    assert np.abs(python[:, 2]).max() > 0.09  # the end stop was met
    assert (python == compiled_code).all()


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("kmh", [15.0, 45.0, 105.0])
def test_both_generators_are_the_same_in_python_and_compiled(kmh, linear):
    """Catches a difference in the inverse assist's iterations or in friction inside a stage."""
    p, rng, n = Reference(linear=linear).at(kmh / 3.6), np.random.default_rng(5), 300
    motion = np.cumsum(rng.normal(0, 0.003, (n, 3)), axis=0) * [1.0, 30.0, 300.0]
    results = []
    for impedance, admittance in (
        (machine.run_impedance, machine.run_admittance),
        (machine.run_impedance_compiled, machine.run_admittance_compiled),
    ):
        torques, moved = np.zeros((n, 2)), np.zeros((n, 3))
        impedance(motion, machine.GENERATOR_AT_REST, kmh / 3.6, p, track_map(kmh / 3.6, p, 1e-3), torques)
        admittance(torques[:, 0].copy(), machine.GENERATOR_AT_REST, kmh / 3.6, p, 1e-3, moved)
        results.append(np.column_stack([torques, moved]))
    assert np.abs(results[0]).max() > 0.1
    assert (results[0] == results[1]).all()
