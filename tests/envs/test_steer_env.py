"""The environments as users meet them: ids, seeds, bad actions, options, rewards, ends."""

import math
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import steer_env
from steer_env.envs.layout import OBSERVATION_SCALES, PERIOD, Truth
from steer_env.envs.task import Ready, Task, prepare
from steer_env.errors import InputError
from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics.control_unit import Observation
from steer_env.plants import DRIVERS, PLANTS

IDS = [
    f"steer_env/{plant}-{causality}-v0"
    for plant in PLANTS
    for causality in ("Impedance", "Admittance")
]
ZERO = np.zeros(1, np.float32)


def make(env_id=IDS[0], **options):
    return gymnasium.make(env_id, **options)


def drive(env, periods, seed=0, action=0.1, **reset_options):
    env.reset(seed=seed, **reset_options)
    rows = []
    for k in range(periods):
        observation, reward, _, truncated, info = env.step(
            np.array([action * math.sin(0.02 * k)], np.float32)
        )
        rows.append(
            (*observation.tolist(), reward, info["steering_angle"], info["torsion_bar_torque"])
        )
        if truncated:
            break
    return np.array(rows)


@pytest.mark.parametrize("env_id", IDS)
def test_gymnasium_accepts_the_environment(env_id):
    """Catches observations out of their space, a reset that ignores its seed, wrong types."""
    check_env(make(env_id, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("env_id", IDS)
def test_stable_baselines3_accepts_the_environment(env_id):
    """Catches what its training loops cannot take: it is stricter about dtypes and bounds."""
    checker = pytest.importorskip(
        "stable_baselines3.common.env_checker", reason="extra [learn] is not installed"
    )
    checker.check_env(make(env_id))


@pytest.mark.parametrize("env_id", IDS)
def test_same_seed_same_bits_and_other_seed_other_noise(env_id):
    """Catches noise from a global generator and state that survives a reset."""
    env = make(env_id, randomise="all")
    first = drive(env, 700, seed=5)
    again = drive(env, 700, seed=5)
    other = drive(env, 700, seed=6)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_bad_action_is_refused_and_leaves_the_state(bad):
    """Catches an action that poisons the state before it is checked."""
    env, twin = make(), make()
    for e in (env, twin):
        e.reset(seed=1)
        e.step(ZERO)
    with pytest.raises(ValueError, match="finite share"):
        env.step(np.array([bad], np.float32))
    assert np.array_equal(env.step(ZERO)[0], twin.step(ZERO)[0])


def test_action_beyond_one_is_clipped_and_told():
    """Catches silent clipping and torque above the rating."""
    env, twin = make(), make()
    env.reset(seed=1)
    twin.reset(seed=1)
    info, full = env.step(np.array([7.0], np.float32))[4], twin.step(np.ones(1, np.float32))[4]
    assert info["clipped"]
    assert not full["clipped"]
    assert info["command"] == full["command"] <= env.unwrapped.motor.rated_torque


def test_a_destabilising_controller_ends_the_episode_with_its_reason():
    """Catches NaN observations and endless episodes: feedback on the rate throws the wheel."""
    env = make(driver="hands_off")
    env.reset(seed=0)
    action = np.ones(1, np.float32)
    for _ in range(20000):
        observation, reward, terminated, truncated, info = env.step(action)
        assert np.isfinite(observation).all()
        assert math.isfinite(reward)
        action = np.array([math.copysign(1.0, info["pinion_rate"])], np.float32)
        if truncated:
            break
    assert truncated
    assert not terminated
    assert info["ended"].startswith("unstable")


def test_an_episode_ends_with_its_manoeuvre():
    """Catches an off-by-one in the length: lead-in plus duration, in periods of 1 ms."""
    env = make(manoeuvre="step_steer", duration=0.5)
    rows = drive(env, 5000)
    assert len(rows) == 1000


@pytest.mark.parametrize("manoeuvre", MANOEUVRES)
@pytest.mark.parametrize("driver", ["robot", "relaxed"])
def test_every_manoeuvre_runs_with_every_kind_of_driver(manoeuvre, driver):
    """Catches a manoeuvre whose signal or amplitude is not finite."""
    rows = drive(make(IDS[2], manoeuvre=manoeuvre, driver=driver), 300)
    assert np.isfinite(rows).all()


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"plant": "EPSA"}, "EPAS"),
        ({"manoeuvre": "chirp"}, "frequency_response"),
        ({"driver": "tens"}, "tense"),
        ({"speed_kmh": -5.0}, "2 to 400"),
        ({"speed_kmh": "fast"}, "km/h"),
        ({"manouvre": "release"}, "manoeuvre"),
        ({"randomise": "everything"}, "all"),
        ({"amplitude": math.nan}, "finite"),
        ({"duration": -1.0}, "duration"),
        ({"driver": "torque_source"}, "random_torque"),
        ({"reference": "nowhere.json"}, "nowhere.json"),
        ({"causality": "both"}, "impedance"),
    ],
)
def test_wrong_options_are_named_with_a_mend(options, word):
    """Catches options that are swallowed or end in a traceback from deep inside."""
    env = make()
    with pytest.raises(InputError, match=word):
        env.reset(options=options)


