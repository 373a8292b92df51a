"""A warm start: the actor is fitted to a classical law's torque before it learns by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import torch

from controllers.policy_law import Signals
from experiments.learning.agent import actors_of
from experiments.learning.arrangement import Arrangement
from experiments.learning.config import FULL_TORQUE, RewardWeights, TrainConfig
from experiments.learning.vec_env import PolicyVecEnv
from steer_env.errors import InputError

SECONDS, FITS, BATCH, RATE = 20.0, 4000, 1024, 2e-3


def imitate(agent: Any, config: TrainConfig, arrangement: Arrangement) -> dict[str, Any]:
    """Fit by least squares what the teacher commands in the training domain; says how well that went."""
    teacher = config.learning.imitate
    if config.action.base != FULL_TORQUE:
        what = f"the policy corrects {config.action.base} already"
        raise InputError("learning.imitate", what, f"set action.base={FULL_TORQUE}, or leave this away")
    inputs, targets = _driven(config, arrangement, teacher)
    layers = actors_of(agent)[0]
    weights = [layer.weight for layer in layers]
    optimiser = torch.optim.Adam(weights, lr=RATE)
    rng = np.random.default_rng((config.seed, 2))
    for k in range(FITS):
        chosen = torch.from_numpy(rng.integers(0, len(inputs), BATCH))
        for group in optimiser.param_groups:
            group["lr"] = RATE * (1.0 - k / FITS)
        loss = torch.mean((_output(layers, inputs[chosen]) - targets[chosen]) ** 2)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    with torch.no_grad():
        left = float(torch.mean((_output(layers, inputs) - targets) ** 2) / torch.mean(targets**2))
    return {"teacher": teacher, "seconds": SECONDS, "fits": FITS, "relative_error": left**0.5}


def _output(layers: list[torch.nn.Linear], inputs: torch.Tensor) -> torch.Tensor:
    hidden = torch.tanh(layers[1](torch.tanh(layers[0](inputs))))
    output: torch.Tensor = layers[2](hidden)[:, 0]
    return output


def _driven(config: TrainConfig, arrangement: Arrangement, teacher: str) -> tuple[torch.Tensor, torch.Tensor]:
    """(Inputs [k, 35], actions [k]) of the teacher at work, its last torques in the place of past actions."""
    driven = replace(config, action=replace(config.action, base=teacher))
    env = PolicyVecEnv(Arrangement(driven, arrangement.measured), 64, RewardWeights(), config.seed)
    env.reset()
    still, authority = np.zeros((64, 1), np.float32), arrangement.measured.authority
    command, first = Signals._fields.index("command"), Signals._fields.index("action_1")
    past = np.zeros((64, 4))
    inputs, targets = [], []
    for _ in range(round(SECONDS / (1e-3 * config.action.decimation))):
        action = np.clip(env.signals[:, command] / authority, -1.0, 1.0)
        env.signals[:, first : first + 4] = past
        inputs.append(env.observed())
        targets.append(action)
        past = np.column_stack([action, past[:, :3]])
        _, _, dones, _ = env.step(still)
        past[dones] = 0.0
    told = np.concatenate(inputs)
    if config.action.base == FULL_TORQUE:  # the student does not see the teacher's command
        n = len(Signals._fields)
        told[:, [command, n + command]] = 0.0
    return torch.from_numpy(told), torch.from_numpy(np.concatenate(targets).astype(np.float32))
