"""Effects inside the test car: nothing without them, symmetric where they are, no energy out of nowhere."""

import numpy as np
import pytest

from steer_env.physics.effects import EFFECTS
from steer_env.physics.effects.acting import scrub_after
from steer_env.physics.effects.moment import at_rack
from steer_env.physics.effects.vehicle_ports import MECHANICAL, effect_row
from steer_env.testcar.kernel import PERIOD, RECORD, machine_at, rollout
from steer_env.testcar.logger import disturbances, signals
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import robot_target
from steer_env.testcar.variants import plain_car
from steer_env.units import from_kmh

SHOWN = ("steering_torque", "torsion_bar_torque", "pinion_friction", "rack_torque", "yaw_rate")
# Of the virtual car after 4 s, from the code as it was before there were effects.
BEFORE = {
    (30.0, "steady_state", 1.2): (
        -3.3537138854793853, -3.276453599328102, -2.899999999999996, -8.814429785047961, -0.19369344999045973,
    ),
    (75.0, "frequency_response", 0.4): (
        0.33197277005215997, 1.7730252147790866, -2.8969133670002685, 7.942450703217077, 0.12253444381479245,
    ),
    (105.0, "on_centre_weave", 0.25): (
        -4.1450288354919405, -4.001149668734721, -2.8999999999943378, -9.47552624000814, -0.07302543691208366,
    ),
}  # fmt: skip
# A phase or a side of its own: left and right differ.
LOPSIDED = {"road_crown"}


def record_of(
    car: VirtualCar, speed_kmh: float, manoeuvre: str, amplitude: float, row: np.ndarray | None = None,
    seed: int | None = None, periods: int | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """A run's record by column."""
    target = [part[:periods] for part in robot_target(manoeuvre, amplitude)]
    rng = None if seed is None else np.random.default_rng(seed)
    road, wind = disturbances(len(target[0]), car.disturbance, rng)
    speed = from_kmh(speed_kmh)
    record = rollout(*target, road, wind, speed, machine_at(speed, car), row)
    return {name: record[:, k] for k, name in enumerate(RECORD)}


def row_of(name: str, **values: float) -> np.ndarray:
    effect = EFFECTS["vehicle"][name]
    return effect_row({name: effect.at(values or effect.probes[0])._asdict()})


def work(torque: np.ndarray, rate: np.ndarray) -> float:
    power = torque * rate
    return float(np.sum(0.5 * (power[1:] + power[:-1])) * PERIOD)


@pytest.mark.parametrize("case", BEFORE)
def test_without_effects_the_car_is_what_it_was(case: tuple[float, str, float]) -> None:
    """Catches a port that moves the car without being asked; None and a row of absent effects alike, to the bit."""
    plain = record_of(VirtualCar(), *case, seed=5)
    for name, value in zip(SHOWN, BEFORE[case], strict=True):
        assert plain[name][4000] == pytest.approx(value, rel=1e-9)
    absent = record_of(VirtualCar(), *case, row=effect_row({}), seed=5)
    assert all(np.array_equal(absent[name], plain[name]) for name in RECORD)


@pytest.mark.parametrize("name", [n for n in MECHANICAL if n not in LOPSIDED])
def test_left_and_right_stay_mirror_images(name: str) -> None:
    """Catches a lost sign or abs in a port. Joint and ripple with no phase are odd in the angle as all the others."""
    values = dict(MECHANICAL[name].probes[0]) | {k: 0.0 for k in MECHANICAL[name].probes[0] if k.startswith("phase")}
    row = row_of(name, **values)
    left, right = (record_of(plain_car(), 60.0, "steady_state", 0.6 * sign, row, None, 4000) for sign in (1, -1))
    for column in RECORD:
        assert np.abs(left[column] + right[column]).max() <= 1e-7 * (1.0 + np.abs(left[column]).max())


def test_strain_gauges_do_not_know_the_ratio() -> None:
    """With a ratio that varies the tyres' force on the rack is the same function of the car's motion as before; what
    reaches the pinion is 1 + a delta^2 times as much, which closes the balance at the pinion.
    """
    car, a = plain_car(), 0.1
    x = record_of(car, 20.0, "steady_state", 2.0, row_of("variable_ratio", per_rad2=a))
    quiet = slice(8000, None)
    s = car.steering
    acceleration = np.gradient(x["pinion_rate"], PERIOD)
    passed = x["rack_torque"] * (1.0 + a * x["pinion_angle"] ** 2)
    left = (
        x["torsion_bar_torque"] + x["basic_assist"] + x["compensation"] - x["pinion_friction"]
        - s.b_pin * x["pinion_rate"] - s.J_pin * acceleration
    )  # fmt: skip
    assert np.sqrt(np.mean((passed - x["rack_torque"])[quiet] ** 2)) > 1.0
    assert np.sqrt(np.mean((left - passed)[quiet] ** 2)) < 0.05
    logged = signals(np.column_stack(list(x.values())), 5.0, 118.0)["rack_force_N"]
    assert np.array_equal(logged, 118.0 * x["rack_torque"])


@pytest.mark.parametrize("name", ["universal_joint", "torsion_bar_nonlinearity"])
def test_joint_and_bar_neither_make_nor_eat_energy(name: str) -> None:
    """Robot and motor work = rack work + friction + damping over whole periods: a torque that is not handed up with
    the joint's slope, or a bar without a potential, would leave something over.
    """
    car = plain_car()
    values = {"amplitude_rad": 0.04, "phase_rad": 0.8} if name == "universal_joint" else {"hardening_per_rad2": 300.0}
    x = record_of(car, 75.0, "steady_state", 0.5, row_of(name, **values))
    slope = 1.0
    if name == "universal_joint":
        slope = 1.0 + 2.0 * 0.04 * np.cos(2.0 * x["steering_angle"] + 0.8)
    bar_rate = slope * x["steering_rate"] - x["pinion_rate"]
    whole = slice(5500, 20500)  # three periods of 0.2 Hz
    rate, pinion_rate, bar_rate = x["steering_rate"][whole], x["pinion_rate"][whole], bar_rate[whole]
    motor = (x["basic_assist"] + x["compensation"])[whole]
    given = work(x["steering_torque"][whole], rate) + work(motor, pinion_rate)
    s = car.steering
    lost = work(s.b_s * rate, rate) + work(s.b_pin * pinion_rate, pinion_rate) + work(s.b_tb * bar_rate, bar_rate)
    lost += work(x["pinion_friction"][whole], pinion_rate) + work(x["rack_torque"][whole], pinion_rate)
    assert given > 5.0
    assert given == pytest.approx(lost, abs=2e-3 * given)


def test_scrub_only_dissipates() -> None:
    """Dahl friction over closed loops of the rack: positive work each, four times level times amplitude when wide."""
    row = row_of("tyre_scrub", torque_Nm=5.0, fade_speed_mps=3.0, travel_rad=0.05)
    x = at_rack(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for amplitude in (0.01, 0.2, 3.0):
        angle = amplitude * np.sin(np.linspace(0.0, 4.0 * np.pi, 8001))
        torque, loops = 0.0, []
        for step in np.diff(angle):
            after = scrub_after(torque, float(step), x, row)
            loops.append(0.5 * (torque + after) * step)
            torque = after
        second = float(np.sum(loops[4000:]))
        assert second > 0.0
        if amplitude == 3.0:
            assert second == pytest.approx(4.0 * 5.0 * amplitude, rel=0.05)
