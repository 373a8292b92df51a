"""What a row of METRICS says about itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from experiments.metrics_trial import Trial

ANY: tuple[str, ...] = ()
CHIRP = ("frequency_response",)
FAST_CHIRP = ("high_frequency_response",)
SWEEPS = ("frequency_response", "random_torque")
SINES = ("steady_state", "on_centre_weave")
RAMP = ("constant_speed_cornering",)  # the sines of the scored cases are too fast: the car answers late in them
RELEASE = ("release",)


class Metric(NamedTuple):
    """Unit, meaning, the manoeuvres it needs (none: any), its function, which way is better.

    ``better`` is "lower", "higher", "reference" (as near as can be to the row of the same name with ``_reference``), or
    "" for a row that is such a reference itself.
    """

    unit: str
    meaning: str
    manoeuvres: tuple[str, ...]
    measure: Callable[[Trial], float]
    better: str = "lower"


def pair(
    name: str, unit: str, meaning: str, manoeuvres: tuple[str, ...], measure: Callable[[Trial, bool], float]
) -> dict[str, Metric]:
    """Two rows, achieved and of the reference, from a function of (trial, of_ideal)."""
    return {
        name: Metric(unit, meaning, manoeuvres, lambda t: measure(t, False), "reference"),
        f"{name}_reference": Metric(unit, f"of the reference: {meaning}", manoeuvres, lambda t: measure(t, True), ""),
    }
