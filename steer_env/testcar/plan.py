"""What is driven: the paper's manoeuvres at each speed.

Amplitudes are found as on a proving ground: a trial run of the 0.2 Hz sine, then corrected for the
lateral acceleration that came out. The sweep goes to 5 Hz, so its amplitude is also held below the
robot's rate limit.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.manoeuvres import MANOEUVRES
from steer_env.testcar.kernel import PERIOD, RECORD, machine_at, rollout
from steer_env.testcar.parameters import VirtualCar
from steer_env.units import from_kmh

SPEEDS_KMH = (105.0, 90.0, 75.0, 60.0, 45.0, 30.0, 15.0)  # Tables 2 and 3
# Lateral acceleration in m/s2 at 0.2 Hz (paper, section 2: 3-4; less where the wheel angle would
# grow too large).
TARGET_SPEED_KMH = (15.0, 30.0, 45.0, 60.0)
TARGET_ACCELERATION = (1.5, 2.5, 3.0, 3.5)
CORNERING_SHARE = 1.1  # slow cornering goes this much beyond the sine's amplitude
SINE_REPEATS = 3
TAIL = 1.0  # s after the sweep has faded out
# s in which the robot lets the sweep's last frequency die away: it cannot stop the wheel at once.
FADE = 0.4
TRIALS = 3
TRIAL_TIME = 8.0  # s: the second half of it holds both peaks of the sine

Array = NDArray[np.floating]


class PlannedRun(NamedTuple):
    """One run: speed in km/h, manoeuvre, running number from 1, wheel-angle amplitude in rad."""

    speed_kmh: float
    manoeuvre: str
    number: int
    amplitude: float

    @property
    def name(self) -> str:
        """File name without ending."""
        speed = f"{self.speed_kmh:g}".replace(".", "p").zfill(3)
        return f"{speed}_{self.manoeuvre}_{self.number}"


def robot_target(manoeuvre: str, amplitude: float) -> tuple[Array, Array]:
    """Wheel angle in rad and rate in rad/s [n] at the robot's period that a manoeuvre asks for."""
    angle, rate = _unit_target(manoeuvre)
    return amplitude * angle, amplitude * rate


@cache
def _unit_target(manoeuvre: str) -> tuple[Array, Array]:
    """Angle and rate of an amplitude of 1 rad: every manoeuvre here scales with its amplitude."""
    row = MANOEUVRES[manoeuvre]
    p = row.parameters._replace(amplitude=1.0)
    swept = manoeuvre == "frequency_response"
    end = p.lead_in + p.duration
    t = np.arange(round((end + (TAIL if swept else 0.0)) / PERIOD)) * PERIOD
    hands = [row.signal(time, p) for time in t]
    angle, rate = np.array([h.angle for h in hands]), np.array([h.rate for h in hands])
    if swept:
        _fade_out(angle, rate, t - end, p.frequency_end)
    return angle, rate


def _fade_out(angle: Array, rate: Array, after: Array, frequency: float) -> None:
    """Continue a sweep that ends in a zero crossing: its last frequency dies away in FADE s."""
    here = (after > -0.5 * PERIOD) & (
        after < FADE
    )  # the first sample may lie a rounding error before the end
    s, omega = after[here], 2.0 * math.pi * frequency
    fade = 0.5 + 0.5 * np.cos(math.pi * s / FADE)
    slope = -0.5 * math.pi / FADE * np.sin(math.pi * s / FADE)
    sign = np.sign(rate[np.flatnonzero(here)[0] - 1])
    angle[here] = sign * fade * np.sin(omega * s)
    rate[here] = sign * (fade * omega * np.cos(omega * s) + slope * np.sin(omega * s))


def sine_amplitude(speed_kmh: float, car: VirtualCar) -> float:
    """Amplitude in rad of the 0.2 Hz sine that gives the target acceleration, by trial runs."""
    wanted = float(np.interp(speed_kmh, TARGET_SPEED_KMH, TARGET_ACCELERATION))
    speed = from_kmh(speed_kmh)
    wheelbase = car.vehicle.l_f + car.vehicle.l_r
    amplitude = wanted * car.vehicle.i_s * (wheelbase + 0.003 * speed * speed) / (speed * speed)
    machine = machine_at(speed, car)
    for _ in range(TRIALS):
        angle, rate = (
            part[: round(TRIAL_TIME / PERIOD)] for part in robot_target("steady_state", amplitude)
        )
        quiet = np.zeros_like(angle)
        record = rollout(angle, rate, quiet, quiet, speed, machine)
        settled = record[len(record) // 2 :, RECORD.index("lateral_acceleration")]
        amplitude *= wanted / float(0.5 * np.ptp(settled))
    return amplitude


def runs_at(speed_kmh: float, repeats: int, car: VirtualCar) -> list[PlannedRun]:
    """All runs at one speed: ``repeats`` sweeps, SINE_REPEATS sines, one slow cornering run."""
    amplitude = sine_amplitude(speed_kmh, car)
    fastest = 2.0 * math.pi * MANOEUVRES["frequency_response"].parameters.frequency_end
    sweep = min(amplitude, car.robot.rate_limit / fastest)
    runs = [PlannedRun(speed_kmh, "frequency_response", k + 1, sweep) for k in range(repeats)]
    runs += [PlannedRun(speed_kmh, "steady_state", k + 1, amplitude) for k in range(SINE_REPEATS)]
    return [
        *runs,
        PlannedRun(speed_kmh, "constant_speed_cornering", 1, CORNERING_SHARE * amplitude),
    ]
