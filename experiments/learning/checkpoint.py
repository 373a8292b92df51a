"""A training run on disk, whole or not at all: model, optimiser, random states, environments, replay buffer.

Arrays are kept as tensors, so that a checkpoint is read back with ``weights_only``: reading one runs no code.
"""

from __future__ import annotations

import io
import json
import pickle
import random
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import ReplayBuffer

from experiments.learning.vec_env import PolicyVecEnv
from steer_env import atomic
from steer_env.errors import InputError

NAME = "checkpoint.pt"
BUFFER = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def save(path: Path, agent: Any, env: PolicyVecEnv, told: dict[str, Any]) -> None:
    """Everything that a run needs to go on as if nothing had happened; ``told`` are plain values beside it."""
    content = {
        "told": json.dumps(told),
        "parameters": agent.get_parameters(),
        "steps": agent.num_timesteps,
        "updates": agent._n_updates,
        "env": _tensors(env.state()),
        "last": _tensors([agent._last_obs, np.asarray(agent._last_episode_starts)]),
        "episodes": json.dumps(list(agent.ep_info_buffer or [])),
        "random": _random_states(),
        "buffer": _buffer_of(agent),
    }
    if getattr(agent, "log_ent_coef", None) is not None:
        content["log_ent_coef"] = agent.log_ent_coef.detach()
    stream = io.BytesIO()
    torch.save(content, stream)
    atomic.write_bytes(path, stream.getvalue())


def read(path: Path) -> dict[str, Any]:
    """What ``save`` wrote; InputError where it is something else."""
    try:
        content: dict[str, Any] = torch.load(path, weights_only=True)
        content["told"] = json.loads(content["told"])
    except (RuntimeError, pickle.UnpicklingError, EOFError, KeyError, TypeError, ValueError) as wrong:
        raise InputError(str(path), f"this is no checkpoint ({wrong})", "remove it to begin anew") from wrong
    return content


def restore(content: dict[str, Any], agent: Any, env: PolicyVecEnv) -> None:
    """Bring agent and environments (just made, from the same configuration) to where ``save`` was called."""
    agent.set_parameters(content["parameters"], exact_match=True)
    if "log_ent_coef" in content:
        with torch.no_grad():
            agent.log_ent_coef.copy_(content["log_ent_coef"])
    agent.num_timesteps, agent._n_updates = content["steps"], content["updates"]
    env.restore(_arrays(content["env"]))
    agent._last_obs, agent._last_episode_starts = _arrays(content["last"])
    # Where there is none yet, learn() would make a new one.
    agent.ep_info_buffer, agent.ep_success_buffer = _deques(json.loads(content["episodes"]))
    kept, buffer = content["buffer"], getattr(agent, "replay_buffer", None)
    if buffer is not None:
        for name in BUFFER:
            getattr(buffer, name)[: len(kept[name])] = kept[name].numpy()
        buffer.pos, buffer.full = kept["pos"], kept["full"]
    states = content["random"]
    torch.set_rng_state(states["torch"])
    numpy_state = json.loads(states["numpy"])
    np.random.set_state((numpy_state[0], np.array(numpy_state[1], np.uint32), *numpy_state[2:]))  # noqa: NPY002
    version, inner, gauss = json.loads(states["python"])
    random.setstate((version, tuple(inner), gauss))


def _deques(episodes: list[Any]) -> tuple[Any, Any]:
    from collections import deque

    return deque(episodes, maxlen=100), deque(maxlen=100)


def _random_states() -> dict[str, Any]:
    """The global generators, which stable-baselines3 draws from."""
    name, keys, *rest = np.random.get_state()  # noqa: NPY002
    return {
        "torch": torch.get_rng_state(),
        "numpy": json.dumps([name, np.asarray(keys).tolist(), *rest]),
        "python": json.dumps(random.getstate()),
    }


def _buffer_of(agent: Any) -> dict[str, Any]:
    buffer = getattr(agent, "replay_buffer", None)
    if not isinstance(buffer, ReplayBuffer):
        return {}
    filled = buffer.buffer_size if buffer.full else buffer.pos
    arrays = {name: torch.from_numpy(getattr(buffer, name)[:filled].copy()) for name in BUFFER}
    return {**arrays, "pos": buffer.pos, "full": buffer.full}


def _tensors(value: Any) -> Any:
    """Arrays inside of lists and dicts become tensors; a generator's state (whole numbers beyond 64 bits) a text."""
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value.copy())
    if isinstance(value, dict):
        if "bit_generator" in value:
            return json.dumps(value)
        return {name: _tensors(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_tensors(item) for item in value]
    return value


def _arrays(value: Any) -> Any:
    if isinstance(value, torch.Tensor):
        return value.numpy()
    if isinstance(value, dict):
        return {name: _arrays(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_arrays(item) for item in value]
    return json.loads(value) if isinstance(value, str) else value