def test_speed_profile_is_driven():
    """Catches a profile that is ignored or overshoots its end."""
    env = make(speed_kmh=(60.0, 90.0), manoeuvre="steady_state", duration=1.0)
    env.reset(seed=0)
    for _ in range(1500):
        *_, info = env.step(ZERO)
    assert info["speed"] * 3.6 == pytest.approx(90.0, abs=1e-6)


def test_observation_is_measured_and_late():
    """Catches hidden truth in the observation: torque lies on the sensor's grid and is late."""
    env = make(IDS[2], driver="robot", manoeuvre="steady_state")
    env.reset(seed=3)
    step = env.unwrapped.plant.sensors.torque_step
    seen, true = [], []
    for _ in range(3000):
        *_, info = env.step(ZERO)
        seen.append(info["observation"].torsion_bar_torque)
        true.append(info["torsion_bar_torque"])
    ratio = np.array(seen) / step
    assert np.allclose(ratio, np.round(ratio), atol=1e-6)
    seen, true = np.array(seen), np.array(true)
    late = np.abs(seen[1:] - true[:-1]).mean()
    assert late < np.abs(seen - true).mean()


def test_scaled_observation_is_the_si_one_in_named_units():
    """Catches a table of scales whose order drifts from the observation's fields."""
    env = make(driver="robot")
    env.reset(seed=0)
    for _ in range(900):
        scaled, *_, info = env.step(np.array([0.05], np.float32))
    expected = np.array(info["observation"]) / np.array(
        OBSERVATION_SCALES._replace(
            **{f"last_torque_{k}": env.unwrapped.motor.rated_torque for k in (1, 2, 3, 4)}
        )
    )
    assert scaled == pytest.approx(expected.astype(np.float32))
    assert Observation._fields == OBSERVATION_SCALES._fields


def test_reward_is_the_sum_of_its_named_parts():
    """Catches a part that is logged but not counted."""
    env = make()
    env.reset(seed=0)
    for _ in range(800):
        _, reward, _, _, info = env.step(np.array([0.2], np.float32))
    assert reward == info["reward_tracking"] + info["reward_smoothness"] + info["reward_effort"]
    assert set(Truth._fields) <= set(info)


def test_reference_as_named_statespace():
    """Catches an unnamed or wrong system: its steady gain must be (1 + k_gain) / stiffness."""
    reference = make(speed_kmh=75).unwrapped.reference
    system = reference.to_statespace()
    assert system.input_labels == ["torsion_bar_torque"]
    assert system.output_labels == ["pinion_angle", "pinion_rate"]
    gain = abs(system(2j * np.pi * 0.2)[0, 0])
    p = reference.at(75 / 3.6)
    assert gain == pytest.approx((1 + p.k_gain) / 35.482, rel=0.03)


@pytest.mark.parametrize("env_id", IDS)
def test_picture(env_id):
    """Catches a renderer that fails or draws nothing."""
    env = make(env_id, render_mode="rgb_array", driver="robot")
    env.reset(seed=0)
    env.render()
    blank = env.render().copy()
    for _ in range(1500):
        env.step(ZERO)
    image = env.render()
    assert image.dtype == np.uint8
    assert image.shape[2] == 3
    assert (image != blank).any()
    env.close()


def test_step_before_reset_is_told():
    """Catches a step on empty rows."""
    with pytest.raises((RuntimeError, gymnasium.error.ResetNeeded), match="reset"):
        make().step(ZERO)


def test_drivers_and_plants_are_all_usable():
    """Catches a row in a table that the environment cannot take."""
    for plant in PLANTS:
        for driver in DRIVERS:
            manoeuvre = "random_torque" if driver == "torque_source" else "steady_state"
            env = steer_env.envs.SteerEnv(plant=plant, driver=driver, manoeuvre=manoeuvre)
            assert np.isfinite(drive(env, 200)).all()


def test_a_ready_task_draws_what_a_task_prepared_anew_draws():
    """Catches an episode that keeps something of the one before it, or a draw in another order."""
    ready, rng = Ready(Task(randomise="all"), PERIOD), np.random.default_rng(4)
    first, second = ready.drawn(rng), ready.drawn(np.random.default_rng(5))
    assert (first.row == prepare(Task(randomise="all"), np.random.default_rng(4), PERIOD).row).all()
    assert (second.row == prepare(Task(randomise="all"), np.random.default_rng(5), PERIOD).row).all()
    assert (ready.drawn(rng).row != first.row).any()


def test_a_drawn_value_out_of_range_is_named():
    """Catches a spread that leaves the range of its parameter, which only some draws show."""
    wide = replace(PLANTS["EPAS"], spread={"steering.J_s": (50.0, 60.0)})
    ready = Ready(Task(plant=wide, randomise="plant"), PERIOD)
    with pytest.raises(InputError, match="steering: J_s"):
        ready.drawn(np.random.default_rng(0))
