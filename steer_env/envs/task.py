"""What an environment is asked to do, checked, and turned into the rows that the kernels read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.envs import draws
from steer_env.envs.layout import LINE_LENGTH, PARAMETERS, CarSpread, Episode, Reward
from steer_env.errors import InputError
from steer_env.manoeuvres import MANOEUVRES, ManoeuvreParameters, kind_of
from steer_env.physics.driver import Driver
from steer_env.physics.effects.vehicle_ports import MECHANICAL, effect_row
from steer_env.physics.reference import ReferenceParameters
from steer_env.physics.sensors import Sensors
from steer_env.plants import DRIVERS, PLANTS, Plant, Reference
from steer_env.plants.amplitude import hand_amplitude, paper_acceleration, steering_amplitude
from steer_env.plants.model_file import ExtendedModel
from steer_env.plants.reference import steady_stiffness
from steer_env.units import check_ranges, from_kmh, quantities


@dataclass(frozen=True)
class Task:
    """Everything that can be chosen at ``gymnasium.make`` or in ``reset(options=...)``.

    reference: "published", a reference.json or a Reference; ``linear`` True takes Eq. 10, False
        the complete one, None what the Reference itself says.
    car: whose vehicle loads the rack; None takes the one that the reference was identified on.
    speed_kmh: one number, or (start, end) for a speed that changes evenly over the episode.
    amplitude: hand angle in rad (N m for random_torque); None takes the paper's for the speed.
    duration: s after the lead-in; None takes the manoeuvre's.
    randomise: names out of RANDOMISABLE, "all", or nothing; drawn anew at each reset from the
        environment's own generator.
    car_spread: factors on the car, where it is not drawn.
    model: a model.json of ``steer-env gap`` or an ExtendedModel: its reference (``reference`` stays away then), and its
        effects in the plant. Effects of the basic assist, and errors of sensors that no plant here has, are left out;
        those of the others come on top of ``sensors``.
    """

    plant: str | Plant = "EPAS"
    causality: str = "impedance"
    reference: str | Path | Reference = "published"
    linear: bool | None = None
    car: str | Path | Reference | None = None
    manoeuvre: str = "frequency_response"
    speed_kmh: float | tuple[float, float] = 75.0
    driver: str | Driver = "relaxed"
    amplitude: float | None = None
    duration: float | None = None
    randomise: str | Iterable[str] = ()
    sensors: Sensors | None = None
    reward: Reward = field(default_factory=Reward)
    car_spread: CarSpread = field(default_factory=CarSpread)
    model: str | Path | ExtendedModel | None = None

    def changed(self, options: dict[str, Any]) -> Task:
        """The task with some choices replaced; an unknown name is an InputError."""
        known = [f.name for f in fields(self)]
        for name in options:
            if name not in known:
                raise InputError("options", f"there is no option {name!r}", f"use {_suggest(name, known)}")
        return replace(self, **options)


@dataclass(frozen=True)
class Setup:
    """A task made ready: parameter row, periods, and the tables of reference and car over speed.

    ``plant`` is the one that a controller may know: the nominal one, whatever was drawn.
    """

    row: NDArray[np.float64]
    periods: int
    table: NDArray[np.float64]
    car_table: NDArray[np.float64]
    reference: Reference
    plant: Plant
    effects: NDArray[np.float64] | None = None


_RANGES = [q for record in PARAMETERS.records.values() for q in quantities(record).values()]
_LOW, _HIGH = np.array([(q.low, q.high) for q in _RANGES]).T


class _Aim(NamedTuple):
    """Pinion angle in rad that a manoeuvre is to reach, against the reference at that speed and its stiffness."""

    angle: float
    reference: ReferenceParameters
    stiffness: float


class Ready:
    """A checked task, its files read: an episode of it costs what is drawn for that episode alone.

    InputError names the option that is wrong.
    """

    def __init__(self, task: Task, period: float) -> None:
        self.task, self.period = task, period
        self.chosen = draws.randomised_names(task.randomise)
        plant = _from_table(task.plant, PLANTS, Plant, "plant")
        self.driver = _from_table(task.driver, DRIVERS, Driver, "driver")
        if task.causality not in ("impedance", "admittance"):
            raise InputError("causality", f"{task.causality!r} is not known", "use 'impedance' or 'admittance'")
        if task.manoeuvre not in MANOEUVRES:
            raise InputError(
                "manoeuvre",
                f"{task.manoeuvre!r} is not known",
                f"use {_suggest(task.manoeuvre, MANOEUVRES)}",
            )
        model = None if task.model is None else ExtendedModel.load(task.model)
        if model is not None and task.reference != "published":
            what = "a model brings its own reference"
            raise InputError("reference", what, "leave 'reference' away, or write another reference into the model")
        self.reference = Reference.load(task.reference if model is None else model.feel, task.linear)
        car = self.reference if task.car is None else Reference.load(task.car)
        self.tables = self.reference.table, car.table
        self.speeds = (0.0, 0.0) if "speed" in self.chosen else _speeds(task.speed_kmh)
        if task.sensors is not None:
            plant = replace(plant, sensors=task.sensors)
        if model is not None:
            plant = with_sensor_errors(plant, model.effects, period)
        self.plant = plant
        felt = model is not None and MECHANICAL.keys() & model.effects.keys()
        self.effects = effect_row(model.effects) if model is not None and felt else None
        self._aim = None if "speed" in self.chosen else _aim(task, self.speeds[0], self.reference)

    def drawn(self, rng: np.random.Generator) -> Setup:
        """One episode."""
        task, chosen, plant, (speed, speed_end) = self.task, self.chosen, self.plant, self.speeds
        if "speed" in chosen:
            speed = speed_end = draws.random_speed(self.reference, rng)
        driver = draws.random_driver(rng) if "driver" in chosen else self.driver
        if "plant" in chosen:
            plant = plant.drawn(rng)
        car_spread = draws.random_car(rng) if "car" in chosen else task.car_spread
        aim = self._aim or _aim(task, speed, self.reference)
        manoeuvre = _manoeuvre(task, driver, aim, rng if "manoeuvre" in chosen else None)
        length = manoeuvre.lead_in + manoeuvre.duration
        row = PARAMETERS.row(
            steering=plant.steering,
            motor=plant.motor,
            driver=driver,
            sensors=plant.sensors,
            observer=plant.observer(),
            manoeuvre=manoeuvre,
            episode=Episode(
                kind=float(kind_of(task.manoeuvre)),
                speed=speed,
                speed_rate=(speed_end - speed) / length,
                speed_end=speed_end,
                admittance=1.0 if task.causality == "admittance" else 0.0,
                rack_share=plant.rack_share,
            ),
            car_spread=car_spread,
            reward=task.reward,
        )
        if not ((row >= _LOW) & (row <= _HIGH)).all():
            for name in PARAMETERS.records:
                check_ranges(PARAMETERS.read(row, name), name)
        believed = self.plant.believed()
        return Setup(row, round(length / self.period), *self.tables, self.reference, believed, self.effects)


def prepare(task: Task, rng: np.random.Generator, period: float) -> Setup:
    """Check a task and draw what is random in it; InputError names the option that is wrong."""
    return Ready(task, period).drawn(rng)


def with_sensor_errors(plant: Plant, effects: Mapping[str, Mapping[str, float]], period: float) -> Plant:
    """The plant with the sensor errors of a model: gain and offset of the torque, latencies in whole periods."""
    s = plant.sensors

    def periods(name: str) -> float:
        return float(round(effects[name]["delay_s"] / period)) if name in effects else 0.0

    delays = {
        "angle_delay": s.angle_delay + periods("latency_pinion"),
        "torque_delay": s.torque_delay + periods("latency_torque"),
    }
    for name, delay in delays.items():
        if delay >= LINE_LENGTH:
            raise InputError(
                "model", f"{name} is {1e3 * delay * period:g} ms", f"an environment remembers {LINE_LENGTH - 1} ms"
            )
    gain = effects.get("torque_gain", {}).get("ratio", 1.0)
    offset = effects.get("torque_offset", {}).get("Nm", 0.0)
    return replace(plant, sensors=s._replace(torque_gain=gain, torque_offset=offset, **delays))


def _aim(task: Task, speed: float, reference: Reference) -> _Aim | None:
    """What the hand must do at a speed in m/s; None where the amplitude is given."""
    row = MANOEUVRES[task.manoeuvre]
    if task.amplitude is not None or row.lateral_acceleration == 0.0:
        return None
    wanted = paper_acceleration(speed) if row.lateral_acceleration is None else row.lateral_acceleration
    p = row.parameters
    peak = p.frequency_end if task.manoeuvre == "frequency_response" else p.frequency
    at_speed = reference.at(speed)
    return _Aim(steering_amplitude(wanted, speed, at_speed, peak), at_speed, steady_stiffness(speed, at_speed))


def _manoeuvre(task: Task, driver: Driver, aim: _Aim | None, rng: np.random.Generator | None) -> ManoeuvreParameters:
    p = MANOEUVRES[task.manoeuvre].parameters
    if aim is not None:
        if driver.k <= 0.0 and driver.torque_limit > 0.0:
            raise InputError(
                "driver",
                f"a driver without stiffness cannot follow {task.manoeuvre}",
                "use manoeuvre='random_torque'",
            )
        p = p._replace(amplitude=hand_amplitude(aim.angle, driver, aim.reference, aim.stiffness))
    elif task.amplitude is not None:
        p = p._replace(amplitude=float(task.amplitude))
    if task.duration is not None:
        p = p._replace(duration=float(task.duration))
    if rng is not None:
        p = p._replace(amplitude=p.amplitude * rng.uniform(0.5, 1.1), phase=rng.uniform(0.0, 1000.0))
    return p


def _speeds(speed_kmh: float | tuple[float, float]) -> tuple[float, float]:
    try:
        start, end = (speed_kmh, speed_kmh) if isinstance(speed_kmh, (int, float)) else speed_kmh
        start, end = float(start), float(end)
    except (TypeError, ValueError) as wrong:
        raise InputError("speed_kmh", f"{speed_kmh!r} is not a speed", "give km/h, or (start, end) in km/h") from wrong
    for value in (start, end):
        if not 2.0 <= value <= 400.0:
            raise InputError("speed_kmh", f"{value:g} km/h is out of range", "give 2 to 400 km/h")
    return from_kmh(start), from_kmh(end)


def _from_table(value: Any, table: dict[str, Any], kind: type, option: str) -> Any:
    if isinstance(value, kind):
        return value
    if value in table:
        return table[value]
    raise InputError(option, f"{value!r} is not known", f"use {_suggest(str(value), table)}")


def _suggest(name: str, known: Iterable[str]) -> str:
    names = list(known)
    close = get_close_matches(name, names, 1)
    return f"{close[0]!r} (all: {', '.join(names)})" if close else f"one of {', '.join(names)}"
