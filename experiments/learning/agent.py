"""stable-baselines3 agents whose actor has no offsets: a left turn is a right turn, whatever is learned."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.noise import NormalActionNoise

from experiments.learning.config import TrainConfig
from experiments.learning.vec_env import N_SIGNALS, PolicyVecEnv

CRITIC = [64, 64]
FINAL_RATE = 0.1  # of the learning rate, at the end
NEAR_ZERO = 0.01  # of the usual size of the last layer: a correction begins at next to nothing
TD3_NOISE = 0.15


def make_agent(config: TrainConfig, env: PolicyVecEnv, log: str | None = None) -> Any:
    """The agent of a configuration, on one thread of the CPU."""
    torch.set_num_threads(1)
    learning = config.learning

    def rate(remaining: float) -> float:
        return learning.learning_rate * (FINAL_RATE + (1.0 - FINAL_RATE) * remaining)

    shared: dict[str, Any] = {
        "policy": "MlpPolicy",
        "env": env,
        "learning_rate": rate,
        "gamma": learning.gamma,
        "batch_size": learning.batch,
        "tensorboard_log": log,
        "seed": config.seed,
        "device": "cpu",
    }
    layers = list(learning.hidden)
    if learning.algorithm == "ppo":
        agent: Any = PPO(
            **shared,
            n_steps=learning.rollout,
            n_epochs=learning.epochs,
            gae_lambda=learning.gae_lambda,
            target_kl=learning.target_kl,
            policy_kwargs={
                "net_arch": {"pi": layers, "vf": CRITIC},
                "activation_fn": torch.nn.Tanh,
                "log_std_init": learning.log_std,
            },
        )
    else:
        shared |= {
            "buffer_size": learning.buffer,
            "learning_starts": learning.warm_up,
            "train_freq": 1,
            "gradient_steps": learning.gradient_steps,
            "policy_kwargs": {"net_arch": {"pi": layers, "qf": CRITIC}, "activation_fn": torch.nn.Tanh},
        }
        if learning.algorithm == "sac":
            agent = SAC(**shared, ent_coef="auto_0.01", target_entropy=-3.0)
        else:
            agent = TD3(**shared, action_noise=NormalActionNoise(np.zeros(1), np.full(1, TD3_NOISE)))
    for actor in actors_of(agent):
        without_offsets(actor)
        if learning.algorithm != "ppo":  # PPO begins near zero by itself
            with torch.no_grad():
                actor[-1].weight.mul_(NEAR_ZERO)
    return agent


def actors_of(agent: Any) -> list[list[Any]]:
    """The linear layers from the observation to the action, of the actor and of its target if there is one."""
    if isinstance(agent, PPO):
        return [[*_linear(agent.policy.mlp_extractor.policy_net), agent.policy.action_net]]
    if isinstance(agent, SAC):
        return [[*_linear(agent.actor.latent_pi), agent.actor.mu]]
    return [_linear(agent.actor.mu), _linear(agent.actor_target.mu)]


def without_offsets(layers: list[Any]) -> None:
    """Hold every offset, and the weights of the speed itself (the last input), at zero for good."""
    for layer in layers:
        layer.bias.requires_grad_(False)
        layer.bias.zero_()
    first = layers[0].weight
    shown = torch.ones_like(first)
    shown[:, -1] = 0.0
    with torch.no_grad():
        first.mul_(shown)
    first.register_hook(lambda gradient: gradient * shown)


def weights_of(agent: Any) -> dict[str, NDArray[np.float64]]:
    """The actor's weights as controllers.policy takes them."""
    first, second, last = (layer.weight.detach().numpy().astype(np.float64).T for layer in actors_of(agent)[0])
    return {"first": first[: 2 * N_SIGNALS].copy(), "second": second.copy(), "last": last[:, 0].copy()}


def _linear(layers: torch.nn.Module) -> list[Any]:
    return [layer for layer in layers.children() if isinstance(layer, torch.nn.Linear)]
