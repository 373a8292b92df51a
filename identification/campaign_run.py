"""One run of a campaign: opened, mapped to our channels, checked, and made even in time."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from identification import campaign_physics as physics
from identification import campaign_values as values
from identification.campaign_table import Table, open_table
from identification.campaign_time import check_time, make_even
from identification.campaign_toml import Declaration, DeclaredRun
from identification.channels import KIND_CHANNELS, ChannelMap, FloatArray, refuse_near_misses
from steer_env.campaign_file import SHORTEST
from steer_env.errors import InputError
from steer_env.plants.checked import listed
from steer_env.units import to_kmh

REQUIRED = {
    "vehicle": ("time_s",),
    "rig": ("time_s", "motor_angle_rad"),
    "drive": KIND_CHANNELS["drive"],
}


@dataclass(frozen=True)
class Run:
    """One run: time [n] in s on an even step dt, channels [n] in SI by the contract's names."""

    name: str  # the file, relative to campaign.toml
    manoeuvre: str
    speed: float  # m/s, nominal; the mean of the channel where a drive states none
    role: str  # "identify" or "validate"
    time: FloatArray
    dt: float
    channels: dict[str, FloatArray]
    notes: list[str] = field(default_factory=list)
    where: str = ""  # path of the file, for messages

    @property
    def speed_kmh(self) -> float:
        """Nominal speed in km/h, rounded to what speeds are compared by."""
        return round(to_kmh(self.speed), 6)


def require(run: Run, channel_names: Sequence[str], step: str) -> None:
    """Raise ``InputError`` naming the channels that ``step`` needs and the run lacks."""
    missing = [name for name in channel_names if name not in run.channels]
    if missing:
        raise InputError(
            f"{run.where or run.name}: column '{missing[0]}'",
            f"{step} needs the channel{'s' * (len(missing) > 1)} {listed(missing)}; "
            f"the run has {listed(run.channels)}",
            "add the column, or map yours in campaign.toml, [channels]",
        )


def read_run(entry: DeclaredRun, declared: Declaration) -> Run:
    """Read and check one declared run; its role is still the declared one."""
    table = open_table(entry.path)
    raw = _load(table, declared)
    _check_shortest(raw["time_s"], entry, table)
    step = check_time(raw["time_s"], table.row)
    time = raw.pop("time_s")
    suspect = values.Suspect(table.where, table.row, entry.manoeuvre, step, raw)
    values.check_values(suspect)
    time, channels, dt, note = make_even(time, raw, step)
    run = Run(
        entry.file,
        entry.manoeuvre,
        _speed(entry, channels),
        entry.role,
        time,
        dt,
        channels,
        [note] if note else [],
        table.where,
    )
    _check_physics(suspect._replace(dt=dt, channels=channels), run, entry, declared)
    return run


def _load(table: Table, declared: Declaration) -> dict[str, FloatArray]:
    """Load the channels of the campaign's kind that the file has, in SI."""
    refuse_near_misses(table.header, declared.maps, declared.kind, table.where)
    known = dict.fromkeys([*KIND_CHANNELS[declared.kind], *declared.maps])
    maps = {name: declared.maps.get(name, ChannelMap(name)) for name in known}
    present = {name: entry for name, entry in maps.items() if entry.source in table.header}
    for name in REQUIRED[declared.kind]:
        if name not in present:
            source = maps[name].source
            mapped = f" (mapped from '{source}')" if name in declared.maps else ""
            raise InputError(
                f"{table.where}: column '{source}'",
                f"the channel {name}{mapped} is missing",
                f"the file has {listed(table.header)[:300]}; name the right one in campaign.toml, "
                f"[channels] {name}",
            )
    if len(present) < 2 + (declared.kind == "rig"):
        raise InputError(
            table.where,
            "the file has no channel besides time" if declared.kind != "rig" else "no torque",
            f"add some of {listed(KIND_CHANNELS[declared.kind][1:])}, or map yours in [channels]",
        )
    stored = table.load([entry.source for entry in present.values()])
    raw = {name: entry.to_si(stored[entry.source]) for name, entry in present.items()}
    bad = np.flatnonzero(~np.isfinite(raw["time_s"]))
    if bad.size:
        raise InputError(
            f"{table.row(int(bad[0]))}: column 'time_s'",
            f"the time is {raw['time_s'][bad[0]]}",
            "remove the incomplete samples, or log again",
        )
    return raw


def _check_shortest(time: FloatArray, entry: DeclaredRun, table: Table) -> None:
    seconds, why = SHORTEST[entry.manoeuvre]
    length = float(time[-1] - time[0]) if len(time) else 0.0
    # A clock that runs backwards or in another unit is check_time's to explain.
    if 0.0 <= length < 0.98 * seconds and not np.any(np.diff(time) <= 0.0):
        raise InputError(
            f"{table.row(len(time) - 1)}: column 'time_s'",
            f"the run lasts {length:.3g} s, but '{entry.manoeuvre}' needs {seconds:g} s: {why}",
            "use a longer run; if it is longer, check the unit of the time or a cut-off file",
        )


def _speed(entry: DeclaredRun, channels: dict[str, FloatArray]) -> float:
    if entry.speed is not None:
        return entry.speed
    speed = channels.get("vehicle_speed_mps")
    return 0.0 if speed is None else float(np.mean(speed))


def _check_physics(
    suspect: values.Suspect, run: Run, entry: DeclaredRun, declared: Declaration
) -> None:
    if entry.speed is not None and declared.kind != "rig":
        values.check_speed(suspect, entry.speed)
    if declared.steering is not None:
        physics.check_torsion_bar(suspect, declared.steering.torsion_bar_stiffness)
    physics.check_steering_wheel(suspect)
    if declared.vehicle is not None:
        physics.check_vehicle(suspect, declared.vehicle, run.speed)
