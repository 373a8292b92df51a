"""The identified reference as a file, ``reference.json`` (docs/formats.md, section 2).

Inside the program the fields have the paper's names (J_ref); in the file the unit is appended
(J_ref_kgm2), and standard errors and the values of the paper's own method stand beside a value as
<key>_std and <key>_frf.

``slip`` says which form of Eq. 10, row 2, the damping b_ref belongs to: "kinematic" as the paper
prints it, or "relaxed" as Eq. 9 implies. The two are never mixed, so the file must say which.
"""

import json
import math
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from steer_env import atomic
from steer_env.errors import InputError
from steer_env.plants import checked
from steer_env.plants.reference_row import KnownVehicle, ReferenceRow, file_keys
from steer_env.units import quantities

SCHEMA_VERSION = 1
SLIP_FORMS = ("kinematic", "relaxed")
LIMIT_BYTES = 10_000_000  # a file of 1000 speeds has 1 MB; more is not a reference

ROW_KEYS = file_keys(ReferenceRow)
VEHICLE_KEYS = file_keys(KnownVehicle)
_FIELD_OF = {key: name for name, key in ROW_KEYS.items()}


@dataclass(frozen=True)
class ReferenceFile:
    """A reference over speed; ``std``, ``frf``, ``extrapolated``: one entry per row."""

    vehicle: KnownVehicle
    rows: tuple[ReferenceRow, ...]
    slip: str
    std: tuple[dict[str, float], ...]
    frf: tuple[dict[str, float], ...]
    extrapolated: tuple[tuple[str, ...], ...]
    provenance: dict[str, Any] = field(default_factory=dict)


def published() -> ReferenceFile:
    """Return the paper's Tables 2 and 3 with vehicle set R, as the package ships them."""
    with resources.as_file(resources.files("steer_env.plants") / "data" / "chugh_2019.json") as path:
        return read_reference(path)


def read_reference(path: str | Path) -> ReferenceFile:
    """Read and check a reference file; a fault is an ``InputError`` that names row and key."""
    path = Path(path)
    return reference_from(checked.read_json(path, LIMIT_BYTES), str(path))


def reference_from(content: object, where: str) -> ReferenceFile:
    """Check what a reference file holds; ``where`` names its place in messages."""
    table = checked.check_keys(content, ("schema_version", "slip", "vehicle", "rows", "provenance"), (), where)
    checked.schema_version(table, where, SCHEMA_VERSION)
    slip = checked.text(table, "slip", where, SLIP_FORMS)
    vehicle = read_vehicle(table["vehicle"], f"{where}: vehicle")
    if not isinstance(table["provenance"], dict):
        raise InputError(f"{where}: key 'provenance'", "a table is expected", "write {} when nothing is known")
    rows = _read_rows(table["rows"], where)
    values, std, frf, extrapolated = zip(*rows, strict=True)
    return ReferenceFile(vehicle, values, slip, std, frf, extrapolated, table["provenance"])


