"""What ``campaign.toml`` declares (docs/formats.md, section 1): checked, no run file opened yet."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from identification.channels import KIND_CHANNELS, ChannelMap, read_channel_maps
from steer_env.campaign_file import SCHEMA_VERSION, SHORTEST
from steer_env.errors import InputError
from steer_env.plants import checked
from steer_env.plants.reference_file import read_fields, read_vehicle
from steer_env.plants.reference_row import KnownVehicle
from steer_env.units import Quantity, from_kmh

LIMIT_BYTES = 1_000_000
ROLES = ("identify", "validate", "auto")


class KnownSteering(NamedTuple):
    """What is known of a steering system without identification."""

    wheel_inertia: Annotated[float, Quantity("kg m2", "J_s", 1e-3, 1.0, "assumption: any wheel")]
    robot_inertia: Annotated[float, Quantity("kg m2", "added by the robot", 0.0, 2.0, "assumption")]
    wheel_damping: Annotated[float, Quantity("N m s/rad", "b_s", 0.0, 20.0, "assumption")]
    torsion_bar_stiffness: Annotated[
        float, Quantity("N m/rad", "c_tb", 10.0, 5e4, "assumption: EPAS bar to SbW sensor")
    ]
    torsion_bar_damping: Annotated[float, Quantity("N m s/rad", "b_tb", 0.0, 50.0, "assumption")]


class KnownRig(NamedTuple):
    """Start values for a force-feedback motor on a bench, None where not given."""

    inertia: Annotated[float | None, Quantity("kg m2", "rotor and wheel", 1e-6, 10.0, "assumption")]
    damping: Annotated[float | None, Quantity("N m s/rad", "bearing", 0.0, 100.0, "assumption")]


class DeclaredRun(NamedTuple):
    """One [[runs]] entry; ``speed`` in m/s, None where a drive does not state it."""

    where: str
    file: str
    path: Path
    manoeuvre: str
    speed: float | None
    role: str


class Declaration(NamedTuple):
    """The whole of campaign.toml."""

    path: Path
    name: str
    kind: str
    vehicle: KnownVehicle | None
    steering: KnownSteering | None
    rig: KnownRig | None
    maps: dict[str, ChannelMap]
    runs: list[DeclaredRun]


def read_declaration(path: str | Path) -> Declaration:
    """Read campaign.toml; ``path`` is the file or the folder that holds it."""
    path = _toml_path(Path(path))
    where = str(path)
    try:
        table = tomllib.loads(checked.read_utf8(path, LIMIT_BYTES))
    except (ValueError, RecursionError) as error:
        raise InputError(where, f"this is not valid TOML ({error})", "correct that line") from error
    tables = ("vehicle", "steering", "rig", "channels")
    checked.check_keys(table, ("schema_version", "name", "kind", "runs"), tables, where)
    checked.schema_version(table, where, SCHEMA_VERSION)
    kind = checked.text(table, "kind", where, tuple(KIND_CHANNELS))
    _check_tables(table, kind, where)
    vehicle = read_vehicle(table["vehicle"], f"{where}: [vehicle]") if "vehicle" in table else None
    steering = rig = None
    if "steering" in table:
        steering = KnownSteering(
            **read_fields(table["steering"], KnownSteering, f"{where}: [steering]")
        )
    if kind == "rig":
        start = read_fields(table.get("rig", {}), KnownRig, f"{where}: [rig]", optional=True)
        rig = KnownRig(start.get("inertia"), start.get("damping"))
    maps = read_channel_maps(table.get("channels", {}), f"{where}: [channels]")
    name = checked.text(table, "name", where)
    runs = _read_runs(table["runs"], kind, path)
    return Declaration(path, name, kind, vehicle, steering, rig, maps, runs)


def _toml_path(path: Path) -> Path:
    if not path.exists():
        raise InputError(str(path), "there is no such campaign", "check the path")
    if not path.is_dir():
        return path
    inside = path / "campaign.toml"
    if not inside.is_file():
        content = sorted(p.name for p in path.iterdir())
        what = "the folder has no campaign.toml" if content else "the folder is empty"
        raise InputError(str(path), what, "give the folder that holds campaign.toml, or write one")
    return inside


def _check_tables(table: Mapping[str, Any], kind: str, where: str) -> None:
    needed = {"vehicle": ("vehicle", "steering")}.get(kind, ())
    for name in needed:
        if name not in table:
            raise InputError(
                f"{where}: key '{name}'",
                f"a campaign of kind '{kind}' needs the table [{name}]",
                "add it: these numbers are known of the car, they are not identified",
            )
    allowed = {"vehicle": needed, "rig": ("rig",), "drive": ()}[kind]
    for name in ("vehicle", "steering", "rig"):
        if name in table and name not in allowed:
            raise InputError(
                f"{where}: key '{name}'",
                f"a campaign of kind '{kind}' does not read the table [{name}]",
                "remove the table, or correct the key 'kind'",
            )


def _read_runs(entries: object, kind: str, path: Path) -> list[DeclaredRun]:
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{path}: key 'runs'", "there is no run", "add a [[runs]] table per run")
    runs: list[DeclaredRun] = []
    for index, entry in enumerate(entries):
        run = _read_run(entry, kind, path, f"{path}: runs[{index}]")
        if run.path.resolve() in (other.path.resolve() for other in runs):
            raise InputError(
                f"{run.where}: key 'file'",
                f"'{run.file}' is listed twice",
                "remove one entry; a run counted twice would pass for a repeat",
            )
        runs.append(run)
    return runs


def _read_run(entry: object, kind: str, path: Path, where: str) -> DeclaredRun:
    required = ("file", "manoeuvre", "speed_kmh") if kind == "vehicle" else ("file", "manoeuvre")
    optional = ("role",) if kind == "vehicle" else ("role", "speed_kmh")
    table = checked.check_keys(entry, required, optional, where)
    file = checked.text(table, "file", where)
    place = path.parent.resolve()
    try:
        target = (place / file).resolve()
    except (ValueError, OSError) as error:
        raise InputError(f"{where}: key 'file'", "not a file name", "correct it") from error
    if Path(file).is_absolute() or not target.is_relative_to(place):
        raise InputError(
            f"{where}: key 'file'",
            f"'{file}' lies outside the campaign's folder",
            "copy the run into the folder and name it relative to campaign.toml",
        )
    manoeuvre = checked.text(table, "manoeuvre", where, tuple(SHORTEST))
    role = checked.text(table, "role", where, ROLES) if "role" in table else "auto"
    speed = None
    if "speed_kmh" in table:
        speed = from_kmh(checked.number(table, "speed_kmh", where, 0.0, 400.0))
        if kind == "vehicle" and speed == 0.0 and manoeuvre != "standstill":
            raise InputError(
                f"{where}: key 'speed_kmh'",
                f"the manoeuvre '{manoeuvre}' cannot be driven at 0 km/h",
                'write the speed driven, or manoeuvre = "standstill"',
            )
    return DeclaredRun(where, file, path.parent / file, manoeuvre, speed, role)
