"""What a training run is asked for: small dataclasses, every one with the fast defaults."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, NamedTuple

from steer_env.errors import InputError

ALGORITHMS = ("ppo", "sac", "td3")
FULL_TORQUE = "none"
SCORED = ("frequency_response", "steady_state", "on_centre_weave", "step_steer", "release", "random_torque")


@dataclass(frozen=True)
class Domain:
    """What is drawn for every episode.

    ``randomise`` draws plant, car and arm from the benchmark's training seeds; without it they are the
    nominal plant, the reference's own car and the relaxed arm. Speed (over the reference's range, within
    ``speeds_kmh``), manoeuvre, its size and phase are drawn in any case. ``free_share`` of the episodes are
    driven by a torque on the free wheel, where a loop has no arm to calm it. ``extra_dead_time``: up to so
    many periods more than the drawn plant's. ``references``: "published" or files, shared out evenly over
    the environments.
    """

    manoeuvres: tuple[str, ...] = SCORED
    speeds_kmh: tuple[float, float] = (0.0, 400.0)
    randomise: bool = True
    free_share: float = 0.15
    extra_dead_time: int = 0
    references: tuple[str, ...] = ("published",)


@dataclass(frozen=True)
class Action:
    """What the policy's output does.

    base: the classical law that it corrects, or "none": it gives the whole torque. authority: what an
    action of 1 is worth, in rms of the base's torque over the training domain (of pid's where there is none).
    decimation: control periods for each step of the policy. bandwidth_Hz: of the lag behind it. slope_limit: slope of
    the assist beyond which an admittance policy yields. history: how many of its own last actions it sees.
    """

    base: str = "pid"
    authority: float = 0.3
    decimation: int = 5
    bandwidth_Hz: float = 12.0
    slope_limit: float = 4.0
    history: int = 0


class RewardWeights(NamedTuple):
    """Weights of the reward's named parts; each part is a mean over the control periods of a step.

    ``tracking``: minus the true error in JND of the episode's reference level so far. ``smoothness``: minus
    the squared change of the action (once for each step). ``passivity``: minus the energy given to the hand
    beyond what the reference gives, over the 0.01 J that controllers.passivity lets go. ``effort``: minus
    the squared share of the motor's torque.
    """

    tracking: float = 1.0
    smoothness: float = 0.3
    passivity: float = 0.05
    effort: float = 0.01


@dataclass(frozen=True)
class Learning:
    """The algorithm and its numbers.

    ``rollout`` to ``target_kl`` are PPO's, ``buffer`` to ``warm_up`` SAC's and TD3's. ``imitate`` names a
    classical law whose torque the policy is fitted to before it learns by itself.
    """

    algorithm: str = "ppo"
    environments: int = 64
    steps: int = 800_000
    hidden: tuple[int, int] = (32, 32)
    learning_rate: float = 1e-3
    batch: int = 1024
    gamma: float = 0.95
    rollout: int = 128
    epochs: int = 5
    gae_lambda: float = 0.9
    log_std: float = -1.5
    target_kl: float | None = 0.05
    buffer: int = 300_000
    gradient_steps: int = 2
    warm_up: int = 6_400
    imitate: str = ""


@dataclass(frozen=True)
class TrainConfig:
    """One training run."""

    plant: str = "SbW"
    causality: str = "impedance"
    seed: int = 0
    domain: Domain = field(default_factory=Domain)
    action: Action = field(default_factory=Action)
    reward: RewardWeights = field(default_factory=RewardWeights)
    learning: Learning = field(default_factory=Learning)

    def plain(self) -> dict[str, Any]:
        """The configuration as JSON values."""
        content = asdict(self)
        content["reward"] = self.reward._asdict()
        plain: dict[str, Any] = json.loads(json.dumps(content))
        return plain

    def changed(self, settings: dict[str, str]) -> TrainConfig:
        """With settings such as {"learning.gamma": "0.98", "action.base": "lqg"} replaced."""
        changed: Any = self
        for name, text in settings.items():
            if name not in _names():
                raise InputError(name, "there is no such setting", f"use one of {', '.join(_names())}")
            part, _, item = name.partition(".")
            old = getattr(changed, part)
            value = {item: _value(name, text, getattr(old, item))}
            new = old._replace(**value) if isinstance(old, RewardWeights) else replace(old, **value)
            changed = replace(changed, **{part: new})
        if changed.learning.algorithm not in ALGORITHMS:
            what = f"{changed.learning.algorithm!r} is not known"
            raise InputError("learning.algorithm", what, f"use one of {', '.join(ALGORITHMS)}")
        found: TrainConfig = changed
        return found


def _names() -> list[str]:
    parts: dict[str, Any] = {"domain": Domain, "action": Action, "learning": Learning}
    found = [f"{part}.{f.name}" for part, kind in parts.items() for f in fields(kind)]
    return [*found, *(f"reward.{name}" for name in RewardWeights._fields)]


def _value(name: str, text: str, old: Any) -> Any:
    """The text as what the old value is."""
    try:
        if isinstance(old, bool):
            return {"true": True, "false": False, "1": True, "0": False}[text.lower()]
        if isinstance(old, tuple):
            kind = type(old[0])
            return tuple(kind(item) for item in text.split(","))
        if isinstance(old, str):
            return text
        return None if text == "none" and name == "learning.target_kl" else type(old)(float(text))
    except (ValueError, KeyError) as wrong:
        raise InputError(name, f"{text!r} is not like {old!r}", "give a value of the same kind") from wrong
