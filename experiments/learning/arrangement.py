"""Policy and base law put together for training: scales of the signals, authority, compiled step.

Scales and authority are measured once, before anything is learned, with the base law (pid under a policy
that gives the whole torque) in the training domain: a scale that moved while one learns would change what
was learned.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import controllers
from controllers import policy_law, tuning
from controllers.hardware import bar_notch
from controllers.law import Factor
from controllers.policy_law import Signals
from controllers.schedule import schedule_of
from experiments.learning.config import FULL_TORQUE, TrainConfig
from experiments.learning.domain import Drawer
from experiments.learning.kernel import Acting, make_step
from steer_env.envs.layout import PERIOD
from steer_env.errors import InputError
from steer_env.interface import Law, Observation
from steer_env.plants import PLANTS, Reference

Array = NDArray[np.float64]

MEAN_SPEED, SPEED_SCALE = 17.0, 8.0  # m/s; the published reference goes from 4 to 29
SUM_MEMORY = 0.3  # s that error_sum keeps
TEACHER = "pid"  # whose torque sets scales and authority where there is no base law
PAST = ("action_1", "action_2", "action_3", "action_4")


class BaseLaw(NamedTuple):
    """The base law of one reference: function, start state, parameters."""

    law: Law
    state: Any
    parameters: Any


class Scales(NamedTuple):
    """What was measured: scale of each signal (SI; None hides it) and authority in N m at the motor."""

    scales: tuple[float | None, ...]
    authority: float


class Arrangement:
    """What stays the same over a training run; ``gains`` [17] are one over the scales, 0 for a hidden signal."""

    mean_speed, speed_scale = MEAN_SPEED, SPEED_SCALE
    speed_column = Observation._fields.index("speed")

    def __init__(self, config: TrainConfig, measured: Scales) -> None:
        self.config, self.measured = config, measured
        self.decimation = config.action.decimation
        references = [Reference.load(name) for name in config.domain.references]
        self.drawers = [Drawer(config.plant, config.causality, one, config.domain) for one in references]
        self.laws = [base_law(config, one) for one in references]
        self.gains = np.array([0.0 if scale is None else 1.0 / scale for scale in measured.scales])
        self.keep = 1.0 - self.decimation * PERIOD / SUM_MEMORY
        self._compiled = make_step(self.laws[0].law, self.laws[0].state)

    def compiled(self, k: int) -> tuple[Callable[..., int], Callable[..., None], Acting]:
        """(Step, start, what they need to know of the policy) of the k-th reference."""
        admittance = 1.0 if self.config.causality == "admittance" else 0.0
        plant, lag = PLANTS[self.config.plant], policy_law.lag_of(self.config.action.bandwidth_Hz, PERIOD)
        rated, notch = plant.motor.rated_torque, bar_notch(plant, PERIOD)
        schedule, limit = schedule_of(self.drawers[k].reference), self.config.action.slope_limit
        acting = Acting(
            self.laws[k].parameters, self.measured.authority, admittance, self.keep, rated, schedule, limit, lag, notch
        )
        return (*self._compiled, acting)


def base_gains(config: TrainConfig) -> dict[str, float]:
    """The shipped factors on the base law's gains, which go into the policy's file."""
    if config.action.base == FULL_TORQUE:
        return {}
    shipped = tuning.gains_for(config.action.base, config.plant, config.causality)
    return {name: gain.share for name, gain in shipped.items() if isinstance(gain, Factor)}


def base_law(config: TrainConfig, reference: Reference) -> BaseLaw:
    """The law under the policy; InputError where it is not a pure one."""
    if config.action.base == FULL_TORQUE:
        return BaseLaw(policy_law.silent_law, 0.0, 0.0)
    made = controllers.make(config.action.base, PLANTS[config.plant], reference, config.causality)
    if not hasattr(made, "law"):
        raise InputError("action.base", f"{config.action.base} has no pure law", "take one out of the table")
    made.reset(PERIOD)
    return BaseLaw(made.law, made.state(), made.parameters)


def visible(config: TrainConfig, rms: Array) -> tuple[float | None, ...]:
    """Scales out of the signals' rms [17]: None for what never moves and for a past that is not to be seen."""
    hidden = set(PAST[config.action.history :])
    if config.action.base == FULL_TORQUE:
        hidden.add("command")
    scales: list[float | None] = []
    for name, value in zip(Signals._fields, rms.tolist(), strict=True):
        size = 0.5 if name.startswith("action_") else value
        scales.append(None if name in hidden or size <= 1e-12 else float(f"{size:.4g}"))
    return tuple(scales)
