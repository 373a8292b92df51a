"""SteerVectorEnv: the same bits as single environments, Gymnasium's autoreset, bad actions."""

import math

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import steer_env
from steer_env.envs.layout import Truth
from steer_env.errors import InputError

IDS = ["steer_env/EPAS-Impedance-v0", "steer_env/SbW-Admittance-v0"]
SHORT = {"randomise": "all", "manoeuvre": "step_steer", "duration": 0.05}
N = 3


def make_vec(env_id=IDS[0], num_envs=N, **options):
    return gymnasium.make_vec(env_id, num_envs, vectorization_mode="vector_entry_point", **options)


def actions(k, n=N):
    return (1.2 * np.sin(0.05 * k + np.arange(n))).astype(np.float32)[:, None]


def assert_same_infos(ours, theirs):
    """Every name with its mask; where the mask is set, the same bits."""
    assert ours.keys() == theirs.keys()
    for name in theirs:
        mask = theirs.get(f"_{name}")
        if isinstance(theirs[name], dict):
            assert_same_infos(ours[name], theirs[name])
        elif mask is not None:
            assert np.array_equal(ours[f"_{name}"], mask), name
            for mine, single in zip(ours[name][mask], theirs[name][mask], strict=True):
                assert np.array_equal(mine, single), name


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("env_id", IDS)
def test_same_bits_as_single_environments(env_id, mode):
    """Catches shared generators, rows or tables, another clipping, and every slip of autoreset.

    Gymnasium's own SyncVectorEnv over SteerEnv is the judge, through two autoresets and more of each.
    """
    ours = make_vec(env_id, autoreset_mode=mode, **SHORT)
    theirs = SyncVectorEnv([lambda: gymnasium.make(env_id, **SHORT)] * N, autoreset_mode=mode)
    mine, single = ours.reset(seed=7), theirs.reset(seed=7)
    assert np.array_equal(mine[0], single[0])
    assert_same_infos(mine[1], single[1])
    ends = 0
    for k in range(1102):
        mine, single = ours.step(actions(k)), theirs.step(actions(k))
        for a, b in zip(mine[:4], single[:4], strict=True):
            assert a.dtype == b.dtype
            assert np.array_equal(a, b), k
        assert_same_infos(mine[4], single[4])
        ends += int(mine[3].sum())
    assert ends >= 2 * N
    assert len(set(mine[4]["speed"])) == N, "speed is drawn for each environment"


def test_environments_that_end_at_different_times():
    """Catches a reset or skip of the wrong rows: one wheel is thrown, the others go on."""
    env = make_vec(driver="hands_off")
    twin = make_vec(driver="hands_off")
    env.reset(seed=0)
    twin.reset(seed=0)
    thrown, zero = np.zeros((N, 1), np.float32), np.zeros((N, 1), np.float32)
    thrown[1] = 1.0
    for _ in range(5000):
        *_, truncated, infos = env.step(thrown)
        calm = twin.step(zero)
        assert np.array_equal(infos["pinion_angle"][[0, 2]], calm[4]["pinion_angle"][[0, 2]])
        if truncated.any():
            break
        thrown[1] = math.copysign(1.0, infos["pinion_rate"][1])
    assert truncated.tolist() == [False, True, False]
    assert infos["ended"][1].startswith("unstable")
    assert infos["ended"][0] == ""
    _, reward, _, truncated, infos = env.step(thrown)
    assert infos["time"][1] == 0.0
    assert reward[1] == 0.0
    assert not truncated.any()
    assert infos["time"][0] == infos["time"][2] > 0.0
    *_, infos = env.step(zero)
    assert infos["time"][1] == 1e-3


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_bad_action_moves_nothing(bad):
    """Catches environments that step before the bad one among them is found."""
    env, twin = make_vec(), make_vec()
    env.reset(seed=1)
    twin.reset(seed=1)
    poisoned = actions(1)
    poisoned[2] = bad
    with pytest.raises(ValueError, match="environment 2"):
        env.step(poisoned)
    with pytest.raises(ValueError, match="shape"):
        env.step(actions(1, 2))
    assert np.array_equal(env.step(actions(1))[0], twin.step(actions(1))[0])


def test_what_a_step_returned_stays():
    """Catches buffers that the next step overwrites: a rollout buffer keeps references."""
    env = make_vec()
    env.reset(seed=2)
    observation, reward, _, _, infos = env.step(actions(1))
    kept = observation.copy(), reward.copy(), infos["pinion_angle"].copy()
    for k in range(50):
        env.step(actions(k))
    for before, now in zip(kept, (observation, reward, infos["pinion_angle"]), strict=True):
        assert np.array_equal(before, now)


def test_clipping_is_told_for_each_environment():
    """Catches one flag for all, and torque above the rating."""
    env = make_vec()
    env.reset(seed=0)
    *_, infos = env.step(np.array([[0.5], [-3.0], [1.0]], np.float32))
    assert infos["clipped"].tolist() == [False, True, False]
    assert set(Truth._fields) <= set(infos)


def test_seeds_and_options_of_a_reset():
    """Catches a reset that ignores its seeds, loses its options or takes unknown ones."""
    env = make_vec()
    first, _ = env.reset(seed=[5, None, 6], options={"speed_kmh": 30.0})
    again, infos = env.reset(seed=[5, 1, 6])
    assert np.array_equal(first, again)
    assert infos["speed"] == pytest.approx(np.full(N, 30.0 / 3.6))
    with pytest.raises(ValueError, match="seeds"):
        env.reset(seed=[1])
    with pytest.raises(InputError, match="speed_kmh"):
        env.reset(options={"speed": 30.0})
    with pytest.raises(ValueError, match="autoreset_mode"):
        make_vec(autoreset_mode=AutoresetMode.DISABLED)
    with pytest.raises(RuntimeError, match="reset"):
        make_vec().step(actions(0))


def test_made_by_its_id():
    """Catches a missing entry point and metadata that Gymnasium warns about."""
    env = make_vec(num_envs=2)
    assert isinstance(env, steer_env.envs.SteerVectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert env.action_space.shape == (2, 1)
    env.close()
