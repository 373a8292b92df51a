"""Measures, before training, what signals and torques are worth in the training domain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from controllers.policy_law import Signals
from experiments.learning.arrangement import TEACHER, Arrangement, Scales, visible
from experiments.learning.config import FULL_TORQUE, RewardWeights, TrainConfig
from experiments.learning.vec_env import N_SIGNALS, PolicyVecEnv
from steer_env.plants import PLANTS

ENVIRONMENTS, SECONDS = 64, 20.0


def measured(config: TrainConfig) -> Scales:
    """Root mean squares of the signals over SECONDS of driving with the base law alone.

    The median over ENVIRONMENTS: one arm that the base law shakes must not set the scale for all.
    """
    base = TEACHER if config.action.base == FULL_TORQUE else config.action.base
    driven = replace(config, action=replace(config.action, base=base))
    silent = Arrangement(driven, Scales((1.0,) * N_SIGNALS, 0.0))
    env = PolicyVecEnv(silent, ENVIRONMENTS, RewardWeights(), config.seed)
    env.reset()
    still = np.zeros((ENVIRONMENTS, 1), np.float32)
    squares, steps = np.zeros((ENVIRONMENTS, N_SIGNALS)), round(SECONDS / (1e-3 * config.action.decimation))
    for _ in range(steps):
        env.step(still)
        squares += env.signals * env.signals
    rms = np.median(np.sqrt(squares / steps), axis=0)
    torque = rms[Signals._fields.index("command")] * config.action.authority
    authority = min(float(f"{torque:.4g}"), PLANTS[config.plant].motor.rated_torque)
    return Scales(visible(config, rms), authority)
