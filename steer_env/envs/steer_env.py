"""SteerEnv: one steering system that has to feel like its reference."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from steer_env.envs import batch
from steer_env.envs.cell import (
    CELL_SIZE,
    N_TRUE,
    NOISE_BLOCK,
    OBSERVED_CELLS,
    REPORT_CELLS,
    SCALE_CELLS,
    rows_of,
    step_cell,
)
from steer_env.envs.layout import OBSERVATION_LIMIT, OBSERVATION_SCALES, PARAMETERS, PERIOD, Truth
from steer_env.envs.task import Setup, Task, prepare
from steer_env.physics.control_unit import Observation
from steer_env.physics.motor import Motor
from steer_env.plants import Plant, Reference

UNSTABLE = "unstable: the wheel was thrown beyond any sane rate or torque"
COMPLETE = "end of the manoeuvre"
RENDER_FPS = 25
TRUTH_NAMES = Truth._fields
_record: Any = tuple.__new__  # what Observation._make does, without its call and its check of the length


class SteerEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A driver turns a wheel; the motor must make it feel like the reference. One step is 1 ms.

    ## Action
    Box(-1, 1, (1,)): motor torque as a share of the motor's rated torque, positive to the left.
    Beyond +-1 it is clipped and ``info["clipped"]`` says so; NaN is a ValueError that leaves the
    state untouched.

    ## Observation
    Box(-10, 10, (13,), float32): the fields of ``Observation`` in its order, each divided by its
    unit in ``OBSERVATION_SCALES``. It holds measured signals only (resolution, noise, latency), the
    reference made from them, speed and the last four commands. ``info["observation"]`` is the same
    in SI, as controllers take it.

    ## Reward
    Sum of ``reward_tracking`` (minus the true error against the ideal reference in units of 0.5 N m
    or 1 deg), ``reward_smoothness`` and ``reward_effort``, each in ``info``. The ideal reference is
    fed with true signals, so a late or noisy reference earns nothing.

    ## Start and end
    At rest, straight ahead. Truncated at the end of the manoeuvre, or where the wheel is thrown
    (``info["ended"]`` tells which). Never terminated. ``info`` has the fields of ``Truth`` in SI.

    ## Options
    Fields of ``Task``, at ``gymnasium.make`` and, until changed again, in ``reset(options={...})``.

    ## Version history
    v0: first.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (Gymnasium reads it from the class)
        "render_modes": ["rgb_array", "human"],
        "render_fps": RENDER_FPS,
    }

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode {render_mode!r} is not one of {self.metadata['render_modes']}")
        self.render_mode = render_mode
        self.task = Task().changed(options)
        n = len(Observation._fields)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, (n,), np.float32)
        self._cell, self._scaled, self._noise = np.zeros(CELL_SIZE), np.zeros(n, np.float32), np.zeros((NOISE_BLOCK, 2))
        self._viewer: Any = None
        # Checked now, so that a wrong option is told at make; what this draws is thrown away.
        self._setup: Setup = prepare(self.task, np.random.default_rng(0), PERIOD)
        self._period = -1

    @property
    def plant(self) -> Plant:
        """The plant before randomisation."""
        return self._setup.plant

    @property
    def reference(self) -> Reference:
        """The haptic reference; its ``to_statespace()`` is Eq. 10 at the episode's first speed."""
        speed = PARAMETERS.read(self._setup.row, "episode").speed
        return replace(self._setup.reference, speed=speed)

    @property
    def motor(self) -> Motor:
        """The motor of this episode."""
        motor: Motor = PARAMETERS.read(self._setup.row, "motor")
        return motor

    @property
    def observation(self) -> Observation:
        """The latest observation in SI, as controllers take it."""
        return Observation._make(self._cell[OBSERVED_CELLS].tolist())

    def action_for(self, torque: float) -> NDArray[np.float32]:
        """The action that commands a motor torque in N m."""
        return np.array([torque / self._rated_torque], np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; ``options`` are fields of Task and hold until changed again."""
        super().reset(seed=seed)
        if options:
            self.task = self.task.changed(options)
        self._setup = prepare(self.task, self.np_random, PERIOD)
        self._bind()
        self._rows[0][0] = self._setup.row
        self._rated_torque = self.motor.rated_torque
        per_scale = 1.0 / np.array(scales_of(self.task.causality, self._rated_torque))
        self._cell[SCALE_CELLS] = per_scale
        batch.start_batch(*self._rows, self._setup.table, self._setup.car_table)
        self._period = 0
        self._draw_noise()
        speed = PARAMETERS.read(self._setup.row, "episode").speed
        self._report[:] = 0.0
        self._report[[TRUTH_NAMES.index("speed"), N_TRUE + Observation._fields.index("speed")]] = speed
        self._scaled[:] = self._cell[OBSERVED_CELLS] * per_scale
        if self._viewer is not None:
            self._viewer.restart()
        return self._scaled.copy(), self._info(clipped=False, ended="")

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One control period with a motor torque as a share of the rated torque."""
        if self._period < 0:
            raise RuntimeError("step before reset: call env.reset() first")
        share = float(action.item() if type(action) is np.ndarray else np.asarray(action).item())
        if not math.isfinite(share):
            raise ValueError(f"action is {share}: give a finite share of the rated torque in [-1, 1]")
        clipped = share < -1.0 or share > 1.0
        command = math.copysign(self._rated_torque, share) if clipped else share * self._rated_torque
        if self._period % NOISE_BLOCK == 0 and self._period > 0:
            self._draw_noise()
        reward = self._advance(command)
        self._period += 1
        ended = COMPLETE if self._period >= self._setup.periods else ""
        info = self._info(clipped, ended)
        if info["unstable"] > 0.5:
            ended = info["ended"] = UNSTABLE
        if self._viewer is not None or self.render_mode == "human":
            self._record(info)
        return self._scaled.copy(), reward, False, bool(ended), info

    def _info(self, clipped: bool, ended: str) -> dict[str, Any]:
        values = self._report.tolist()
        info: dict[str, Any] = dict(zip(TRUTH_NAMES, values, strict=False))  # the observation comes after the truth
        info["observation"] = _record(Observation, values[N_TRUE:])
        info["clipped"] = clipped
        info["ended"] = ended
        return info

    def _draw_noise(self) -> None:
        self.np_random.standard_normal(out=self._noise)

    def _bind(self) -> None:
        """Compiled code and views of the cell at the addresses where the arrays now lie."""
        self._rows, self._report, setup = rows_of(self._cell), self._cell[REPORT_CELLS], self._setup
        tables = setup.table, setup.car_table, setup.effects
        self._advance = step_cell.bound(self._noise, self._cell, self._rows[2][0], self._scaled, *tables)

    def __getstate__(self) -> dict[str, Any]:
        """All but what points into the arrays, so that a copy gets its own."""
        bound = ("_advance", "_report", "_rows")
        return {name: value for name, value in self.__dict__.items() if name not in bound}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self._period >= 0:
            self._bind()

    def render(self) -> NDArray[np.uint8] | None:
        """The wheel and the traces against the reference, as an image [h, w, 3]."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() without a render_mode; give one at gymnasium.make")
            return None
        image: NDArray[np.uint8] = self._ensure_viewer().draw()
        return image if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window, if any."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _record(self, info: dict[str, Any]) -> None:
        self._ensure_viewer().record(info)

    def _ensure_viewer(self) -> Any:
        if self._viewer is None:
            from steer_env.envs.viewer import Viewer  # matplotlib loads when something is drawn

            self._viewer = Viewer(self.task.causality, self.render_mode == "human")
        return self._viewer


def scales_of(causality: str, rated_torque: float) -> Observation:
    """What one unit of each scaled observation is, SI; ``rated_torque`` in N m."""
    scales = OBSERVATION_SCALES._replace(
        last_torque_1=rated_torque,
        last_torque_2=rated_torque,
        last_torque_3=rated_torque,
        last_torque_4=rated_torque,
    )
    if causality == "admittance":
        return scales._replace(reference=scales.pinion_angle, reference_rate=scales.pinion_rate)
    return scales
