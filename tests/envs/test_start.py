"""What a start of an environment loads, what a copy of one shares, and what steps leave behind."""

import copy
import gc
import os
import pickle
import subprocess
import sys
import tracemalloc

import gymnasium
import numpy as np
import pytest

import steer_env  # noqa: F401  (registers the ids)
from steer_env.envs import SteerEnv
from steer_env.envs.cell import NOISE_BLOCK
from steer_env.physics._jit import COMPILED

ENV_ID = "steer_env/EPAS-Impedance-v0"
ACTION = np.array([0.1], np.float32)
FIRST_STEP = f"""
import sys, gymnasium, numpy, steer_env
env = gymnasium.make("{ENV_ID}", manoeuvre="step_steer")
env.reset(seed=4)
print(env.step(numpy.array([0.1], numpy.float32))[0].tobytes().hex())
print("|", *sys.modules)
"""


@pytest.mark.skipif(not COMPILED, reason="numba is switched off")
@pytest.mark.skipif(os.environ.get("STEER_ENV_CACHE") == "0", reason="nothing is kept on disk")
def test_a_first_step_from_a_filled_cache_loads_neither_numba_nor_scipy():
    """Catches an import that comes back, whose second every script would wait for."""
    env = gymnasium.make(ENV_ID, manoeuvre="step_steer")
    env.reset(seed=4)  # fills the cache where it is empty
    expected = env.step(ACTION)[0].tobytes().hex()
    done = subprocess.run([sys.executable, "-c", FIRST_STEP], capture_output=True, text=True, check=True)
    seen, loaded = done.stdout.split("|")
    assert seen.strip() == expected
    assert "llvmlite.binding" in loaded.split()
    assert not {"numba", "scipy", "control", "matplotlib"} & set(loaded.split())


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_alone(duplicate):
    """Catches a copy whose machine code works on the arrays of the original, or forgets its noise."""
    env, alone = (SteerEnv(manoeuvre="step_steer") for _ in range(2))
    untouched = duplicate(env)
    for e in (env, alone, untouched):
        e.reset(seed=1)
    for _ in range(NOISE_BLOCK + 5):
        env.step(ACTION), alone.step(ACTION)
    other = duplicate(env)
    for _ in range(2 * NOISE_BLOCK):
        other.step(-ACTION)
    for _ in range(2 * NOISE_BLOCK):
        assert env.step(ACTION)[0].tolist() == alone.step(ACTION)[0].tolist()
    for e in (env, alone, other, untouched):
        e.reset(seed=2)
    for _ in range(NOISE_BLOCK + 5):
        seen = [e.step(ACTION)[0].tolist() for e in (env, alone, other, untouched)]
        assert seen.count(seen[0]) == 4


def grown(step, n):
    """Bytes held more after n more steps, what a step returns thrown away."""

    def held():
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        for _ in range(n):
            step()
        before = held()
        for _ in range(n):
            step()
        return held() - before
    finally:
        tracemalloc.stop()


def test_steps_leave_nothing_behind():
    """Catches a list or a cache that grows with steps or draws of noise: less than one byte a step, in one episode."""
    env = gymnasium.make(ENV_ID, duration=60.0)
    env.reset(seed=0)
    assert grown(lambda: env.step(ACTION), 1200) < 1200
    n = 40 if COMPILED else 2  # with lanes and without
    many = gymnasium.make_vec(ENV_ID, n, vectorization_mode="vector_entry_point", duration=60.0)
    many.reset(seed=0)
    actions = np.full((n, 1), 0.1, np.float32)
    assert grown(lambda: many.step(actions), 1200) < 1200
