"""A policy in two files: policy.safetensors (weights) and policy.json (what they mean, where they come from).

Neither can hold code: safetensors is a table of numbers. Every way in which a file can be wrong ends
in one InputError. ``steer-env train`` writes them; what is shipped lies in controllers/policies, one folder
for each plant and causality.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors import numpy as safetensors

from controllers.own import inner_of
from controllers.tuning import loop_name
from steer_env import atomic
from steer_env.errors import InputError

SCHEMA_VERSION = 1
SHIPPED = Path(__file__).with_name("policies")
WEIGHTS, DESCRIPTION = "policy.safetensors", "policy.json"
PREFIX = "policy"
N_SIGNALS = 17  # fields of policy_law.Signals
NAMES = ("first", "second", "last")
MEND = "write one by steer-env train"

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Policy:
    """One trained policy; ``policy_law.PolicyParameters`` says what the numbers mean.

    base: name of the classical law that is corrected (with ``base_gains``, its factors); None where the policy
        gives the whole torque.
    authority: N m at the motor that an action of 1 stands for.
    shares: (speed in m/s, share of the authority) ascending, what was left after training so that loops are stable.
    sample_time: s from one step of the network to the next.
    bandwidth_Hz: of the lag that smooths the held action; 0: none.
    scales: what divides each signal, SI; None hides the signal.
    slope_limit: slope of the assist beyond which the action is taken back (admittance).
    history: how many of its own last actions the network sees.
    training: where it comes from (seed, task, steps, versions ...), as plain values.
    weights: float64 "first" [34, n], "second" [n, m], "last" [m].
    """

    plant: str
    causality: str
    base: str | None
    base_gains: dict[str, float]
    authority: float
    shares: tuple[tuple[float, float], ...]
    sample_time: float
    bandwidth_Hz: float
    squashed: bool
    scales: tuple[float | None, ...]
    keep: float
    mean_speed: float
    speed_scale: float
    slope_limit: float
    history: int
    training: dict[str, Any]
    weights: Mapping[str, Array] = field(repr=False)
    source: str = "policy"


def save(policy: Policy, folder: Path) -> None:
    """Write both files, each whole or not at all; the description, which names the weights by hash, last."""
    weights = safetensors.save({name: np.ascontiguousarray(policy.weights[name]) for name in NAMES})
    content = {k: v for k, v in asdict(policy).items() if k not in ("weights", "source")}
    described = {
        "schema_version": SCHEMA_VERSION,
        "network": {"hidden": list(policy.weights["second"].shape), "activation": "tanh", "offsets": False},
        "weights_sha256": hashlib.sha256(weights).hexdigest(),
        **content,
    }
    atomic.write_bytes(folder / WEIGHTS, weights)
    atomic.write_text(folder / DESCRIPTION, json.dumps(described, indent=1, allow_nan=False) + "\n")


def load(folder: Path) -> Policy:
    """The policy in a folder; InputError says which file is wrong and how."""
    paths = folder / DESCRIPTION, folder / WEIGHTS
    for path in paths:
        if not path.is_file():
            raise InputError(str(path), "there is no such file", MEND)
    return _load(folder.resolve(), *(path.stat().st_mtime_ns for path in paths))


def folders() -> dict[str, Path]:
    """What is shipped: plant-causality -> folder."""
    return {path.parent.name: path.parent for path in sorted(SHIPPED.glob(f"*/{DESCRIPTION}"))}


def shipped(plant: str, causality: str) -> Policy:
    """The shipped policy for a plant and causality."""
    there = folders()
    name = loop_name(plant, causality)
    if name not in there:
        known = ", ".join(there) or "none"
        raise InputError("policy", f"none is shipped for {name} (there: {known})", "train one: steer-env train")
    return load(there[name])


def is_policy(name: str) -> bool:
    """Whether a controller's name is "policy" (the shipped one) or policy:FOLDER."""
    return name == PREFIX or name.startswith(f"{PREFIX}:")


def folder_of(name: str) -> Path | None:
    """The folder of policy:FOLDER, also inside of a wrapper's name; None for any other name."""
    _, found, folder = name.partition(f"{PREFIX}:")
    return Path(folder).expanduser().resolve() if found else None


def systems_of(name: str) -> tuple[tuple[str, str], ...] | None:
    """(Plant, causality) that a policy is made for, also in a wrapper; None for a controller that is no policy."""
    inner = inner_of(name)
    if inner:
        return systems_of(inner)
    if not is_policy(name):
        return None
    folder = folder_of(name)
    there = [load(folder)] if folder is not None else [load(path) for path in folders().values()]
    return tuple((policy.plant, policy.causality) for policy in there)


def named(name: str, plant: str, causality: str) -> Policy:
    """The policy of a controller's name, on one of its ``systems_of``."""
    folder = folder_of(name)
    return shipped(plant, causality) if folder is None else load(folder)


@cache
def _load(folder: Path, *changed: int) -> Policy:
    path, where = folder / DESCRIPTION, str(folder / WEIGHTS)
    try:
        described = json.loads(path.read_text("utf-8"))
        known = described.pop("schema_version") == SCHEMA_VERSION
        digest = described.pop("weights_sha256")
        del described["network"]
        described["scales"] = tuple(described["scales"])
        described["shares"] = tuple((float(speed), float(share)) for speed, share in described["shares"])
        policy = Policy(**described, weights={}, source=str(path))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as wrong:
        raise InputError(str(path), f"this describes no policy ({wrong})", MEND) from wrong
    if not known:
        raise InputError(str(path), "its schema_version is not known", MEND)
    content = (folder / WEIGHTS).read_bytes()
    try:
        weights = {name: np.asarray(value, np.float64) for name, value in safetensors.load(content).items()}
    except (SafetensorError, ValueError, TypeError, KeyError) as wrong:
        raise InputError(where, f"these are no weights in safetensors format ({wrong})", MEND) from wrong
    if hashlib.sha256(content).hexdigest() != digest:
        raise InputError(where, f"these are not the weights that {DESCRIPTION} describes", "copy both files together")
    _check(policy, weights, path)
    return Policy(**{**{k: getattr(policy, k) for k in policy.__dataclass_fields__}, "weights": weights})


def _check(policy: Policy, weights: Mapping[str, Array], path: Path) -> None:
    """Shapes and numbers that the law counts on."""
    shapes = {name: weights[name].shape for name in NAMES if name in weights}
    n, m = shapes.get("second", (0, 0)) if len(shapes.get("second", ())) == 2 else (0, 0)
    if set(weights) != set(NAMES) or shapes["first"] != (2 * N_SIGNALS, n) or shapes["last"] != (m,) or not n * m:
        raise InputError(str(path), f"weights of shapes {shapes} do not fit {N_SIGNALS} signals", MEND)
    numbers = [policy.authority, policy.sample_time, policy.bandwidth_Hz, policy.keep, policy.mean_speed]
    numbers += [policy.speed_scale, policy.slope_limit]
    numbers += [1.0 if scale is None else scale for scale in policy.scales]
    numbers += [number for pair in policy.shares for number in pair]
    try:
        sound = all(math.isfinite(value) for value in numbers) and policy.sample_time > 0.0
        sound = sound and len(policy.shares) > 0 and list(policy.shares) == sorted(policy.shares)
        sound = sound and len(policy.scales) == N_SIGNALS and all(s is None or s > 0.0 for s in policy.scales)
    except TypeError as wrong:
        raise InputError(str(path), f"a number is missing ({wrong})", MEND) from wrong
    if not sound or not all(np.isfinite(value).all() for value in weights.values()):
        raise InputError(str(path), "a number is not finite or out of range", MEND)
