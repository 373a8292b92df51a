"""Environments side by side in lanes: the same bits as alone, and what cannot run in lanes does not."""

from __future__ import annotations

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from steer_env.envs import batch
from steer_env.envs.blocks import new_blocks, start_lane
from steer_env.envs.lanes import PARAMETER_ROWS, STATE_ROWS, switches_of
from steer_env.envs.layout import PERIOD, STATE
from steer_env.envs.task import Task, prepare
from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics import lanes, rows
from steer_env.physics._jit import COMPILED, compiled
from steer_env.physics.control_unit import Commands
from steer_env.physics.lanes import WIDTH
from steer_env.plants import PLANTS

needs_machine_code = pytest.mark.skipif(not COMPILED, reason="lanes are for machine code; numba is switched off")
IDS = ("steer_env/EPAS-Impedance-v0", "steer_env/SbW-Admittance-v0")


def side_by_side(env_id, n, steps, watched, **options):
    """Step n environments together and some of them alone; (their results, how many episodes ended)."""
    together = gymnasium.make_vec(env_id, n, vectorization_mode="vector_entry_point", **options)
    alone = {i: gymnasium.make(env_id, **options) for i in watched}
    together.reset(seed=5)
    for i, env in alone.items():
        env.reset(seed=5 + i)
    over, ends, rng = np.zeros(n, bool), 0, np.random.default_rng(1)
    for _ in range(steps):
        actions = rng.uniform(-1.1, 1.1, (n, 1)).astype(np.float32)
        observations, rewards, _, truncated, infos = together.step(actions)
        for i, env in alone.items():
            if over[i]:
                env.reset()
                continue
            observation, reward, _, ended, info = env.step(actions[i])
            assert np.array_equal(observation, observations[i])
            assert (reward, ended) == (rewards[i], truncated[i])
            signals = {name: values[i] for name, values in infos.items() if name in info and name != "observation"}
            assert signals == {name: info[name] for name in signals}
            assert tuple(infos["observation"][i]) == tuple(info["observation"])
        over, ends = truncated.copy(), ends + int(truncated.sum())
    return ends


@needs_machine_code
@pytest.mark.parametrize("env_id", IDS)
def test_lanes_give_the_bits_of_single_environments(env_id):
    """Catches vector code that rounds differently, lanes that mix, and a wrong border between blocks and rows."""
    n, options = 2 * WIDTH + 3, {"randomise": "all", "manoeuvre": "step_steer", "duration": 0.05}
    watched = (0, 1, WIDTH - 1, WIDTH, 2 * WIDTH - 1, 2 * WIDTH, n - 1)
    assert side_by_side(env_id, n, 1150, watched, **options) >= 2 * n


@needs_machine_code
@pytest.mark.parametrize("name", MANOEUVRES)
def test_every_manoeuvre_moves_the_hands_of_all_lanes(name):
    """Catches a kind of manoeuvre that lanes take for another one."""
    driver = "torque_source" if name == "random_torque" else "robot"
    side_by_side(IDS[0], WIDTH, 560, (0, WIDTH - 1), manoeuvre=name, driver=driver, randomise=("manoeuvre", "plant"))


@needs_machine_code
def test_lanes_follow_a_speed_that_changes():
    """Catches a reference or car that stays at the first speed."""
    side_by_side(IDS[0], WIDTH, 300, (0, 17), speed_kmh=(27.0, 80.0), duration=2.0, randomise=("car", "plant"))


@needs_machine_code
def test_a_linear_reference_in_lanes():
    """Catches a switch of the reference that lanes do not see."""
    side_by_side(IDS[0], WIDTH, 300, (3,), linear=True, manoeuvre="random_torque", driver="torque_source")


@needs_machine_code
def test_lugre_friction_runs_row_by_row():
    """Lanes have Dahl friction alone: another one must not be dropped without a word."""
    epas = PLANTS["EPAS"]
    lugre = replace(epas, steering=epas.steering._replace(M_fric_extra=0.5, sigma_1=0.2))
    setup = prepare(Task(lugre), np.random.default_rng(0), PERIOD)
    assert switches_of(setup.row, setup.table, setup.car_table) is None
    side_by_side(IDS[0], WIDTH, 700, (0,), plant=lugre, driver="robot")


@compiled
def pushed(block, row):
    for lane in range(WIDTH):
        x = load_lane(block, lane)
        store_lane(block, lane, Commands(x.last_4, x.last_1, x.last_2, x.last_3))
    y = load_row(row)
    store_row(row, Commands(y.last_4, y.last_1, y.last_2, y.last_3))


load_lane, store_lane = lanes.lane_loader(Commands, 2, {"last_2": 7.0}), lanes.lane_storer(Commands, 3)
load_row, store_row = rows.loader(Commands, 1), rows.storer(Commands, 2)


def test_records_in_lanes_and_rows_are_read_and_written_alike():
    """Catches machine code that addresses another field, lane or stride than the Python functions."""
    rng = np.random.default_rng(3)
    block, wide = rng.normal(size=(9, WIDTH)), rng.normal(size=(7, 3))
    again, again_wide = block.copy(), wide.copy()
    pushed(block, wide[:, 1])
    for lane in range(WIDTH):
        x = load_lane(again, lane)
        assert x.last_2 == 7.0
        store_lane(again, lane, Commands(x.last_4, x.last_1, x.last_2, x.last_3))
    y = load_row(again_wide[:, 1])
    store_row(again_wide[:, 1], Commands(y.last_4, y.last_1, y.last_2, y.last_3))
    assert (block == again).all()
    assert (wide == again_wide).all()


def test_a_lane_starts_as_a_row_does():
    """Catches parameters or states in the wrong rows of a block, and blocks that straddle cache lines."""
    blocks, lines = new_blocks(2)
    blocks[1, :, 5], lines[1, :, :, 5] = 3.0, 4.0  # of the episode before
    setup = prepare(Task(randomise=("car",)), np.random.default_rng(0), PERIOD)
    start_lane(blocks, lines, WIDTH + 5, setup.row, setup.table, setup.car_table)
    parameters, states, no_lines = batch.new_rows(1)
    parameters[0] = setup.row
    batch.start_batch(parameters, states, no_lines, setup.table, setup.car_table)
    assert (blocks[1, PARAMETER_ROWS, 5] == setup.row).all()
    assert (blocks[1, STATE_ROWS, 5] == states[0]).all()
    assert not lines.any()
    assert STATE.read(blocks[1, STATE_ROWS, 5], "clock").speed == pytest.approx(75.0 / 3.6)
    assert np.count_nonzero(np.delete(blocks.reshape(-1, WIDTH), 5, axis=1)) == 0
    assert blocks.ctypes.data % 64 == 0
