"""One episode made ready for its metrics: what is compared with what, each intermediate result made once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from experiments import measures, metrics_ideal
from experiments.measures import Array, Complexes, ResponseError
from experiments.measures_free import FreeControl, free_control
from experiments.measures_loop import Loop, indices
from experiments.rollout import Episode
from identification import frf
from identification.frf import FrequencyResponse
from steer_env.envs.layout import PERIOD
from steer_env.manoeuvres.release import HOLD_TIME
from steer_env.physics import linear
from steer_env.units import GRAVITY

BAND_HZ = (0.2, 5.0)  # FRF scores
FAST_BAND_HZ = (5.0, 30.0)  # what is felt beyond the fastest steering, where a manoeuvre excites it
FAST_LINES_HZ = (4.9, 30.1)  # and a little to either side, as the slow band's lines have it
REQUIRED_BAND_HZ = (0.2, 4.0)  # where 1.5 dB and 10 deg against the linear reference are asked for
RIPPLE_HZ = 20.0  # what moves faster is ripple, not steering
EDGE_S = 0.1  # two periods of that: what a filter needs at the ends of a record
LOOP_HZ = 5.0  # what a 0.2 Hz loop keeps of its signals: noise would move its crossings
LOOP_STEP = 2  # and then every second sample says the same in half the time


class Compared(NamedTuple):
    """Achieved and wanted response (complex, [n]) at frequency [n] in Hz."""

    frequency: Array
    achieved: Complexes
    wanted: Complexes


NOTHING = Compared(np.zeros(0), np.zeros(0, complex), np.zeros(0, complex))


@dataclass(frozen=True)
class Trial:
    """One episode and what it has to be compared with.

    ``achieved`` and ``ideal`` follow the causality. ``felt`` does not: it is the torque that belongs to the true motion
    in either, so that an impedance and an admittance controller can be held against each other.
    """

    episode: Episode
    causality: str
    linear: bool
    manoeuvre: str

    @cached_property
    def achieved(self) -> tuple[Array, Array]:
        """(Pinion angle [n] rad, torsion-bar torque [n] N m) as they were."""
        return self.episode["pinion_angle"], self.episode["torsion_bar_torque"]

    @cached_property
    def ideal(self) -> tuple[Array, Array]:
        """The same, but the one that is tracked replaced by its ideal."""
        angle, torque = self.achieved
        wanted = self.episode["reference"]
        return (angle, wanted) if self.causality == "impedance" else (wanted, torque)

    @cached_property
    def ideal_acceleration(self) -> Array:
        """Lateral acceleration [n] in m/s2 of the same car at the ideal angle."""
        if self.causality == "impedance":
            return self.episode["lateral_acceleration"]
        return metrics_ideal.car_acceleration(self.episode, self.episode["reference"])

    @cached_property
    def felt(self) -> Array:
        """Torsion-bar torque [n] in N m of the reference at the true pinion motion, whatever the causality."""
        if self.causality == "impedance":
            return self.episode["reference"]
        return metrics_ideal.ideal_torque(self.episode)

    @cached_property
    def response(self) -> FrequencyResponse:
        """Achieved angle over torque."""
        return response(self.episode["steering_torque"], *self.achieved)

    @cached_property
    def reference_response(self) -> Complexes:
        """Reference at the points of ``response``: Eq. 10 if linear, else from the same run."""
        return self._wanted(self.response, frf.BAND_HZ)

    def _wanted(self, achieved: FrequencyResponse, lines: tuple[float, float]) -> Complexes:
        if not self.linear:
            same = response(self.episode["steering_torque"], *self.ideal, lines)
            return same.all_value[achieved.point]
        return achieved.average(analytic_response(self.episode, achieved.line_frequency))

    @property
    def excited(self) -> tuple[float, float]:
        """Band in Hz that the hand moves or pushes in.

        Outside of it only noise and harmonics move the wheel. Torque over angle is then the arm's impedance, with a
        high coherence, and says nothing about the controller.
        """
        p = self.episode.part("manoeuvre")
        return p.frequency, p.frequency_end

    @cached_property
    def slow_response(self) -> Compared:
        """Inside BAND_HZ, as far as the manoeuvre excites it."""
        return self._compared(self.response, self.reference_response, BAND_HZ)

    @cached_property
    def fast_response(self) -> Compared:
        """Inside FAST_BAND_HZ, as far as the manoeuvre excites it: nothing for one that ends at 5 Hz."""
        if self.excited[1] <= FAST_BAND_HZ[0]:
            return NOTHING
        achieved = response(self.episode["steering_torque"], *self.achieved, FAST_LINES_HZ)
        return self._compared(achieved, self._wanted(achieved, FAST_LINES_HZ), FAST_BAND_HZ)

    def _compared(self, H: FrequencyResponse, wanted: Complexes, band: tuple[float, float]) -> Compared:
        low, high = max(band[0], self.excited[0]), min(band[1], self.excited[1])
        inside = (H.frequency >= low) & (H.frequency <= high)
        return Compared(H.frequency[inside], H.value[inside], wanted[inside])

    def error(self, band: tuple[float, float]) -> ResponseError:
        """Error of the response inside a band in Hz."""
        return measures.response_error(*self.slow_response, band)

    @cached_property
    def _cycles(self) -> tuple[slice, int]:
        """(Samples of the whole cycles of a sine after its first, how many they are)."""
        p = self.episode.part("manoeuvre")
        start = round((p.lead_in + 1.0 / p.frequency) / PERIOD)
        seconds = min(p.duration - 1.0 / p.frequency, (len(self.episode.signals) - start) * PERIOD)
        cycles = max(int(seconds * p.frequency + 1e-6), 0)
        return slice(start, start + round(cycles / p.frequency / PERIOD)), cycles

    def loop(self, of_ideal: bool) -> tuple[Array, Array]:
        """(Angle, torque) of a sine manoeuvre after its first cycle."""
        part, _ = self._cycles
        angle, torque = self.ideal if of_ideal else self.achieved
        return angle[part], torque[part]

    @cached_property
    def achieved_loop(self) -> Loop:
        """What the driver went through in the whole cycles of a sine, without what is faster than LOOP_HZ."""
        angle, torque = self.achieved
        return Loop(
            self._smooth(angle), self._smooth(torque), self._smooth(self.episode["lateral_acceleration"]) / GRAVITY,
            self._cycles[1],
        )  # fmt: skip

    @cached_property
    def ideal_loop(self) -> Loop:
        """The same with the tracked signal replaced by its ideal; the car follows the ideal angle."""
        wanted = self._smooth(self.episode["reference"])
        if self.causality == "impedance":
            return replace(self.achieved_loop, torque=wanted)
        return replace(self.achieved_loop, angle=wanted, acceleration=self._smooth(self.ideal_acceleration) / GRAVITY)

    def _smooth(self, signal: Array) -> Array:
        part, _ = self._cycles
        return measures.low_passed(signal, LOOP_HZ, PERIOD)[part][::LOOP_STEP]

    @cached_property
    def achieved_indices(self) -> dict[str, float]:
        """Indices of the achieved loop by name."""
        return indices(self.achieved_loop)

    @cached_property
    def ideal_indices(self) -> dict[str, float]:
        """Indices of the ideal loop by name."""
        return indices(self.ideal_loop)

    @cached_property
    def released(self) -> int:
        """Last sample at which the driver holds the wheel: the very last, but for the release manoeuvre."""
        last = len(self.episode.signals) - 1
        if self.manoeuvre != "release":
            return last
        return min(round((self.episode.part("manoeuvre").lead_in + HOLD_TIME) / PERIOD) - 1, last)

    @cached_property
    def held(self) -> slice:
        """Samples in which the driver steers, without EDGE_S at either end.

        A hand that sets off, stops or lets go at once is a jump in his torque of his own making.
        """
        p = self.episode.part("manoeuvre")
        end = min(p.lead_in + p.duration, (self.released + 1) * PERIOD)
        return slice(round((p.lead_in + EDGE_S) / PERIOD), round((end - EDGE_S) / PERIOD))

    @cached_property
    def free(self) -> FreeControl:
        """What the wheel did after the release."""
        return free_control(self.episode["steering_angle"], self.episode["yaw_rate"], self.released, PERIOD)

    @cached_property
    def ideal_free(self) -> FreeControl:
        """What the same wheel and torsion bar would have done on the reference."""
        driven = metrics_ideal.ideal_drive(self.episode)
        return free_control(driven["steering_angle"], driven["yaw_rate"], self.released, PERIOD)

    @cached_property
    def ripple(self) -> Array:
        """Torsion-bar torque [n] in N m above RIPPLE_HZ, without the two ends, where the filter still settles."""
        edge = round(EDGE_S / PERIOD)
        return measures.high_passed(self.episode["torsion_bar_torque"], RIPPLE_HZ, PERIOD)[edge:-edge]


@dataclass
class _Recording:
    dt: float
    channels: dict[str, Array]


def response(
    instrument: Array, angle: Array, torque: Array, lines: tuple[float, float] = frf.BAND_HZ
) -> FrequencyResponse:
    """Angle over torque in rad/(N m) by Eq. 5 from the lines in a band in Hz, the wheel torque as instrument.

    Only points with gamma^2 > 0.72 are kept.
    """
    channels = {
        "steering_torque_Nm": instrument,
        "torsion_bar_torque_Nm": torque,
        "pinion_angle_rad": angle,
    }
    data = frf.spectra([_Recording(PERIOD, channels)], list(channels), lines)
    with np.errstate(divide="ignore", invalid="ignore"):  # 0 / 0 where a hand does nothing: no coherence, not kept
        return frf.frequency_response(
            data, "steering_torque_Nm", "torsion_bar_torque_Nm", "pinion_angle_rad", "angle / torque"
        )


def analytic_response(episode: Episode, frequency_Hz: Array) -> Complexes:
    """Eq. 10 from torsion-bar torque to pinion angle in rad/(N m), any shape of frequencies."""
    speed = float(episode["speed"][0])
    p = episode.setup.reference.at(speed)
    matrices = linear.reference_matrices(speed, p, 1.0 + p.k_gain)
    values = linear.frequency_response(matrices, frequency_Hz.ravel())[:, 0, 0]
    return values.reshape(frequency_Hz.shape)
