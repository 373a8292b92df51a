"""One control period: Python = compiled, many = single, left = right, all to the last bit."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from steer_env.envs import batch
from steer_env.envs.layout import PARAMETERS, PERIOD, STATE, Truth
from steer_env.envs.period import control_period
from steer_env.envs.task import Setup, Task, prepare
from steer_env.physics.control_unit import Observation

# Both plants and causalities, speeds that change across rows of the reference and beyond its ends.
TASKS = (
    Task("EPAS", "impedance", driver="robot", randomise="plant", manoeuvre="steady_state"),
    Task("EPAS", "admittance", speed_kmh=(27.0, 80.0), duration=2.0, randomise=("car", "plant")),
    Task("SbW", "impedance", speed_kmh=(108.0, 60.0), duration=2.0, driver="tense"),
    Task("SbW", "admittance", speed_kmh=15.0, manoeuvre="random_torque", driver="torque_source"),
    Task("EPAS", "impedance", linear=True, speed_kmh=45.0, manoeuvre="step_steer"),
)
ODD_IN_TRUTH = [
    name not in ("time", "speed", "unstable") and not name.startswith("reward")
    for name in Truth._fields
]
ODD_IN_OBSERVATION = [name != "speed" for name in Observation._fields]


def ready(task: Task, seed: int = 3) -> Setup:
    """A task whose manoeuvre starts at once, so that few periods show much."""
    setup = prepare(task, np.random.default_rng(seed), PERIOD)
    setup.row[PARAMETERS.column("manoeuvre", "lead_in")] = 0.0
    return setup


def inputs(periods: int, rated: float, seed: int = 11) -> tuple[np.ndarray, np.ndarray]:
    """Commands [n] in N m, some beyond the limits, and noise [n, 2]."""
    rng = np.random.default_rng(seed)
    return 0.6 * rated * rng.normal(size=periods), rng.normal(size=(periods, 2))


def started(setups: list[Setup]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rows = batch.new_rows(len(setups))
    for k, setup in enumerate(setups):
        rows[0][k] = setup.row
    batch.start_batch(*rows, setups[0].table, setups[0].car_table)
    return rows


def compiled_run(setups: list[Setup], commands: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Observations and truths [n, envs, o + t] for commands [n, envs] and noise [n, envs, 2]."""
    n, n_o, n_t = len(setups), len(Observation._fields), len(Truth._fields)
    rows = started(setups)
    seen, scaled, truth = np.zeros((n, n_o)), np.zeros((n, n_o), np.float32), np.zeros((n, n_t))
    tables = setups[0].table, setups[0].car_table
    out = []
    for command, draw in zip(commands, noise, strict=True):
        batch.step_batch(command, draw, *rows, *tables, np.ones((n, n_o)), seen, scaled, truth)
        out.append(np.hstack([seen, truth]))
    return np.array(out)


@pytest.mark.parametrize("task", TASKS, ids=lambda t: f"{t.plant}-{t.causality}-{t.manoeuvre}")
def test_a_period_in_python_is_the_compiled_period(task):
    """Catches any difference of the two paths from the command limits to the reward."""
    setup = ready(task)
    commands, noise = inputs(120, setup.plant.motor.rated_torque)
    fast = compiled_run([setup], commands[:, None], noise[:, None])[:, 0]
    parameters, states, lines = started([setup])
    slow = []
    for command, (first, second) in zip(commands.tolist(), noise.tolist(), strict=True):
        observation, truth = control_period(
            command, first, second, parameters[0], states[0], lines[0], setup.table, setup.car_table
        )
        slow.append([*observation, *truth])
    assert np.isfinite(fast).all()
    assert (np.array(slow) == fast).all()


def test_one_env_is_the_same_alone_and_in_a_batch_of_different_ones():
    """Catches state that leaks from row to row, and vector code that rounds differently."""
    tasks = [replace(task, linear=False) for task in TASKS]  # one table serves the whole batch
    setups = [ready(task, seed) for seed, task in enumerate(tasks)]
    pairs = [inputs(200, s.plant.motor.rated_torque, seed) for seed, s in enumerate(setups)]
    commands, noise = np.stack([c for c, _ in pairs], 1), np.stack([d for _, d in pairs], 1)
    together = compiled_run(setups, commands, noise)
    for k, setup in enumerate(setups):
        alone = compiled_run([setup], commands[:, k : k + 1], noise[:, k : k + 1])
        assert (alone[:, 0] == together[:, k]).all(), tasks[k]


