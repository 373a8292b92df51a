"""Recording the episodes of an environment, simulated or on a rig, as a measurement campaign.

    env = RecordCampaign(gymnasium.make("steer_env/SbW-Impedance-v0"), "bench", kind="rig")
    ...                            # episodes as ever; each becomes a run
    env.close()                    # then: steer-env gap bench

A row holds the state at a time and the motor torque commanded from then on. What it holds is what ``info`` says: in
simulation the true signals, on a rig the measured ones at the times at which they came, brought to the even grid of the
control period. A rig that has no torque sensor gets no sensor_torque_Nm, as its torque is estimated from the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium

from steer_env.campaign_file import CampaignFile, refuse_recorded
from steer_env.envs.layout import PERIOD
from steer_env.errors import InputError
from steer_env.plants import Plant, Reference
from steer_env.plants.reference_file import vehicle_table
from steer_env.units import to_kmh

Info = Mapping[str, Any]
Step = tuple[Any, Any, bool, bool, dict[str, Any]]
COMMAND = "motor_torque_Nm"
GAP = 0.02  # s without a measurement at which a run ends and another begins
SAME = 1e-7  # s within which a measurement is at a point of the grid
VEHICLE = {
    "steering_angle_rad": "steering_angle",
    "steering_torque_Nm": "steering_torque",
    "pinion_angle_rad": "pinion_angle",
    "torsion_bar_torque_Nm": "torsion_bar_torque",
    "vehicle_speed_mps": "speed",
    "yaw_rate_radps": "yaw_rate",
    "lateral_acceleration_mps2": "lateral_acceleration",
}


class EvenRows:
    """Rows on the grid ``k period`` out of rows at uneven times as they come, straight between two of them.

    ``held`` columns (by number) keep the value of the earlier one until the next.
    """

    def __init__(self, period: float, held: Sequence[int]) -> None:
        self.period, self.held = period, tuple(held)
        self._last: tuple[float, list[float]] | None = None
        self._start, self._next = 0.0, 0

    def feed(self, time: float, values: Sequence[float]) -> list[tuple[float, ...]]:
        """Take a row at a time in s; the grid's rows (time since the first, values) that it completes."""
        new = list(values)
        if self._last is None:
            self._start = time
            before, old = time, new
        else:
            before, old = self._last
        if time <= before and self._last is not None:  # the same measurement again: only what is held can be new
            for k in self.held:
                old[k] = new[k]
            return []
        rows = []
        while (at := self._start + self._next * self.period) <= time + SAME:
            here = at >= time - SAME
            share = 1.0 if here else (at - before) / (time - before)
            row = [a + share * (b - a) if not here else b for a, b in zip(old, new, strict=True)]
            for k in self.held:
                row[k] = new[k] if here else old[k]
            rows.append((self._next * self.period, *row))
            self._next += 1
        self._last = time, new
        return rows


class Kind(NamedTuple):
    """A kind of campaign out of an environment: columns besides the time, and their values of an ``info``."""

    columns: tuple[str, ...]
    values: Callable[[Info], list[float]]
    tables: Mapping[str, Mapping[str, float]]


def _vehicle(env: Any, info: Info) -> Kind:
    """What a car with this steering would log; the rack's force only where a rack is on the wheel and is known."""
    plant, car = env.plant, car_of(env)
    pinion_ratio, rack = car.file.vehicle.pinion_ratio, "rig" not in info and plant.rack_share > 0.0
    names = tuple(VEHICLE.values())

    def values(seen: Info) -> list[float]:
        row = [seen[name] for name in names]
        return [*row, seen["rack_torque"] * pinion_ratio] if rack else row

    columns = (*VEHICLE, "rack_force_N") if rack else tuple(VEHICLE)
    return Kind(columns, values, {"vehicle": vehicle_table(car.file.vehicle), "steering": steering_keys(plant)})


def _rig(env: Any, info: Info) -> Kind:
    """What a bench would log: angle, command, and the sensor's torque (it resists the motor) where there is one."""
    if env.plant.rack_share != 0.0 or env.plant.steering.motor_ratio != 1.0:
        raise InputError(
            "RecordCampaign", f"{env.plant.name} is no motor on a bench", "record it as a campaign of kind 'vehicle'"
        )
    columns, sensed = ("motor_angle_rad", COMMAND), ("motor_angle_rad", COMMAND, "sensor_torque_Nm")
    if "rig" not in info:
        return Kind(sensed, lambda i: [i["pinion_angle"], i["command"], -i["torsion_bar_torque"]], {"rig": {}})
    if math.isnan(info["rig"]["sensor_torque"]):
        return Kind(columns, lambda i: [i["pinion_angle"], i["command"]], {"rig": {}})
    return Kind(sensed, lambda i: [i["pinion_angle"], i["command"], -i["rig"]["sensor_torque"]], {"rig": {}})


