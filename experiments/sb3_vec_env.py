"""A stable-baselines3 VecEnv over SteerVectorEnv: the same kernels, no loop over environments.

It lives here because only experiments may depend on a learning library (extra ``learn``).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from steer_env.envs import SteerVectorEnv


class SteerVecEnv(VecEnv):
    """``SteerVecEnv("steer_env/EPAS-Impedance-v0", 64, **task options)``.

    Gives what DummyVecEnv over single environments gives, bit for bit: ``terminal_observation`` and
    ``TimeLimit.truncated`` where an episode ended (our ends are all truncations), and in addition
    ``episode`` with return "r", length "l" and seconds since the start "t" as Monitor does, and
    ``ended``, the reason. Environments whose episode goes on share one empty info, so that a step
    costs no Python for each environment; the signals of all are in ``signals`` by name.
    """

    def __init__(self, env_id: str, num_envs: int, **options: Any) -> None:
        options["autoreset_mode"] = AutoresetMode.SAME_STEP
        made: Any = gymnasium.make_vec(env_id, num_envs, vectorization_mode="vector_entry_point", **options)
        self.env: SteerVectorEnv = made
        self.signals: dict[str, Any] = {}
        self._returns, self._lengths = np.zeros(num_envs), np.zeros(num_envs, np.int64)
        self._began = time.time()
        super().__init__(num_envs, made.single_observation_space, made.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Start all episodes, with what ``seed`` and ``set_options`` left for this reset."""
        if any(options != self._options[0] for options in self._options):
            raise ValueError("set_options: all environments take the same options; give one dict")
        observations, self.signals = self.env.reset(seed=self._seeds, options=self._options[0] or None)
        self._reset_seeds()
        self._reset_options()
        self._returns[:], self._lengths[:] = 0.0, 0
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions [n, 1]; ``step_wait`` does the work."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """One period: observations, rewards, dones, infos."""
        observations, rewards, _, dones, self.signals = self.env.step(self._actions)
        self._returns += rewards
        self._lengths += 1
        goes_on: dict[str, Any] = {}
        infos = [goes_on] * self.num_envs
        if "final_obs" in self.signals:
            now = round(time.time() - self._began, 6)
            for i in np.flatnonzero(dones).tolist():
                infos[i] = {
                    "terminal_observation": self.signals["final_obs"][i],
                    "TimeLimit.truncated": True,
                    "ended": self.signals["final_info"]["ended"][i],
                    "episode": {"r": round(float(self._returns[i]), 6), "l": int(self._lengths[i]), "t": now},
                }
            self._returns[dones], self._lengths[dones] = 0.0, 0
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Nothing is open."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of SteerVectorEnv, which all environments share."""
        return [getattr(self.env, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: a task changes at a reset."""
        raise AttributeError(f"{attr_name} is not set on single environments; use set_options() before reset()")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refused: the environments are rows of arrays, not objects."""
        raise AttributeError(f"{method_name} cannot be called on single environments; use .env, the SteerVectorEnv")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """True for Monitor, whose episode statistics this gives; a VecMonitor on top is needless."""
        return [issubclass(wrapper_class, Monitor)] * len(self._chosen(indices))

    def _chosen(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
