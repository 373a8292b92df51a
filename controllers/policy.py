"""A learned policy as a controller: the law of controllers.policy_law with the numbers of controllers.policy_file.

Weights and their description lie in two files; what is shipped lies in controllers/policies.
``controllers.make("policy:FOLDER", ...)`` takes what ``steer-env train --out FOLDER`` wrote.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import controllers
from controllers import policy_file
from controllers.hardware import bar_notch
from controllers.law import Factor, Gain, LawController, with_gains
from controllers.policy_file import Policy
from controllers.policy_law import PolicyParameters, PolicyState, corrected, lag_of, silent_law
from controllers.schedule import schedule_of
from steer_env.errors import InputError
from steer_env.interface import Law
from steer_env.plants import PLANTS, Plant, Reference


class PolicyController(LawController):
    """A LawController whose law repeats itself only every ``decimation`` periods."""

    def __init__(self, law: Law, design: Callable[[float], Any], start: Any, policy: Policy) -> None:
        self.policy = policy
        super().__init__(law, design, start)

    @property
    def decimation(self) -> int:
        """Control periods from one step of the network to the next."""
        return round(self.parameters.decimation)


def base_of(policy: Policy, plant: Plant, reference: Reference) -> LawController | None:
    """The classical law under a policy, with the gains that it was trained over; None where there is none."""
    if policy.base is None:
        return None
    gains: dict[str, Gain] = {name: Factor(share) for name, share in policy.base_gains.items()}
    made = controllers.make(policy.base, plant, reference, policy.causality, tuned=False, **gains)
    assert isinstance(made, LawController), policy.base
    return made


def make(
    plant: Plant, reference: Reference, causality: str, folder: str | Path | None = None, **gains: Gain
) -> PolicyController:
    """The policy in a folder, or the one that is shipped for this plant and causality."""
    policy = policy_file.shipped(plant.name, causality) if folder is None else policy_file.load(Path(folder))
    if policy.causality != causality:
        raise InputError(policy.source, f"it was trained for {policy.causality}", f"use it there, not for {causality}")
    if plant.name in PLANTS and plant.name != policy.plant:  # a plant of a user's own is a variant of one of them
        raise InputError(policy.source, f"it was trained for {policy.plant}", f"use it there, not for {plant.name}")
    return of(policy, plant, reference, **gains)


def of(policy: Policy, plant: Plant, reference: Reference, **gains: Gain) -> PolicyController:
    """The controller that a policy makes for a plant; ``gains`` replace fields of PolicyParameters."""
    base = base_of(policy, plant, reference)

    def for_period(period: float) -> PolicyParameters:
        decimation = round(policy.sample_time / period)
        if decimation < 1 or abs(decimation * period - policy.sample_time) > 1e-6 * policy.sample_time:
            what = f"its step of {1e3 * policy.sample_time:g} ms is no multiple of {1e3 * period:g} ms"
            raise InputError(policy.source, what, "choose another control period")
        if base is not None:
            base.reset(period)
        parameters = PolicyParameters(
            base=0.0 if base is None else base.parameters,
            gains=np.array([0.0 if scale is None else 1.0 / scale for scale in policy.scales]),
            first=policy.weights["first"],
            second=policy.weights["second"],
            last=policy.weights["last"],
            authority=policy.authority,
            decimation=float(decimation),
            admittance=1.0 if policy.causality == "admittance" else 0.0,
            squashed=1.0 if policy.squashed else 0.0,
            keep=policy.keep,
            mean_speed=policy.mean_speed,
            speed_scale=policy.speed_scale,
            shares=np.array(policy.shares),
            schedule=schedule_of(reference),
            slope_limit=policy.slope_limit,
            lag=lag_of(policy.bandwidth_Hz, period),
            notch=bar_notch(plant, period),
        )
        return with_gains(parameters, gains, "policy")

    law = corrected(silent_law if base is None else base.law)
    start = PolicyState(0.0 if base is None else base.state())
    return PolicyController(law, for_period, start, policy)