@pytest.mark.parametrize("task", TASKS, ids=lambda t: f"{t.plant}-{t.causality}-{t.manoeuvre}")
def test_left_and_right_are_mirror_images(task):
    """Catches a sign or a rounding that prefers one side: quantiser, friction, limits, assist."""
    setup = ready(task)
    mirrored = replace(setup, row=setup.row.copy())
    mirrored.row[PARAMETERS.column("manoeuvre", "amplitude")] *= -1.0
    commands, noise = inputs(400, setup.plant.motor.rated_torque)
    left = compiled_run([setup], commands[:, None], noise[:, None])[:, 0]
    right = compiled_run([mirrored], -commands[:, None], -noise[:, None])[:, 0]
    sign = np.where([*ODD_IN_OBSERVATION, *ODD_IN_TRUTH], -1.0, 1.0)
    assert np.abs(left[:, 0]).max() > 1e-3
    assert (left == sign * right).all()


def test_a_plant_at_rest_without_input_stays_at_rest():
    """Catches a bias: an offset in any of the sensors, the observer or the generators."""
    setup = ready(Task(manoeuvre="standstill"))
    n = len(Observation._fields)
    out = compiled_run([setup], np.zeros((50, 1)), np.zeros((50, 1, 2)))[:, 0]
    odd = [*ODD_IN_OBSERVATION, *ODD_IN_TRUTH]
    assert (out[:, odd] == 0.0).all()
    assert (out[:, n + Truth._fields.index("unstable")] == 0.0).all()


SHORT_RUN = """
import json, gymnasium, steer_env
env = gymnasium.make("steer_env/{name}", driver="tense", manoeuvre="step_steer").unwrapped
env.reset(seed=8)
for k in range(560):
    observation, reward, *_ = env.step([0.3 if k % 40 < 20 else -0.2])
print(json.dumps([[v.hex() for v in env.observation], float(reward).hex()]))
"""


@pytest.mark.parametrize("name", ["EPAS-Impedance-v0", "SbW-Admittance-v0"])
def test_an_env_without_numba_gives_the_same_bits(name):
    """Catches a machine without a compiler getting other physics: same seed, same bits."""
    source = SHORT_RUN.format(name=name)
    fallback = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", source], env=fallback, capture_output=True, text=True, check=True
    )
    env = gymnasium.make(f"steer_env/{name}", driver="tense", manoeuvre="step_steer").unwrapped
    env.reset(seed=8)
    for k in range(560):
        _, reward, *_ = env.step([0.3 if k % 40 < 20 else -0.2])
    ours = [[v.hex() for v in env.observation], float(reward).hex()]
    assert json.loads(done.stdout) == ours


def test_row_layouts_hold_every_field_once():
    """Catches overlapping records: a store to one must leave the others alone."""
    for layout in (PARAMETERS, STATE):
        row = np.arange(layout.size, dtype=float)
        seen = [v for name in layout.records for v in layout.read(row, name)]
        assert seen == row.tolist()


@pytest.mark.parametrize("kmh", [5.0, 15.0, 33.0, 60.0, 104.9, 130.0])
def test_the_kernel_reads_the_reference_as_python_does(kmh):
    """Catches a field blended with its neighbour; beyond the rows both hold the last one."""
    setup = ready(Task(speed_kmh=kmh, randomise="car"))
    state = started([setup])[1][0]
    expected = setup.reference.at(kmh / 3.6)
    assert STATE.read(state, "reference") == pytest.approx(expected, rel=1e-12, abs=1e-12)
    car, spread = STATE.read(state, "car"), PARAMETERS.read(setup.row, "car_spread")
    assert car.m == pytest.approx(expected.m * spread.mass)
    assert car.J_z == pytest.approx(expected.J_z * spread.mass)
    assert car.C_f == pytest.approx(expected.C_f * spread.grip)
    assert car.C_r == pytest.approx(expected.C_r * spread.grip)
    assert car.n_t == pytest.approx(expected.n_t * spread.trail)


def test_speed_changes_evenly_and_stops_at_its_end():
    """Catches a speed that runs on: the reference must follow it row by row, then hold."""
    setup = ready(Task("SbW", speed_kmh=(58.0, 62.0), duration=0.05, manoeuvre="standstill"))
    n = 700
    out = compiled_run([setup], np.zeros((n, 1)), np.zeros((n, 1, 2)))[:, 0]
    speed = out[:, len(Observation._fields) + Truth._fields.index("speed")]
    length = setup.periods * PERIOD
    expected = 58.0 / 3.6 + np.minimum(PERIOD * np.arange(1, n + 1) / length, 1.0) * 4.0 / 3.6
    np.testing.assert_allclose(speed, expected, rtol=1e-9)
    assert (out[:, Observation._fields.index("speed")] == speed).all()
