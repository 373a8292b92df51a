"""Where the acceleration of an impedance loop should come from: observer or plain filter, and how fast.

    python -m experiments.acceleration_study

In impedance the reference torque holds J_ref times the measured acceleration. The control unit's
observer finds it from the measured and the motor's torque (``known``), or the same third-order filter
tracks the angle alone (``plain``: the filtered second difference). Each is tried at several bandwidths
on both plants with several controllers: noise of the acceleration, tracking, ripple, and whether the
linear proof (experiments.robustness, every arm and operating point of that speed) calls it safe.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import controllers
from experiments.metrics import Trial, score
from experiments.robustness import assess, safe
from experiments.rollout import run
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.physics.sensors import Observer, ObserverState, Sensors, measured, observer_step
from steer_env.plants import PLANTS, Plant, Reference

BANDWIDTHS_HZ = (10.0, 20.0, 40.0, 80.0, 160.0)
KINDS = {"known": 1.0, "plain": 0.0}
NAMES = ("open_loop_map", "pid", "lead", "super_twisting")
SPEED_KMH, DRIVER, MANOEUVRE = 75.0, "relaxed", "frequency_response"
NOISE_PERIODS = 20000
DIED_AWAY = 2000  # periods after which no response is left
SWING_RAD, SWING_NM = 1.0, 6.0  # of the slow sine on which noise is measured
Array = NDArray[np.float64]


class Result(NamedTuple):
    """One loop; scores are not finite where it was thrown. ``growth`` is its fastest mode's in 1/s."""

    plant: str
    controller: str
    kind: str
    bandwidth_Hz: float
    frf_complex: float
    tracking_relative: float
    ripple: float
    growth: float
    safe: bool


def plant_with(plant: Plant, kind: str, bandwidth_Hz: float) -> Plant:
    """The plant with another source of acceleration; controllers are made for it."""
    return replace(plant, observer_bandwidth_Hz=bandwidth_Hz, observer_known_inputs=KINDS[kind])


def rms_gain(response: Array) -> float:
    """Rms of the output per rms of white noise at the input, from an impulse response [n] that has died away."""
    return float(np.sqrt(np.sum(response * response)))


def impulse_responses(observer: Observer) -> tuple[Array, Array]:
    """Acceleration after a unit impulse in one sample of the angle (rad) and of the torque (N m), [n] each."""
    responses = []
    for impulse in ((1.0, 0.0), (0.0, 1.0)):
        x, response = ObserverState(0.0, 0.0, 0.0), []
        for k in range(DIED_AWAY):
            angle, torque = impulse if k == 0 else (0.0, 0.0)
            acceleration, x = observer_step(x, angle, torque, 0.0, observer, PERIOD)
            response.append(acceleration)
        responses.append(np.array(response))
    return responses[0], responses[1]


def noise_gains(observer: Observer) -> tuple[float, float]:
    """Acceleration's rms per rms of white angle noise (rad/s2 per rad) and torque noise (per N m)."""
    angle, torque = impulse_responses(observer)
    return rms_gain(angle), rms_gain(torque)


def plain_gain(bandwidth_Hz: float) -> float:
    """The plain filter's gain on angle noise in closed form (physics/sensors.py); sqrt(6) / dt^2 without any filter."""
    z = math.exp(-2.0 * math.pi * bandwidth_Hz * PERIOD)
    share: float = (1.0 - z) / (1.0 + z)
    return math.sqrt(6.0) * share**2.5 / (PERIOD * PERIOD)


def expected_noise(sensors: Sensors, observer: Observer) -> float:
    """Rms of the acceleration in rad/s2: both noises white, a step of resolution as step / sqrt(12)."""
    angle, torque = noise_gains(observer)
    angle *= math.hypot(sensors.angle_noise, sensors.angle_step / math.sqrt(12.0))
    torque *= math.hypot(sensors.torque_noise, sensors.torque_step / math.sqrt(12.0))
    return math.hypot(angle, torque)


