"""What to drive next: the manoeuvre and speed at which two explanations differ most, in noise units.

Both explanations are simulated, each with its own fitted parameters, through drives that a steering robot can make;
their difference is weighed by the noise of the campaign's sensors and by the model error that both leave.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from identification.frf import Floats
from identification.gap.basis import band_of, spread_power
from identification.gap.fit import Judge, present_of
from identification.gap.model import Record
from identification.gap.search import LEAST_ERROR, Candidate
from steer_env.units import from_kmh, to_kmh

SPEEDS_KMH = (10.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0)
PERIOD = 0.01  # s
GRIP = 4.0  # m/s2, lateral acceleration that an ordinary driver does not exceed
WIDEST = 6.0  # rad, steering-wheel angle of a turn of one hand


class Advice(NamedTuple):
    """A drive, and by how many standard deviations of noise and model error two explanations differ in it."""

    manoeuvre: str
    speed_kmh: float
    separation: float


def drives(speed: float, wheelbase: float, ratio: float) -> dict[str, Floats]:
    """Steering angles in rad over 20 s of robot manoeuvres at a speed in m/s."""
    t = np.arange(0.0, 20.0, PERIOD)
    turn = min(WIDEST, GRIP * ratio * (wheelbase + 0.003 * speed**2) / speed**2)
    sweep = min(0.6 * turn, 0.5)
    phase = 2.0 * np.pi * (0.2 * t + 0.5 * (4.8 / 17.5) * np.minimum(t, 17.5) ** 2)
    return {
        "steady_state": turn * np.sin(2.0 * np.pi * 0.2 * t),
        "on_centre_weave": 0.15 * turn * np.sin(2.0 * np.pi * 0.2 * t),
        "constant_speed_cornering": 1.1 * turn * np.sin(2.0 * np.pi * 0.05 * t),
        "frequency_response": sweep * np.sin(phase) * (t < 17.5),
        "step_steer": 0.5 * turn * np.clip((t % 6.0 - 1.0) / 0.1, 0.0, 1.0) * np.where(t % 12.0 < 6.0, 1.0, -1.0),
    }


def next_measurement(judge: Judge, one: Candidate, other: Candidate, geometry: tuple[float, float]) -> Advice:
    """The drive that tells ``one`` from ``other`` best; ``geometry`` is (wheelbase in m, steering ratio)."""
    known = sorted({record.group for record in judge.records})
    best = Advice("", 0.0, -1.0)
    for speed_kmh in SPEEDS_KMH:
        group = min(known, key=lambda v: abs(v - speed_kmh))  # what is scheduled over speed: from the nearest one known
        for manoeuvre, angle in drives(from_kmh(speed_kmh), *geometry).items():
            record = _record(judge, manoeuvre, group, from_kmh(speed_kmh), angle)
            separation = _separation(judge, record, one, other)
            if separation > best.separation:
                best = Advice(manoeuvre, speed_kmh, separation)
    return best


def _record(judge: Judge, manoeuvre: str, group: float, speed: float, angle: Floats) -> Record:
    outputs = {name: np.zeros(angle.size) for name in judge.model.channels}
    lead = next(iter(judge.records[0].inputs))
    name = f"{manoeuvre} at {to_kmh(speed):g} km/h"
    keep = slice(round(1.5 / PERIOD), angle.size)
    return Record(name, manoeuvre, group, speed, PERIOD, {lead: angle}, outputs, keep, "planned", (outputs,))


def _separation(judge: Judge, record: Record, one: Candidate, other: Candidate) -> float:
    band = band_of(record, judge.model.band_Hz)

    def predicted(values: Mapping[str, float]) -> Floats:
        return band.of(judge.model.judged(judge.model.simulate(record, values, present_of(values))), judge.names)

    first, second = predicted(one.solution.values), predicted(other.solution.values)
    error = np.maximum(one.error, LEAST_ERROR)
    variance = judge.allowed(judge.noise.at(record, band.frequency), spread_power(first, band.frequency), band, error)
    return float(np.sqrt(np.nansum((first - second) ** 2 / variance)))
