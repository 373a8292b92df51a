"""What an environment is asked to do, checked, and turned into the rows that the kernels read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.envs.layout import LINE_LENGTH, PARAMETERS, CarSpread, Episode, Reward
from steer_env.errors import InputError
from steer_env.manoeuvres import MANOEUVRES, kind_of
from steer_env.physics.driver import Driver
from steer_env.physics.effects.vehicle_ports import MECHANICAL, effect_row
from steer_env.physics.sensors import Sensors
from steer_env.plants import DRIVERS, PLANTS, Plant, Reference
from steer_env.plants.amplitude import hand_amplitude, paper_acceleration, steering_amplitude
from steer_env.plants.model_file import ExtendedModel
from steer_env.plants.reference import steady_stiffness
from steer_env.units import check_ranges, from_kmh

RANDOMISABLE = ("plant", "driver", "car", "speed", "manoeuvre")
CAR_FACTORS = {
    "mass": (0.9, 1.2),
    "grip": (0.8, 1.15),
    "trail": (0.85, 1.15),
}  # assumption: load, tyres, pressure
RANDOM_ARMS = ("one_hand_light", "relaxed", "tense")


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


def prepare(task: Task, rng: np.random.Generator, period: float) -> Setup:
    """Check a task and draw what is random in it; InputError names the option that is wrong."""
    chosen = _randomised_names(task.randomise)
    plant = _from_table(task.plant, PLANTS, Plant, "plant")
    driver = _from_table(task.driver, DRIVERS, Driver, "driver")
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
    named = task.reference if model is None else model.feel
    reference = Reference.load(named, task.linear)
    speeds = _speeds(task.speed_kmh, reference, rng if "speed" in chosen else None)
    if "driver" in chosen:
        driver = random_driver(rng)
    if task.sensors is not None:
        plant = replace(plant, sensors=task.sensors)
    if model is not None:
        plant = with_sensor_errors(plant, model.effects, period)
    believed = plant.believed()
    if "plant" in chosen:
        plant = plant.drawn(rng)
    parts = {
        "steering": plant.steering,
        "motor": plant.motor,
        "sensors": plant.sensors,
        "observer": plant.observer(),
        "driver": driver,
        "reward": task.reward,
        "car_spread": random_car(rng) if "car" in chosen else task.car_spread,
    }
    parts["manoeuvre"] = _manoeuvre(task, driver, speeds[0], reference, rng if "manoeuvre" in chosen else None)
    length = parts["manoeuvre"].lead_in + parts["manoeuvre"].duration
    parts["episode"] = Episode(
        kind=float(kind_of(task.manoeuvre)),
        speed=speeds[0],
        speed_rate=(speeds[1] - speeds[0]) / length,
        speed_end=speeds[1],
        admittance=1.0 if task.causality == "admittance" else 0.0,
        rack_share=plant.rack_share,
    )
    row = np.zeros(PARAMETERS.size)
    for name, part in parts.items():
        check_ranges(part, name)
        row[PARAMETERS[name]] = part
    car = reference if task.car is None else Reference.load(task.car)
    effects = None if model is None or not MECHANICAL.keys() & model.effects.keys() else effect_row(model.effects)
    return Setup(row, round(length / period), reference.table, car.table, reference, believed, effects)


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


def _manoeuvre(task: Task, driver: Driver, speed: float, reference: Reference, rng: np.random.Generator | None) -> Any:
    row = MANOEUVRES[task.manoeuvre]
    p = row.parameters
    amplitude = task.amplitude
    if amplitude is None and row.lateral_acceleration != 0.0:
        if driver.k <= 0.0 and driver.torque_limit > 0.0:
            raise InputError(
                "driver",
                f"a driver without stiffness cannot follow {task.manoeuvre}",
                "use manoeuvre='random_torque'",
            )
        wanted = paper_acceleration(speed) if row.lateral_acceleration is None else row.lateral_acceleration
        peak = p.frequency_end if task.manoeuvre == "frequency_response" else p.frequency
        at_speed = reference.at(speed)
        angle = steering_amplitude(wanted, speed, at_speed, peak)
        amplitude = hand_amplitude(angle, driver, at_speed, steady_stiffness(speed, at_speed))
    p = p._replace(amplitude=p.amplitude if amplitude is None else float(amplitude))
    if task.duration is not None:
        p = p._replace(duration=float(task.duration))
    if rng is not None:
        p = p._replace(amplitude=p.amplitude * rng.uniform(0.5, 1.1), phase=rng.uniform(0.0, 1000.0))
    return p


def _speeds(
    speed_kmh: float | tuple[float, float], reference: Reference, rng: np.random.Generator | None
) -> tuple[float, float]:
    known = [row.speed_kmh for row in reference.file.rows]
    if rng is not None:
        drawn = from_kmh(rng.uniform(min(known), max(known)))
        return drawn, drawn
    try:
        start, end = (speed_kmh, speed_kmh) if isinstance(speed_kmh, (int, float)) else speed_kmh
        start, end = float(start), float(end)
    except (TypeError, ValueError) as wrong:
        raise InputError("speed_kmh", f"{speed_kmh!r} is not a speed", "give km/h, or (start, end) in km/h") from wrong
    for value in (start, end):
        if not 2.0 <= value <= 400.0:
            raise InputError("speed_kmh", f"{value:g} km/h is out of range", "give 2 to 400 km/h")
    return from_kmh(start), from_kmh(end)


def _randomised_names(randomise: str | Iterable[str]) -> tuple[str, ...]:
    names = (randomise,) if isinstance(randomise, str) else tuple(randomise)
    if names == ("all",):
        return RANDOMISABLE
    for name in names:
        if name not in RANDOMISABLE:
            raise InputError("randomise", f"{name!r} is not known", f"use 'all' or names out of {RANDOMISABLE}")
    return names


def random_car(rng: np.random.Generator) -> CarSpread:
    """A car that is not quite the one that the reference was identified on."""
    return CarSpread(**{name: rng.uniform(*span) for name, span in CAR_FACTORS.items()})


def random_driver(rng: np.random.Generator) -> Driver:
    """A blend of two arms of the grid."""
    first, second = rng.choice(len(RANDOM_ARMS), 2, replace=True)
    share = rng.uniform()
    a, b = DRIVERS[RANDOM_ARMS[first]], DRIVERS[RANDOM_ARMS[second]]
    return Driver(*(x + share * (y - x) for x, y in zip(a, b, strict=True)))


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
