"""Bad reference files are answered by one message that names the place, the fault and the mend."""

import json
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from steer_env.errors import InputError
from steer_env.plants.reference_file import read_reference

Table = dict[str, Any]
VALID = (resources.files("steer_env.plants") / "data" / "chugh_2019.json").read_bytes()


def put(value: object, *keys: str | int) -> Callable[[Table], None]:
    """Set the entry at a path of keys."""

    def apply(table: Table) -> None:
        place: Any = table
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = value

    return apply


def drop(*keys: str | int) -> Callable[[Table], None]:
    def apply(table: Table) -> None:
        place: Any = table
        for key in keys[:-1]:
            place = place[key]
        del place[keys[-1]]

    return apply


CHANGED: dict[str, tuple[Callable[[Table], None], tuple[str, ...]]] = {
    "future schema": (put(2, "schema_version"), ("'schema_version'",)),
    "schema true": (put(True, "schema_version"), ("'schema_version'",)),
    "no schema": (drop("schema_version"), ("'schema_version'", "missing")),
    "no slip form": (drop("slip"), ("'slip'", "missing")),
    "unknown slip form": (put("relaxd", "slip"), ("'slip'", "'relaxed'")),
    "unknown key": (put(1, "row"), ("'row'", "'rows'")),
    "no vehicle": (drop("vehicle"), ("'vehicle'",)),
    "vehicle is a list": (put([], "vehicle"), ("vehicle", "a list")),
    "mass zero": (put(0.0, "vehicle", "mass_kg"), ("'mass_kg'", "physical range")),
    "mass negative": (put(-1784.0, "vehicle", "mass_kg"), ("'mass_kg'",)),
    "no rows": (put([], "rows"), ("'rows'",)),
    "rows not a list": (put({}, "rows"), ("'rows'",)),
    "row is a number": (put(7, "rows", 2), ("rows[2]",)),
    "missing row key": (drop("rows", 1, "n_t_m"), ("rows[1]", "'n_t_m'", "missing")),
    "unknown row key": (put(1.0, "rows", 1, "n_t"), ("rows[1]", "'n_t'", "'n_t_m'")),
    "std of nothing": (put(1.0, "rows", 0, "n_t_std"), ("rows[0]", "'n_t_std'")),
    "negative std": (put(-1.0, "rows", 0, "n_t_m_std"), ("rows[0]", "'n_t_m_std'")),
    "text": (put("0.08", "rows", 3, "n_t_m"), ("rows[3]", "'n_t_m'", "a text")),
    "null": (put(None, "rows", 3, "n_t_m"), ("rows[3]", "'n_t_m'", "nothing")),
    "true": (put(True, "rows", 3, "n_t_m"), ("rows[3]", "'n_t_m'")),
    "beyond any float": (put(10**400, "rows", 3, "C_f_N_per_rad"), ("'C_f_N_per_rad'", "finite")),
    "negative inertia": (put(-0.05, "rows", 3, "J_ref_kgm2"), ("rows[3]", "'J_ref_kgm2'")),
    "negative friction": (put(-2.0, "rows", 3, "M_fric_C_Nm"), ("rows[3]", "'M_fric_C_Nm'")),
    "friction without stiffness": (put(0.0, "rows", 3, "c_fric_Nm_per_rad"), ("c_fric",)),
    "trail in mm": (put(84.5, "rows", 3, "n_t_m"), ("rows[3]", "'n_t_m'", "range")),
    "stiffness per degree": (put(2480.0, "rows", 3, "C_f_N_per_rad"), ("'C_f_N_per_rad'",)),
    "on and off centre swapped": (
        put(30.0, "rows", 3, "c_pin_off_Nm_per_rad"),
        ("rows[3]", "'c_pin_off_Nm_per_rad'", "swapped"),
    ),
    "speeds descend": (lambda t: t["rows"].reverse(), ("rows[1]", "'speed_kmh'", "ascend")),
    "speed twice": (put(45.0, "rows", 3, "speed_kmh"), ("rows[3]", "'speed_kmh'")),
    "speed in m/s": (put(0.1, "rows", 0, "speed_kmh"), ("rows[0]", "'speed_kmh'")),
    "extrapolated unknown": (put(["n_t"], "rows", 0, "extrapolated"), ("'extrapolated'", "n_t_m")),
    "extrapolated not a list": (put("n_t_m", "rows", 0, "extrapolated"), ("'extrapolated'",)),
    "extrapolated of lists": (put([["n_t_m"]], "rows", 0, "extrapolated"), ("'extrapolated'",)),
    "provenance a text": (put("me", "provenance"), ("'provenance'",)),
}

BYTES: dict[str, tuple[bytes, tuple[str, ...]]] = {
    "empty": (b"", ("empty",)),
    "white": (b" \n\n", ("empty",)),
    "binary": (bytes(range(256)) * 9, ("UTF-8",)),
    "truncated": (VALID[:1500], ("line", "cut off")),
    "not a table": (b"[1, 2]", ("table",)),
    "NaN": (VALID.replace(b"0.0817", b"NaN"), ("NaN",)),
    "infinity": (VALID.replace(b"0.0817", b"-Infinity"), ("Infinity",)),
    "overflow": (VALID.replace(b"0.0817", b"1e999"), ("rows[6]", "'n_t_m'", "finite")),
    "5000 digits": (VALID.replace(b"0.0817", b"9" * 5000), ("number",)),
    "key twice": (VALID.replace(b'"J_z_kgm2"', b'"n_t_m"', 1), ("'n_t_m'", "twice")),
    "comment": (b"// reference\n" + VALID, ("line 1",)),
    "deep": (b"[" * 100_000, ("nested",)),
    "huge": (b" " * 10_000_001, ("bytes",)),
}


def _refused(path: Path, named: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as caught:
        read_reference(path)
    message = str(caught.value)
    for part in ("reference.json", *named):
        assert part in message
    assert "\n" not in message
    assert len(caught.value.mend) > 8


@pytest.mark.parametrize("case", CHANGED)
def test_wrong_content(case: str, tmp_path: Path) -> None:
    """Catches a key or value that no environment could use, or that nobody would read."""
    change, named = CHANGED[case]
    table = json.loads(VALID)
    change(table)
    (tmp_path / "reference.json").write_text(json.dumps(table), encoding="utf-8")
    _refused(tmp_path / "reference.json", named)


@pytest.mark.parametrize("case", BYTES)
def test_wrong_bytes(case: str, tmp_path: Path) -> None:
    """Catches a traceback from the JSON reader."""
    content, named = BYTES[case]
    (tmp_path / "reference.json").write_bytes(content)
    _refused(tmp_path / "reference.json", named)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    """Catches an OSError passed on as it is."""
    _refused(tmp_path / "reference.json", ())
    (tmp_path / "reference.json").mkdir()
    _refused(tmp_path / "reference.json", ("folder",))
