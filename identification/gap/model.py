"""What the gap workflow asks of a kind of campaign: records, nominal unknowns, a simulation and a catalogue.

A model predicts the measured output channels of a record from its measured inputs, for any values of the nominal
unknowns and any set of effects. Everything else (fits, noise, screening, verdict) is the same for all kinds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from identification.frf import Floats
from steer_env.physics.effects import Effect

Values = Mapping[str, float]
Present = Mapping[str, Mapping[str, float]]
"""Effects that are on: name -> parameter -> value."""


class Unknown(NamedTuple):
    """One nominal parameter of the model.

    ``group``: label of the records that it matters to (a speed in km/h), None: all. ``log``: searched and judged on a
    log scale. ``prior``: standard deviation around ``start`` of what is believed beforehand, on that scale.
    """

    name: str
    start: float
    low: float
    high: float
    prior: float
    log: bool = True
    group: float | None = None


@dataclass(frozen=True)
class Record:
    """One run, or the mean of ``repeats`` runs that were driven alike.

    ``inputs`` and ``outputs``: channels [n] in SI by the contract's names. ``keep``: samples that are judged.
    ``group`` labels what shares nominal unknowns (the speed in km/h). ``repeats``: the outputs [n] of each run in it.
    ``role``: "identify" (fitted) or "validate" (held out).
    """

    name: str
    manoeuvre: str
    group: float
    speed: float
    dt: float
    inputs: Mapping[str, Floats]
    outputs: Mapping[str, Floats]
    keep: slice
    role: str
    repeats: tuple[Mapping[str, Floats], ...] = field(default=())


class Model(Protocol):
    """A kind of campaign, ready to be simulated."""

    records: tuple[Record, ...]
    unknowns: tuple[Unknown, ...]
    effects: Mapping[str, Effect]  # the candidates that the channels at hand allow
    channels: tuple[str, ...]  # output channels, in the order of plots
    band_Hz: float  # outputs are judged up to this frequency

    def simulate(self, record: Record, values: Values, present: Present) -> Mapping[str, Floats]:
        """Predicted output channels [n] of a record, measurement errors of ``present`` included."""

    def judged(self, outputs: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """Fixed linear combinations of output channels in which errors are judged, from measured or predicted ones.

        Two sensors of one quantity are better judged by their difference, in which what disturbs both is gone.
        """

    def states(self, record: Record) -> Mapping[str, Floats]:
        """Measured quantities [n] against which symptoms are looked for: angle, rate, torque, lateral acceleration."""


def sliding(rate: Floats, rest: float) -> Floats:
    """Weight [n] from 0 up to ``rest`` in rad/s to 1 in motion: what friction holds at rest no motion can tell."""
    weight: Floats = np.clip(np.abs(rate) / rest - 1.0, 0.0, 1.0)
    return weight
