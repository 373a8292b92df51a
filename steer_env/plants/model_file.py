"""A car's model with the effects that were found in it: ``model.json`` (docs/formats.md, section 6).

The reference is what steering should feel like without them; the effects are what the car has besides. Environments
made with ``model=`` put the effects into the plant and leave the reference as it is.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from steer_env import atomic
from steer_env.errors import InputError
from steer_env.physics.effects import EFFECTS
from steer_env.plants import checked
from steer_env.plants.reference import Reference
from steer_env.plants.reference_file import LIMIT_BYTES, ReferenceFile, reference_from, reference_table
from steer_env.units import quantities

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class ExtendedModel:
    """Reference of a car and the effects in it: name -> parameter -> value."""

    reference: ReferenceFile
    effects: Mapping[str, Mapping[str, float]]
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def load(cls, source: str | Path | ExtendedModel) -> ExtendedModel:
        """From a path or a model; a file is read and digested once, until it changes."""
        if isinstance(source, ExtendedModel):
            return source
        path = Path(source)
        return _loaded(str(source), path.stat().st_mtime_ns if path.is_file() else 0)

    @cached_property
    def feel(self) -> Reference:
        """The haptic reference; made once, so that an environment's reset need not."""
        return Reference(self.reference, source="model")


def write_model(path: str | Path, model: ExtendedModel) -> None:
    """Write a model whole or not at all."""
    table = {
        "schema_version": SCHEMA_VERSION,
        "kind": "vehicle",
        "reference": reference_table(model.reference),
        "effects": [{"name": name, "parameters": dict(values)} for name, values in model.effects.items()],
        "provenance": dict(model.provenance),
    }
    atomic.write_text(path, json.dumps(table, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def read_model(path: str | Path) -> ExtendedModel:
    """Read and check a model file; a fault is an ``InputError`` that names the key."""
    path = Path(path)
    where = str(path)
    table = checked.read_json(path, LIMIT_BYTES)
    checked.check_keys(table, ("schema_version", "kind", "reference", "effects", "provenance"), (), where)
    checked.schema_version(table, where, SCHEMA_VERSION)
    checked.text(table, "kind", where, ("vehicle",))
    reference = reference_from(table["reference"], f"{where}: reference")
    if not isinstance(table["effects"], list):
        raise InputError(f"{where}: key 'effects'", "a list is expected", "write [] for a model without effects")
    effects = {}
    for index, entry in enumerate(table["effects"]):
        place = f"{where}: effects[{index}]"
        name, values = _read_effect(entry, place)
        if name in effects:
            raise InputError(f"{place}: key 'name'", f"'{name}' stands twice", "remove one of them")
        effects[name] = values
    if not isinstance(table["provenance"], dict):
        raise InputError(f"{where}: key 'provenance'", "a table is expected", "write {} when nothing is known")
    return ExtendedModel(reference, effects, table["provenance"])


@lru_cache(maxsize=32)
def _loaded(source: str, changed: int) -> ExtendedModel:
    return read_model(source)


def _read_effect(entry: object, where: str) -> tuple[str, dict[str, float]]:
    found = checked.check_keys(entry, ("name", "parameters"), (), where)
    name = checked.text(found, "name", where, tuple(EFFECTS["vehicle"]))
    ranges = quantities(EFFECTS["vehicle"][name].parameters)
    values = checked.check_keys(found["parameters"], tuple(ranges), (), f"{where}: parameters")
    return name, {
        key: checked.number(values, key, f"{where}: parameters", quantity.low, quantity.high)
        for key, quantity in ranges.items()
    }
