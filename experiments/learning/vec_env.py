"""Many environments that step together at the policy's rate, as stable-baselines3 wants them.

The base law and the control periods between two steps of the policy run inside one compiled call.
"""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from controllers.policy_law import SIGNAL_LIMIT, Memory, Signals
from experiments.learning.arrangement import Arrangement
from experiments.learning.config import RewardWeights
from experiments.learning.kernel import N_OBSERVED, PARTS, Judged, Rows
from experiments.learning.records import numbers_in
from experiments.rollout import first_observation
from steer_env.envs import batch
from steer_env.envs.layout import PERIOD

Array = NDArray[np.float64]

N_SIGNALS = len(Signals._fields)
REWARD_SCALE = 0.1  # returns of order 1 to 10 suit the networks
THROWN = 20.0  # steps at the worst tracking that a thrown wheel costs
STARTS = ("parameters", "states", "lines", "base", "memory", "judged", "observations")
KEPT = (*STARTS, "commands", "left")


class PolicyVecEnv(VecEnv):
    """``num_envs`` environments of one arrangement; one step is ``decimation`` control periods.

    Observations [n, 35] float32: the signals over their scales, the same times the speed's deviation, and
    that deviation (for the critic alone). Actions [n, 1] in [-1, 1]. ``parts`` holds the reward's named
    parts [n, 4] of the last step, unweighted; ``infos`` of ended episodes hold their means by name.

    Episodes end by truncation; a wheel that was thrown is a terminal state and costs THROWN steps. All that
    is random comes from one generator: ``state()`` and ``restore()`` carry everything over to another process.
    """

    def __init__(self, arrangement: Arrangement, num_envs: int, reward: RewardWeights, seed: int) -> None:
        self.arrangement, self.weights = arrangement, np.array(reward)
        self.groups = [part for part in np.array_split(np.arange(num_envs), len(arrangement.drawers)) if part.size]
        self.rng = np.random.default_rng((seed, 1))
        self._decimation = arrangement.decimation
        self.rows = [self._new_rows(group.size, laws) for group, laws in self._each()]
        self.signals, self.parts = np.zeros((num_envs, N_SIGNALS)), np.zeros((num_envs, len(PARTS)))
        self._ended, self._unstable = np.zeros((2, num_envs), np.bool_)
        self._totals, self._lengths = np.zeros((num_envs, len(PARTS))), np.zeros(num_envs)
        self._returns = np.zeros(num_envs)
        self._tables = [(np.zeros((0, 0)), np.zeros((0, 0)))] * len(self.groups)
        self._began, self._fresh = time.time(), True
        self.time_inside = 0.0
        self.render_mode = None
        box = gymnasium.spaces.Box(-np.inf, np.inf, (2 * N_SIGNALS + 1,), np.float32)
        super().__init__(num_envs, box, gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32))

    def reset(self) -> NDArray[np.float32]:
        """Start all episodes; the first ones end at random times, so that they do not go in step."""
        for k, group in enumerate(self.groups):
            self._start(k, np.arange(group.size))
        if self._fresh:
            for left in (rows.left for rows in self.rows):
                left[:] = np.maximum((left * self.rng.uniform(0.1, 1.0, left.size)).astype(np.int64), self._decimation)
        self._fresh = False
        self._totals[:], self._lengths[:], self._returns[:] = 0.0, 0.0, 0.0
        return self.observed()

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions [n, 1]; ``step_wait`` does the work."""
        self._actions = np.clip(np.asarray(actions, np.float64).reshape(-1), -1.0, 1.0)

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """One step of the policy: observations, rewards, dones, infos."""
        began = time.perf_counter()
        noise = self.rng.standard_normal((self.num_envs, self._decimation, 2))
        count = 0
        for k, group in enumerate(self.groups):
            part = slice(group[0], group[-1] + 1)
            step, _, acting = self.arrangement.compiled(k)
            count += step(
                self._actions[part], noise[part], self.rows[k], *self._tables[k], acting,
                self.signals[part], self.parts[part], self._ended[part], self._unstable[part],
            )  # fmt: skip
        rewards = self.parts @ self.weights - THROWN * self.weights[0] * 10.0 * self._unstable
        rewards *= REWARD_SCALE
        self._totals += self.parts
        self._lengths += 1
        self._returns += rewards
        observed = self.observed()
        goes_on: dict[str, Any] = {}
        infos = [goes_on] * self.num_envs
        dones = self._ended.copy()
        if count:
            for i in np.flatnonzero(dones).tolist():
                infos[i] = self._info(i, observed[i])
            for k, group in enumerate(self.groups):
                self._start(k, np.flatnonzero(dones[group]))
            self._totals[dones], self._lengths[dones], self._returns[dones] = 0.0, 0.0, 0.0
            observed = self.observed()
        self.time_inside += time.perf_counter() - began
        return observed, rewards.astype(np.float32), dones, infos

    def observed(self) -> NDArray[np.float32]:
        """What the policy sees [n, 35]."""
        shares = np.nan_to_num(self.signals * self.arrangement.gains)
        np.clip(shares, -SIGNAL_LIMIT, SIGNAL_LIMIT, out=shares)
        speeds = np.concatenate([rows.observations[:, self.arrangement.speed_column] for rows in self.rows])
        deviation = ((speeds - self.arrangement.mean_speed) / self.arrangement.speed_scale)[:, None]
        return np.concatenate([shares, shares * deviation, deviation], axis=1).astype(np.float32)

    def state(self) -> dict[str, Any]:
        """Everything that changes, as arrays and plain values."""
        rows = [{name: getattr(rows, name).copy() for name in KEPT} for rows in self.rows]
        names = ("signals", "_totals", "_lengths", "_returns")
        return {"rows": rows, "rng": self.rng.bit_generator.state} | {n: getattr(self, n).copy() for n in names}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from what ``state()`` gave."""
        self.reset()
        for rows, kept in zip(self.rows, state["rows"], strict=True):
            for name in KEPT:
                getattr(rows, name)[:] = kept[name]
        for name in ("signals", "_totals", "_lengths", "_returns"):
            getattr(self, name)[:] = state[name]
        self.rng.bit_generator.state = state["rng"]

    def _each(self) -> Any:
        return zip(self.groups, self.arrangement.laws, strict=False)

    def _new_rows(self, n: int, law: Any) -> Rows:
        size = len(numbers_in(law.state))
        return Rows(
            *batch.new_rows(n), np.zeros((n, size)), np.zeros((n, len(Memory._fields))),
            np.zeros((n, len(Judged._fields))), np.zeros((n, N_OBSERVED)), np.zeros(n), np.zeros(n, np.int64),
        )  # fmt: skip

    def _start(self, k: int, which: NDArray[np.int64]) -> None:
        """New episodes of some environments (numbers within group ``k``)."""
        rows, group = self.rows[k], self.groups[k]
        for i in which.tolist():
            setup, periods = self.arrangement.drawers[k].draw(self.rng)
            rows.parameters[i], rows.left[i] = setup.row, periods
            self._tables[k] = setup.table, setup.car_table
            batch.start_batch(
                rows.parameters[i : i + 1], rows.states[i : i + 1], rows.lines[i : i + 1], *self._tables[k]
            )
            rows.base[i] = numbers_in(self.arrangement.laws[k].state)
            rows.memory[i], rows.judged[i] = 0.0, 0.0
            rows.observations[i] = first_observation(setup)
        if which.size:
            _, start, acting = self.arrangement.compiled(k)
            start(which, rows, acting, self.signals[group[0] : group[-1] + 1])

    def _info(self, i: int, observed: NDArray[np.float32]) -> dict[str, Any]:
        length = int(self._lengths[i])
        means = self._totals[i] / length
        return {
            "terminal_observation": observed.copy(),
            "TimeLimit.truncated": not self._unstable[i],
            "unstable": bool(self._unstable[i]),
            "parts": dict(zip(PARTS, means.tolist(), strict=True)),
            "episode": {
                "r": float(self._returns[i]), "l": length, "t": round(time.time() - self._began, 6),
                "seconds": length * self._decimation * PERIOD,
            },
        }  # fmt: skip

    def close(self) -> None:
        """Nothing is open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of this object, which all environments share."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the environments are rows of arrays."""
        raise AttributeError(f"{attr_name} is not set on single environments")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refused: the environments are rows of arrays, not objects."""
        raise AttributeError(f"{method_name} cannot be called on single environments")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """True for Monitor, whose episode statistics this gives."""
        return [issubclass(wrapper_class, Monitor)] * len(list(self._get_indices(indices)))
