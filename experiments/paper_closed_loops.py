"""PID on both plants at 75 km/h, as in the paper's Figures 9 to 11: how close it comes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import controllers
from experiments import measures, metrics, rollout
from experiments.measures import Array
from identification.frf import FrequencyResponse
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.plants import PLANTS, Reference
from steer_env.units import to_deg

SPEED_KMH = 75.0
CONTROLLER = "pid"
DRIVER = "robot"
SLOW_HZ = 5.0
CAUSALITIES = ("impedance", "admittance")


class ClosedLoop(NamedTuple):
    """One plant and causality: sweep (angle and rate per torque) and, where complete, slow sine.

    ``worst`` is (dB, deg) against the reference over 0.2 to 4 Hz; ``loop`` and ``ideal`` are pinion
    angle in rad and torsion-bar torque in N m.
    """

    plant: str
    causality: str
    linear: bool
    stable: bool
    angle: FrequencyResponse
    rate: FrequencyResponse
    worst: tuple[float, float]
    loop: tuple[Array, Array] | None
    ideal: tuple[Array, Array] | None

    @property
    def name(self) -> str:
        """How a legend calls it."""
        return f"{self.plant}, {self.causality}"

    def half_widths(self) -> tuple[float, float]:
        """Half width of the hysteresis at zero torque in deg: achieved, of the reference."""
        if self.loop is None or self.ideal is None:
            return float("nan"), float("nan")
        achieved, ideal = (
            measures.half_width(_slow(torque), _slow(angle)) for angle, torque in (self.loop, self.ideal)
        )
        return to_deg(achieved), to_deg(ideal)


def _slow(signal: Array) -> Array:
    """A loop's signal without what is faster than SLOW_HZ: an ideal torque passes zero noisily."""
    return signal - measures.high_passed(signal, SLOW_HZ, PERIOD)


def closed_loops(seed: int) -> list[ClosedLoop]:
    """EPAS without friction and assist (Figure 9), EPAS and SbW complete (Figures 10 and 11)."""
    cases = [("EPAS", True), ("EPAS", False), ("SbW", False)]
    return [_closed_loop(plant, c, plain, seed) for plant, plain in cases for c in CAUSALITIES]


def _closed_loop(plant: str, causality: str, plain: bool, seed: int) -> ClosedLoop:
    trial = _trial(plant, causality, plain, "frequency_response", seed)
    episode = trial.episode
    torque = episode["torsion_bar_torque"]
    error = trial.error(metrics.REQUIRED_BAND_HZ)
    worst = (float(np.abs(error.magnitude).max()), float(np.abs(error.phase).max()))
    slow = None if plain else _trial(plant, causality, plain, "steady_state", seed)
    return ClosedLoop(
        plant,
        causality,
        plain,
        episode.stable and (slow is None or slow.episode.stable),
        trial.response,
        metrics.response(episode["steering_torque"], episode["pinion_rate"], torque),
        worst,
        None if slow is None else slow.loop(of_ideal=False),
        None if slow is None else slow.loop(of_ideal=True),
    )


def _trial(plant: str, causality: str, plain: bool, manoeuvre: str, seed: int) -> metrics.Trial:
    reference = Reference(linear=plain)
    task = Task(
        plant=plant,
        causality=causality,
        reference=reference,
        linear=plain,
        manoeuvre=manoeuvre,
        speed_kmh=SPEED_KMH,
        driver=DRIVER,
    )
    controller = controllers.make(CONTROLLER, PLANTS[plant], reference, causality)
    episode = rollout.run(task, controller, seed)
    return metrics.Trial(episode, causality, plain, manoeuvre)
