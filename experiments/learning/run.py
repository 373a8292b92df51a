"""One training run in a folder: it goes on where it was, and leaves policy.safetensors and policy.json.

Beside them: checkpoint.pt (every minute), snapshots (the policy as it was at a time, for curves),
tensorboard, and run.json (wall time, steps and mean reward parts over the run).
"""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import configure_logger

from controllers import policy_file
from controllers.policy_file import Policy
from experiments.learning import checkpoint, imitation
from experiments.learning.agent import make_agent, weights_of
from experiments.learning.arrangement import Arrangement, Scales, base_gains
from experiments.learning.calibration import measured
from experiments.learning.config import FULL_TORQUE, TrainConfig
from experiments.learning.gate import gated
from experiments.learning.kernel import PARTS
from experiments.learning.vec_env import PolicyVecEnv
from steer_env import __version__, atomic
from steer_env.envs.layout import PERIOD
from steer_env.errors import InputError

CHECKPOINT_S = 60.0
PACKAGES = ("torch", "stable-baselines3", "numpy", "numba", "gymnasium")
Advance = Callable[..., None]


class Run:
    """Agent, environments and what is known of a run so far."""

    def __init__(self, config: TrainConfig, folder: Path) -> None:
        self.config, self.folder, self.path = config, folder, folder / checkpoint.NAME
        kept = checkpoint.read(self.path) if self.path.exists() else None
        if kept is not None and kept["told"]["config"] != config.plain():
            what = "another run, with other settings, is in this folder"
            raise InputError(str(folder), what, "give another --out, or the same settings to go on")
        scales = Scales(*kept["told"]["measured"]) if kept else measured(config)
        self.told: dict[str, Any] = kept["told"] if kept else {
            "config": config.plain(), "measured": [list(scales.scales), scales.authority],
            "wall_s": 0.0, "cpu_s": 0.0, "log": [], "snapshots": [],
        }  # fmt: skip
        self.arrangement = Arrangement(config, scales)
        self.env = PolicyVecEnv(self.arrangement, config.learning.environments, config.reward, config.seed)
        self.agent = make_agent(config, self.env, str(folder / "tensorboard"))
        if kept is not None:
            checkpoint.restore(kept, self.agent, self.env)
        elif config.learning.imitate:
            self.told["imitation"] = imitation.imitate(self.agent, config, self.arrangement)
        self.began = time.perf_counter() - self.told["wall_s"]
        self.cpu_began = time.process_time() - self.told["cpu_s"]

    @property
    def wall(self) -> float:
        """Seconds of training so far, those before an interruption included."""
        return time.perf_counter() - self.began

    @property
    def cpu(self) -> float:
        """The same in seconds of the processor: what the wall time would be on a core of its own."""
        return time.process_time() - self.cpu_began

    def learn(self, advance: Advance = lambda *_, **__: None, snapshot_s: float = 0.0) -> Policy:
        """Train to the end, write the policy's files and return it."""
        total, done = self.config.learning.steps, self.agent.num_timesteps
        advance(done, note="kept" if done else "")
        if done < total:
            callback = _Keeper(self, advance, snapshot_s)
            self.agent.set_logger(configure_logger(0, str(self.folder / "tensorboard"), "run", not done))
            self.agent.learn(total - done, callback, log_interval=4, reset_num_timesteps=False)
            self.told |= {"wall_s": self.wall, "cpu_s": self.cpu}
            self.keep()
        policy = gated(self.policy(), self.arrangement.drawers[0].reference)
        policy_file.save(policy, self.folder)
        atomic.write_text(self.folder / "run.json", json.dumps(self.told, indent=1) + "\n")
        return policy

    def keep(self) -> None:
        """Write the checkpoint."""
        checkpoint.save(self.path, self.agent, self.env, self.told)

    def policy(self) -> Policy:
        """The policy as it is now."""
        config, scales = self.config, self.arrangement.measured
        training = {
            "config": config.plain(),
            "seed": config.seed,
            "steps": self.agent.num_timesteps,
            "wall_s": round(self.wall, 1),
            "cpu_s": round(self.cpu, 1),
            "imitation": self.told.get("imitation"),
            "software_version": __version__,
            "versions": {name: version(name) for name in PACKAGES} | {"python": platform.python_version()},
        }
        base = None if config.action.base == FULL_TORQUE else config.action.base
        return Policy(
            plant=config.plant,
            causality=config.causality,
            base=base,
            base_gains=base_gains(config),
            authority=scales.authority,
            shares=((0.0, 1.0),),
            sample_time=round(config.action.decimation * PERIOD, 9),
            bandwidth_Hz=config.action.bandwidth_Hz,
            squashed=config.learning.algorithm != "ppo",
            scales=scales.scales,
            keep=self.arrangement.keep,
            mean_speed=self.arrangement.mean_speed,
            speed_scale=self.arrangement.speed_scale,
            slope_limit=config.action.slope_limit,
            history=config.action.history,
            training=training,
            weights=weights_of(self.agent),
        )


class _Keeper(BaseCallback):
    """Checkpoints, snapshots, named reward parts and progress."""

    def __init__(self, run: Run, advance: Advance, snapshot_s: float) -> None:
        super().__init__()
        self.run, self.advance, self.snapshot_s = run, advance, snapshot_s
        self.saved, self.shown, self.sums, self.count = run.wall, run.agent.num_timesteps, [0.0] * len(PARTS), 0

    def _on_rollout_start(self) -> None:
        run, wall = self.run, self.run.wall
        run.told |= {"wall_s": wall, "cpu_s": run.cpu}
        snapshots = run.told["snapshots"]
        if self.snapshot_s and run.cpu >= self.snapshot_s * len(snapshots):
            name = f"{len(snapshots):04d}"
            policy_file.save(run.policy(), run.folder / "snapshots" / name)
            snapshots.append({"name": name, "wall_s": wall, "cpu_s": run.cpu, "steps": run.agent.num_timesteps})
        if wall - self.saved >= CHECKPOINT_S:
            self.saved = wall
            run.keep()

    def _on_step(self) -> bool:
        means = self.run.env.parts.mean(axis=0)
        self.sums = [a + b for a, b in zip(self.sums, means.tolist(), strict=True)]
        self.count += 1
        return True

    def _on_rollout_end(self) -> None:
        steps = self.run.agent.num_timesteps
        if self.count < 100 and steps < self.run.config.learning.steps:
            return
        parts = {name: value / self.count for name, value in zip(PARTS, self.sums, strict=True)}
        for name, value in parts.items():
            self.logger.record(f"reward/{name}", value)
        self.run.told["log"].append({"wall_s": self.run.wall, "steps": steps, **parts})
        self.advance(steps - self.shown, note=f"{-parts['tracking']:.3f} JND, {steps / self.run.wall:,.0f} steps/s")
        self.shown, self.sums, self.count = steps, [0.0] * len(PARTS), 0