KINDS: dict[str, Callable[[Any, Info], Kind]] = {"vehicle": _vehicle, "rig": _rig}


class RecordCampaign(gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """Write each episode as a run of a campaign in ``folder``, for ``steer-env identify`` and ``gap``.

    ``kind`` is "vehicle" or "rig"; None: "rig" on a rig, else "vehicle". Two attributes hold for the next episode:
    ``manoeuvre``, what the campaign calls it where that is not the task's, and ``role`` ("identify", "validate" or
    "auto": the reader holds one of three repeats out). A killed program loses the last tenth of a second.

    Raises InputError where a campaign is there already, or the environment is not of that kind.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], folder: str | Path, kind: str | None = None, manoeuvre: str | None = None,
        name: str = "",
    ) -> None:  # fmt: skip
        gymnasium.utils.RecordConstructorArgs.__init__(self, folder=folder, kind=kind, manoeuvre=manoeuvre, name=name)
        super().__init__(env)
        inside: Any = env.unwrapped
        self.real = hasattr(inside, "connection")
        self.kind = kind or ("rig" if self.real else "vehicle")
        if self.kind not in KINDS:
            raise InputError("RecordCampaign", f"there is no kind {kind!r}", f"give one of {', '.join(KINDS)}")
        self.manoeuvre, self.role = manoeuvre, "auto"
        self._named = name or (inside.spec.id if inside.spec is not None else type(inside).__name__)
        self._folder, self._before = Path(folder), {}  # type: Path, Info
        self._row: Kind | None = None
        self._time = math.nan  # s, of the last measurement on a rig
        self.campaign: CampaignFile | None = None
        refuse_recorded(self._folder)  # now, not when a motor waits

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode, and with it a run."""
        observation, info = self.env.reset(**kwargs)
        inside: Any = self.env.unwrapped
        speeds = inside.task.speed_kmh
        if self.kind == "vehicle" and not isinstance(speeds, (int, float)) and speeds[0] != speeds[1]:
            raise InputError("RecordCampaign", "the speed changes in the episode", "give one speed: a run has one")
        self._row = KINDS[self.kind](inside, info)
        if self.campaign is None:
            self.campaign = CampaignFile(self._folder, self._named, self.kind, self._row.tables)
        self._speed = round(to_kmh(info["speed"]), 3) if self.kind == "vehicle" else None
        self._begin()
        self._before = info
        return observation, info

    def step(self, action: Any) -> Step:
        """One period; its row goes to the file."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        assert self._row is not None, "the environment lets no step come before a reset"
        if self.real:
            time, values = info["rig"]["arrival_time"], self._row.values(info)
            if abs(time - self._time) > GAP:
                self._begin()
        else:
            time, values = self._before["time"], self._row.values({**self._before, "command": info["command"]})
        self._time = time
        assert self.campaign is not None
        for row in self._even.feed(time, values):
            self.campaign.row(row)
        self._before = info
        if terminated or truncated:
            self.campaign.end()
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Finish the campaign, then close the environment."""
        try:
            if self.campaign is not None:
                self.campaign.close()
        finally:
            self.env.close()

    def _begin(self) -> None:
        assert self._row is not None
        assert self.campaign is not None
        task = getattr(self.env.unwrapped, "task")  # noqa: B009  (not a member of every Env)
        columns = ("time_s", *self._row.columns)
        self.campaign.begin(columns, self.manoeuvre or task.manoeuvre, self._speed, self.role)
        held = [k for k, name in enumerate(self._row.columns) if name == COMMAND]
        self._even, self._time = EvenRows(PERIOD, held), math.nan


def car_of(env: Any) -> Reference:
    """The car behind the rack of an environment: the reference's own unless another was chosen."""
    reference: Reference = env.reference
    return reference if env.task.car is None else Reference.load(env.task.car)


def steering_keys(plant: Plant) -> dict[str, float]:
    """Table [steering] of a campaign: what is known of a plant; nobody's robot is on it."""
    s = plant.steering
    return {
        "wheel_inertia_kgm2": s.J_s,
        "robot_inertia_kgm2": 0.0,
        "wheel_damping_Nms_per_rad": s.b_s,
        "torsion_bar_stiffness_Nm_per_rad": s.c_tb,
        "torsion_bar_damping_Nms_per_rad": s.b_tb,
    }
