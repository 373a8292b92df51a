"""The shipped gains: data files in controllers/tuned, made by ``steer-env tune``, read by controllers.make.

A file holds, for each plant and causality, factors on what the law's design formula gives, so that
the tuning carries over to a plant with other numbers or another control period, and where they come
from: objective, protocol, training seeds, trials, software version, scores before and after.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from controllers.law import Factor, Gain
from steer_env.errors import InputError

FOLDER = Path(__file__).with_name("tuned")
SCHEMA_VERSION = 1


def loop_name(plant: str, causality: str) -> str:
    """The key of a plant with a causality in a file of gains."""
    return f"{plant}-{causality}"


def path_of(name: str) -> Path:
    """Where the shipped gains of a controller lie."""
    return FOLDER / f"{name}.json"


def gains_for(name: str, plant: str, causality: str) -> dict[str, Gain]:
    """The shipped factors of a controller; empty where it has not been tuned for that plant."""
    path = path_of(name)
    return gains_in(path, plant, causality) if path.exists() else {}


def gains_in(path: Path, plant: str, causality: str) -> dict[str, Gain]:
    """The factors in a file; raises InputError where the file is not one of gains."""
    loop = _read(path, path.stat().st_mtime_ns).get(loop_name(plant, causality), {})
    return {gain: Factor(float(share)) for gain, share in loop.get("factors", {}).items()}


@cache
def _read(path: Path, changed: int) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text("utf-8"))
        known, loops = content["schema_version"] == SCHEMA_VERSION, content["loops"]
    except (OSError, ValueError, KeyError, TypeError) as wrong:
        raise InputError(str(path), f"this is no file of gains ({wrong})", "make one by steer-env tune") from wrong
    if not known or not isinstance(loops, dict):
        raise InputError(str(path), "its schema_version is not known", "make one by steer-env tune")
    return loops
