"""More of the past in the observation, for rigs whose delay is longer than what the observation already spans.

The observation of every environment ends with the last four commands: with a delay of up to four periods the state is
Markov again (the delayed-action argument of Katsikopoulos and Engelbrecht, 2003). ``steer-env rig check`` measures the
delay; where it is longer, wrap:

    env = AppliedActions(gymnasium.make("steer_env/Rig-Impedance-v0", ...), count=7)

The space grows by what is added, and a policy must be trained for it; without the wrapper all spaces are the same.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from steer_env.errors import InputError

HELD = 4  # commands that an observation holds already
MOST = 64

Step = tuple[NDArray[np.float32], Any, bool, bool, dict[str, Any]]


class AppliedActions(gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """Append the applied commands beyond the last four, newest first, as shares of the rated torque.

    What was applied, not what was asked for: after limits and safety layer. ``count`` is how many there are in all.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], count: int) -> None:
        if not HELD <= count <= MOST:
            raise InputError("AppliedActions", f"count is {count}", f"give {HELD} to {MOST}")
        gymnasium.utils.RecordConstructorArgs.__init__(self, count=count)
        super().__init__(env)
        space: Any = env.observation_space
        more = count - HELD
        self.observation_space = gymnasium.spaces.Box(
            np.concatenate([space.low, np.full(more, -1.0)]).astype(np.float32),
            np.concatenate([space.high, np.full(more, 1.0)]).astype(np.float32),
            dtype=np.float32,
        )
        self._past: deque[float] = deque(maxlen=count)

    def reset(self, **kwargs: Any) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode: nothing was applied yet."""
        observation, info = self.env.reset(**kwargs)
        self._past.extend([0.0] * (self._past.maxlen or 0))
        return self._with_past(observation), info

    def step(self, action: Any) -> Step:
        """One period; the newest applied command moves in."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        inside: Any = self.env.unwrapped
        self._past.appendleft(info["command"] / inside.motor.rated_torque)
        return self._with_past(observation), reward, terminated, truncated, info

    def _with_past(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.concatenate([observation, np.array(list(self._past)[HELD:], np.float32)])
