"""SteerVectorEnv: many steering systems that step together in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from steer_env.envs import batch
from steer_env.envs.blocks import new_blocks, start_lane, step_blocks
from steer_env.envs.lanes import switches_of
from steer_env.envs.layout import OBSERVATION_LIMIT, PARAMETERS, PERIOD, Truth
from steer_env.envs.steer_env import COMPLETE, NOISE_BLOCK, UNSTABLE, scales_of
from steer_env.envs.task import Ready, Task
from steer_env.physics._jit import COMPILED
from steer_env.physics.control_unit import Observation
from steer_env.physics.lanes import WIDTH

MODES = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
N_OBSERVED, N_TRUTH = len(Observation._fields), len(Truth._fields)
SPEED_OBSERVED, SPEED_TRUE = Observation._fields.index("speed"), Truth._fields.index("speed")
UNSTABLE_TRUE = Truth._fields.index("unstable")

Infos = dict[str, Any]
Step = tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], Infos]


class SteerVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """N environments of one task; bit for bit what N ``SteerEnv`` with the same seeds give.

    Made by ``gymnasium.make_vec(id, num_envs=N, vectorization_mode="vector_entry_point")`` with the
    options of ``Task``. Spaces, rewards and ends are those of ``SteerEnv``. Each environment has its
    own generator for randomisation and noise; ``reset(seed=s)`` seeds them s, s + 1, ... (or give a
    list), and without a seed they run on.

    ``autoreset_mode``: NEXT_STEP (default), where the step after an episode's end ignores the
    action, resets and pays no reward; or SAME_STEP, where the step that ends an episode returns the
    next one's first observation, the last one and its infos being in ``infos["final_obs"]`` and
    ``infos["final_info"]``.

    ``infos`` holds one array of n values for each field of ``Truth`` in SI, ``observation`` [n, 13]
    in SI, ``clipped`` and ``ended``, and for each name its mask ``_name`` (all True, read only).
    What a step returns is made anew and belongs to the caller; nothing else is allocated. A reset
    costs Python for each environment that is reset, and noise for one drawing of each in
    NOISE_BLOCK steps. An action that is not finite is a ValueError that leaves all as it was.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": MODES[0]}  # noqa: RUF012
    _observation: NDArray[np.float64]
    _scaled: NDArray[np.float32]
    _truth: NDArray[np.float64]
    _reward: NDArray[np.float64]
    _clipped: NDArray[np.bool_]
    _ended: NDArray[np.bool_]

    def __init__(self, num_envs: int = 1, autoreset_mode: AutoresetMode | str = MODES[0], **options: Any) -> None:
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        if self.autoreset_mode not in MODES:
            raise ValueError(f"autoreset_mode {self.autoreset_mode} is not one of {MODES}")
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        n = self.num_envs = num_envs
        self.task = Task().changed(options)
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.single_observation_space = gymnasium.spaces.Box(
            -OBSERVATION_LIMIT, OBSERVATION_LIMIT, (N_OBSERVED,), np.float32
        )
        self.action_space = batch_space(self.single_action_space, n)
        self.observation_space = batch_space(self.single_observation_space, n)
        self._per_rated = np.ones(n)
        self._rated_torque, self._shares = np.ones(n), np.zeros(n)
        self._noise, self._next_noise = np.zeros((n, NOISE_BLOCK, 2)), np.zeros(n, np.int64)
        self._left = np.zeros(n, np.int64)
        self._finite = np.zeros(n, np.bool_)
        self._generators: list[np.random.Generator] = []
        self._new_step()
        self._n_ended = self._n_lacking = 0
        self._running, self._all = np.full(n, "", object), np.ones(n, np.bool_)
        self._running.flags.writeable = self._all.flags.writeable = False
        # Checked now, so that a wrong option is told at make; what this draws is thrown away.
        self._keep(self.task)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], Infos]:
        """Start all episodes; ``options`` are fields of Task and hold until changed again."""
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        self._seed([None] * self.num_envs if seeds is None else seeds)
        if options:
            self._keep(self.task.changed(options))
        self._new_step()
        for i in range(self.num_envs):
            self._start(i)
        self._n_ended = self._n_lacking = 0
        return self._scaled, self._infos(self._running)

    def step(self, actions: NDArray[np.float32]) -> Step:
        """One control period with motor torques as shares [n, 1] of the rated torques."""
        if not self._generators:
            raise RuntimeError("step before reset: call reset() first")
        self._take(actions)
        over = self._ended if self._n_ended else None
        if over is not None and self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._next_noise[over] = 0  # stepped along with old noise, then started anew
        self._new_step()
        if self._n_lacking:
            for i in np.flatnonzero(self._next_noise == NOISE_BLOCK).tolist():
                self._draw_noise(i)
        self._n_ended, self._n_lacking = self._step_all()
        if over is not None and self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._begin_again(over)
        terminated = np.zeros(self.num_envs, np.bool_)
        if not self._n_ended:
            return self._scaled, self._reward, terminated, self._ended.copy(), self._infos(self._running)
        reasons = self._running.copy()
        unstable = self._truth[UNSTABLE_TRUE] > 0.5
        reasons[self._ended & unstable], reasons[self._ended & ~unstable] = UNSTABLE, COMPLETE
        infos = self._infos(reasons)
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            infos = self._restarted(infos)
        return self._scaled, self._reward, terminated, self._ended.copy(), infos

    def _step_all(self) -> tuple[int, int]:
        """One period of all environments; (how many ended, how many have no noise left)."""
        given: Any = (self._shares, self._rated_torque, self._noise, self._next_noise, self._left)
        tables: Any = (self._table, self._car_table, self._per_scale, self._per_rated)
        results: Any = (self._observation, self._scaled, self._truth, self._reward, self._clipped, self._ended)
        ended = lacking = 0
        if self._switches is not None and len(self._blocks[0]):
            ended, lacking = step_blocks(self._switches)(*given, *self._blocks, *tables, *results)
        if len(self._rows[0]):
            effects = cast(Any, self._effects)
            rest: Any = (*given, *self._rows, *tables, *results, effects)
            more = batch.step_vector(self._n_lanes, *rest)
            ended, lacking = ended + more[0], lacking + more[1]
        return ended, lacking

    def _begin_again(self, over: NDArray[np.bool_]) -> None:
        """NEXT_STEP: what had ended was stepped along with the others; a new episode takes its place."""
        self._n_ended -= int((self._ended & over).sum())
        self._ended[over], self._reward[over] = False, 0.0
        for i in np.flatnonzero(over).tolist():
            self._start(i)
        self._n_lacking = int((self._next_noise == NOISE_BLOCK).sum())

    def _take(self, actions: NDArray[np.float32]) -> None:
        """Actions into the buffer that the kernel reads, if all are finite."""
        given = np.asarray(actions).reshape(-1)
        if given.size != self.num_envs:
            raise ValueError(f"actions have shape {np.shape(actions)}: give ({self.num_envs}, 1)")
        if not np.isfinite(given, out=self._finite).all():
            i = int(np.argmin(self._finite))
            raise ValueError(f"action of environment {i} is {given[i]}: give finite shares of the rated torque")
        self._shares[:] = given

    def _restarted(self, infos: Infos) -> Infos:
        """SAME_STEP: start what ended; the infos of the new episodes, with the old ones inside."""
        ended = self._ended
        final: Infos = {name: ended if name[0] == "_" else value for name, value in infos.items()}
        last = np.full(self.num_envs, None, object)
        for i in np.flatnonzero(ended).tolist():
            last[i] = self._scaled[i].copy()
        self._observation, self._truth = self._observation.copy(), self._truth.copy()
        self._clipped = self._clipped.copy()
        for i in np.flatnonzero(ended).tolist():
            self._start(i)
        ends: Infos = {"final_obs": last, "_final_obs": ended, "final_info": final, "_final_info": ended}
        return self._infos(self._running) | ends

    def _new_step(self) -> None:
        """Arrays for what one step returns."""
        n = self.num_envs
        self._observation, self._truth = np.empty((N_OBSERVED, n)), np.empty((N_TRUTH, n))
        self._scaled = np.empty((n, N_OBSERVED), np.float32)
        self._reward = np.zeros(n)
        self._clipped, self._ended = np.zeros((2, n), np.bool_)

    def _start(self, i: int) -> None:
        """A new episode of one environment: its draws, rows at rest, first observation."""
        setup = self._ready.drawn(self._generators[i])
        rated_torque = self._rated_torque[i] = PARAMETERS.read(setup.row, "motor").rated_torque
        self._per_rated[i] = 1.0 / rated_torque
        if i < self._n_lanes:
            start_lane(*self._blocks, i, setup.row, self._table, self._car_table)
        else:
            k = i - self._n_lanes
            parameters, states, lines = (rows[k : k + 1] for rows in self._rows)
            parameters[0] = setup.row
            batch.start_batch(parameters, states, lines, self._table, self._car_table)
        self._left[i] = setup.periods
        self._draw_noise(i)
        speed = PARAMETERS.read(setup.row, "episode").speed
        self._observation[:, i], self._observation[SPEED_OBSERVED, i] = 0.0, speed
        self._scaled[i] = self._observation[:, i] * self._per_scale
        self._truth[:, i], self._truth[SPEED_TRUE, i] = 0.0, speed
        self._clipped[i] = False

    def _draw_noise(self, i: int) -> None:
        self._generators[i].standard_normal(out=self._noise[i])
        self._next_noise[i] = 0

    def _seed(self, seeds: Sequence[int | None]) -> None:
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments")
        before: Sequence[Any] = self._generators or [None] * self.num_envs
        self._generators = [
            old if old is not None and seed is None else seeding.np_random(seed)[0]
            for old, seed in zip(before, seeds, strict=True)
        ]

    def _keep(self, task: Task) -> None:
        ready = Ready(task, PERIOD)
        setup = ready.drawn(np.random.default_rng(0))
        self._ready = ready
        self.task, self._table, self._car_table, self._effects = task, setup.table, setup.car_table, setup.effects
        self._switches = switches_of(setup.row, setup.table, setup.car_table) if setup.effects is None else None
        # Full blocks of lanes, and rows for what is left over or cannot be run in lanes.
        n_blocks = 0 if self._switches is None or not COMPILED else self.num_envs // WIDTH
        self._n_lanes = n_blocks * WIDTH
        self._per_scale = 1.0 / np.array(scales_of(task.causality, 1.0))
        self._blocks, self._rows = new_blocks(n_blocks), batch.new_rows(self.num_envs - self._n_lanes)

    def _infos(self, ended: NDArray[Any]) -> Infos:
        infos: Infos = dict(zip(Truth._fields, self._truth, strict=True))
        infos["observation"], infos["clipped"], infos["ended"] = self._observation.T, self._clipped, ended
        return infos | {f"_{name}": self._all for name in infos}