def write_reference(path: str | Path, reference: ReferenceFile) -> None:
    """Write a reference whole or not at all; equal references give equal bytes."""
    table = reference_table(reference)
    atomic.write_text(path, json.dumps(table, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def reference_table(reference: ReferenceFile) -> dict[str, Any]:
    """The content of a reference file."""
    return {
        "schema_version": SCHEMA_VERSION,
        "slip": reference.slip,
        "vehicle": vehicle_table(reference.vehicle),
        "rows": [_row_table(reference, index) for index in _by_speed(reference)],
        "provenance": reference.provenance,
    }


def read_vehicle(table: object, where: str) -> KnownVehicle:
    """Read the known numbers of a vehicle (also the [vehicle] table of a campaign)."""
    return KnownVehicle(**read_fields(table, KnownVehicle, where))


def vehicle_table(vehicle: KnownVehicle) -> dict[str, float]:
    """Return the vehicle as it stands in a file."""
    return {key: getattr(vehicle, name) for name, key in VEHICLE_KEYS.items()}


def read_fields(table: object, kind: type[NamedTuple], where: str, optional: bool = False) -> dict[str, float]:
    """Read the fields of a NamedTuple (with ``Quantity``) from a table with unit-suffixed keys."""
    keys = file_keys(kind)
    names = keys.values()
    found = checked.check_keys(table, () if optional else names, names if optional else (), where)
    return {
        name: checked.number(found, keys[name], where, quantity.low, quantity.high)
        for name, quantity in quantities(kind).items()
        if keys[name] in found
    }


class _Row(NamedTuple):
    values: ReferenceRow
    std: dict[str, float]
    frf: dict[str, float]
    extrapolated: tuple[str, ...]


def _read_rows(rows: object, where: str) -> list[_Row]:
    if not isinstance(rows, list) or not rows:
        raise InputError(
            f"{where}: key 'rows'",
            "a list of at least one row is expected",
            "add one row per speed",
        )
    result: list[_Row] = []
    for index, table in enumerate(rows):
        place = f"{where}: rows[{index}]"
        row = _read_row(table, place)
        if result and row.values.speed_kmh <= result[-1].values.speed_kmh:
            raise InputError(
                f"{place}: key 'speed_kmh'",
                f"{row.values.speed_kmh:g} does not ascend from {result[-1].values.speed_kmh:g}",
                "sort the rows by speed, one row per speed",
            )
        result.append(row)
    return result


def _read_row(table: object, where: str) -> _Row:
    beside = [key + suffix for key in ROW_KEYS.values() if key != "speed_kmh" for suffix in ("_std", "_frf")]
    found = checked.check_keys(table, ROW_KEYS.values(), [*beside, "extrapolated"], where)
    values = ReferenceRow(
        **{
            name: checked.number(found, ROW_KEYS[name], where, quantity.low, quantity.high)
            for name, quantity in quantities(ReferenceRow).items()
        }
    )
    if values.c_pin_off > values.c_pin_on:
        raise InputError(
            f"{where}: key '{ROW_KEYS['c_pin_off']}'",
            f"{values.c_pin_off:g} exceeds the on-centre stiffness {values.c_pin_on:g}",
            "an assist lowers the stiffness off centre; check whether the two are swapped",
        )
    std = {n: checked.number(found, f"{k}_std", where, 0.0) for n, k in ROW_KEYS.items() if f"{k}_std" in found}
    frf = {n: checked.number(found, f"{k}_frf", where) for n, k in ROW_KEYS.items() if f"{k}_frf" in found}
    return _Row(values, std, frf, _read_extrapolated(found.get("extrapolated", []), where))


def _read_extrapolated(keys: object, where: str) -> tuple[str, ...]:
    place = f"{where}: key 'extrapolated'"
    if not isinstance(keys, list):
        raise InputError(place, "a list of row keys is expected", "write [] when all was measured")
    for key in keys:
        if not isinstance(key, str) or key not in _FIELD_OF:
            raise InputError(place, f"{key!r} is not a row key", checked.suggestion(str(key), _FIELD_OF))
    return tuple(_FIELD_OF[key] for key in keys)


def _by_speed(reference: ReferenceFile) -> list[int]:
    return sorted(range(len(reference.rows)), key=lambda index: reference.rows[index].speed_kmh)


def _row_table(reference: ReferenceFile, index: int) -> dict[str, Any]:
    row, std, frf = reference.rows[index], reference.std[index], reference.frf[index]
    table: dict[str, Any] = {}
    for name, key in ROW_KEYS.items():
        table[key] = float(getattr(row, name))
        for suffix, source in (("_std", std), ("_frf", frf)):
            # A standard error that could not be computed is absent from the file, not NaN.
            if name in source and math.isfinite(source[name]):
                table[key + suffix] = float(source[name])
    table["extrapolated"] = sorted(ROW_KEYS[name] for name in reference.extrapolated[index])
    return table
