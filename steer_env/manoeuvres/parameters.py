"""The numbers that shape a manoeuvre."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.units import Quantity

_P = "paper, section 2"


class ManoeuvreParameters(NamedTuple):
    """Amplitude of hand angle (rad) or driver torque (N m), frequencies, times, phase."""

    amplitude: Annotated[
        float, Quantity("rad or N m", "amplitude", -20.0, 20.0, "for 3-4 m/s2 at 0.2 Hz")
    ] = 0.38
    frequency: Annotated[float, Quantity("Hz", "frequency at the start", 0.001, 50.0, _P)] = 0.2
    frequency_end: Annotated[float, Quantity("Hz", "frequency at the end", 0.001, 50.0, _P)] = 5.0
    lead_in: Annotated[float, Quantity("s", "quiet time before", 0.0, 60.0, "assumption")] = 0.5
    duration: Annotated[float, Quantity("s", "length after the lead-in", 0.05, 3600.0, _P)] = 17.5
    phase: Annotated[
        float, Quantity("rad", "phase (random_torque: picks the tones' phases)", -1e4, 1e4, "-")
    ] = 0.0