def measured_noise(sensors: Sensors, observer: Observer, seed: int = 0) -> float:
    """The same from sensors that round, on a slow sine of angle and torque, so that their steps are crossed."""
    draws = np.random.default_rng(seed).standard_normal((NOISE_PERIODS, 2))
    w = 2.0 * math.pi / (NOISE_PERIODS * PERIOD)
    x, found = ObserverState(0.0, w * SWING_RAD, 0.0), []
    for k, (first, second) in enumerate(draws.tolist()):
        sine, cosine = math.sin(w * k * PERIOD), math.cos(w * k * PERIOD)
        angle = measured(SWING_RAD * sine, sensors.angle_step, sensors.angle_noise, first)
        torque = measured(SWING_NM * sine, sensors.torque_step, sensors.torque_noise, second)
        # What the motor gives is known and moves the body just so: only noise is left over.
        true = -w * w * SWING_RAD * sine
        motor = (observer.J * true + observer.b * w * SWING_RAD * cosine - SWING_NM * sine) / observer.motor_ratio
        acceleration, x = observer_step(x, angle, torque, motor, observer, PERIOD)
        found.append(acceleration - true)
    return float(np.std(found[NOISE_PERIODS // 10 :]))


def result(plant: str, name: str, kind: str, bandwidth_Hz: float, reference: Reference) -> Result:
    """Drive one loop and look at its linear models."""
    made_for = plant_with(PLANTS[plant], kind, bandwidth_Hz)
    make = partial(controllers.make, name)
    gate = safe(assess(make, made_for, "impedance", reference, (SPEED_KMH,)))
    task = Task(made_for, "impedance", reference, manoeuvre=MANOEUVRE, speed_kmh=SPEED_KMH, driver=DRIVER)
    episode = run(task, make(made_for, reference, "impedance"), 1, 1.0)
    scores = score(Trial(episode, "impedance", False, MANOEUVRE)) if episode.stable else {}
    frf, tracking, ripple = (scores.get(key, math.nan) for key in ("frf_complex", "tracking_relative", "ripple"))
    return Result(plant, name, kind, bandwidth_Hz, frf, tracking, ripple, gate.growth, gate.safe)


def study(reference: Reference, names: Iterable[str] = NAMES) -> list[Result]:
    """Every plant, controller, kind and bandwidth."""
    return [result(*case, reference) for case in product(PLANTS, names, KINDS, BANDWIDTHS_HZ)]


def best(results: Sequence[Result], plant: str, controller: str) -> Result | None:
    """The smallest error of the frequency response among those that are safe; None without any."""
    chosen = [r for r in results if (r.plant, r.controller) == (plant, controller) and r.safe]
    finite = [r for r in chosen if math.isfinite(r.frf_complex)]
    return min(finite, key=lambda r: r.frf_complex, default=None)


def noise_table() -> Table:
    """Noise of the acceleration, and of the inertial torque that it makes."""
    table = Table(title="Noise of the acceleration / (rad/s2) rms")
    for name in ("plant", "source", "bandwidth / Hz", "closed form", "measured", "J_ref times that / N m"):
        table.add_column(name, justify="left" if name in ("plant", "source") else "right", no_wrap=True)
    J_ref = Reference.load("published").at(SPEED_KMH / 3.6).J_ref
    for plant, kind, bandwidth in product(PLANTS.values(), KINDS, BANDWIDTHS_HZ):
        observer = plant_with(plant, kind, bandwidth).observer()
        expected = expected_noise(plant.sensors, observer)
        found = measured_noise(plant.sensors, observer)
        table.add_row(plant.name, kind, f"{bandwidth:g}", f"{expected:.3g}", f"{found:.3g}", f"{J_ref * expected:.2g}")
    return table


def score_table(results: Sequence[Result]) -> Table:
    """One row per loop; an asterisk marks the best of a plant and controller."""
    table = Table(title=f"Impedance, chirp at {SPEED_KMH:g} km/h, {DRIVER} arm; * best FRF among the safe")
    columns = ("frf_complex", "tracking_relative", "ripple / N m", "growth / (1/s)", "safe")
    for name in ("plant", "controller", "source", "bandwidth / Hz", *columns):
        left = name in ("plant", "controller", "source", "safe")
        table.add_column(name, justify="left" if left else "right", no_wrap=True)
    for r in results:
        mark = " *" if r == best(results, r.plant, r.controller) else ""
        numbers = [f"{v:.3f}" for v in (r.frf_complex, r.tracking_relative, r.ripple)]
        safety = ("yes" if r.safe else "no") + mark
        table.add_row(r.plant, r.controller, r.kind, f"{r.bandwidth_Hz:g}", *numbers, f"{r.growth:.1f}", safety)
    return table


if __name__ == "__main__":
    console = Console(width=140)
    console.print(noise_table())
    console.print(score_table(study(Reference.load("published"))))
