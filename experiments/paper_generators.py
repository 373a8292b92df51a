"""The two reference generators of Fig. 2 on their own: driven, and measured as a plant would be.

The impedance generator is driven by a motion, the admittance generator by a torque. Both get the
paper's sweep (0.2 to 5 Hz in 17.5 s), but with a soft start and end: a motion whose rate jumps
would ask the impedance generator for an impulse of torque. It runs on to END_HZ at the same pace,
because friction answers the fading amplitude at its end, which is no property of 5 Hz.

Friction and assist answer a sweep with odd harmonics, which fall on frequencies that the sweep
reaches later. Sweeps are therefore joined over four starting phases, an eighth of a turn apart:
there the third, fifth and seventh cancel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from experiments.measures import Array, response_error
from identification.frf import FrequencyResponse, frequency_response, spectra
from steer_env.envs.layout import PERIOD
from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics import linear
from steer_env.physics._jit import compiled
from steer_env.physics.reference import (
    ReferenceParameters,
    ReferenceState,
    admittance_step,
    impedance_step,
)
from steer_env.plants.amplitude import paper_acceleration, steering_amplitude

BAND_HZ = (0.2, 5.0)
END_HZ = 6.5
RISE = 4.0  # s in which the amplitude rises at the first frequency
HOLD = 5.0  # s at the first frequency: one period
FADE = 0.6  # s of the last frequency that die away
REST = 4.0  # s after it, so that the slowest mode of the published rows has died away too
PHASES = tuple(np.pi / 4.0 * k for k in range(4))  # rad
SINE_HZ = 0.2
SINE_CYCLES = 3
AT_REST = ReferenceState(*[0.0] * len(ReferenceState._fields))


class Motion(NamedTuple):
    """Pinion angle in rad, rate and acceleration [n], one sample per PERIOD."""

    angle: Array
    rate: Array
    acceleration: Array


class Measured(NamedTuple):
    """Pinion angle and pinion rate per torsion-bar torque, rad/(N m) and rad/(s N m)."""

    angle: FrequencyResponse
    rate: FrequencyResponse


@dataclass
class _Recording:
    dt: float
    channels: dict[str, Array]


class Difference(NamedTuple):
    """Largest error of measured responses against Eq. 10 in 0.2 to 5 Hz."""

    magnitude_dB: float
    phase_deg: float


def sweeps(amplitude: float) -> list[Motion]:
    """The sweep with every starting phase."""
    return [sweep(amplitude, phase) for phase in PHASES]


def sweep(amplitude: float, start: float = 0.0) -> Motion:
    """The sweep with soft ends from a phase in rad, as angle in rad with its exact derivatives."""
    p = MANOEUVRES["frequency_response"].parameters
    slope = (p.frequency_end - p.frequency) / p.duration
    duration = (END_HZ - p.frequency) / slope
    t = np.arange(round((HOLD + duration + FADE + REST) / PERIOD)) * PERIOD
    swept = np.clip(t - HOLD, 0.0, duration)
    after = np.maximum(t - HOLD - duration, 0.0)
    turns = p.frequency * np.minimum(t, HOLD) + (p.frequency + 0.5 * slope * swept) * swept
    phase = start + 2.0 * np.pi * (turns + END_HZ * after)
    omega = 2.0 * np.pi * (p.frequency + slope * swept)
    omega_rate = np.where((swept > 0.0) & (after == 0.0), 2.0 * np.pi * slope, 0.0)
    rise, fall = _soft_step(t / RISE), _soft_step(after / FADE)
    e = rise[0] - fall[0]
    e1 = rise[1] / RISE - fall[1] / FADE
    e2 = rise[2] / RISE**2 - fall[2] / FADE**2
    s, c = np.sin(phase), np.cos(phase)
    acceleration = e2 * s + 2.0 * e1 * omega * c + e * (omega_rate * c - omega**2 * s)
    return Motion(amplitude * e * s, amplitude * (e1 * s + e * omega * c), amplitude * acceleration)


def sine(amplitude: float) -> Motion:
    """The steady-state manoeuvre from rest: a cycle that swells, then SINE_CYCLES at 0.2 Hz."""
    omega = 2.0 * np.pi * SINE_HZ
    t = np.arange(round((SINE_CYCLES + 1) / SINE_HZ / PERIOD)) * PERIOD
    e, e1, e2 = _soft_step(t * SINE_HZ)
    s, c = np.sin(omega * t), np.cos(omega * t)
    rate = e1 * SINE_HZ * s + e * omega * c
    acceleration = e2 * SINE_HZ**2 * s + 2.0 * e1 * SINE_HZ * omega * c - e * omega**2 * s
    return Motion(amplitude * e * s, amplitude * rate, amplitude * acceleration)


def paper_amplitude(speed: float, p: ReferenceParameters, peak_Hz: float = SINE_HZ) -> float:
    """Pinion angle in rad that the paper's manoeuvres take at a speed in m/s (3 to 4 m/s2)."""
    return steering_amplitude(paper_acceleration(speed), speed, p, peak_Hz)


def impedance_torque(motion: Motion, speed: float, p: ReferenceParameters) -> Array:
    """Torsion-bar torque [n] in N m that the impedance generator asks for."""
    torque = np.zeros(motion.angle.size)
    _run_impedance(np.column_stack(motion), AT_REST, speed, p, PERIOD, torque)
    return torque


def admittance_motion(torque: Array, speed: float, p: ReferenceParameters) -> Motion:
    """Pinion motion that the admittance generator asks for under a torque [n] in N m."""
    motion = np.zeros((torque.size, 3))
    _run_admittance(np.ascontiguousarray(torque), AT_REST, speed, p, PERIOD, motion)
    return Motion(motion[:, 0], motion[:, 1], motion[:, 2])


def measure_impedance(
    motions: Sequence[Motion], speed: float, p: ReferenceParameters
) -> tuple[Measured, list[Array]]:
    """Responses of the impedance generator under motions (the instrument), and its torques."""
    torques = [impedance_torque(motion, speed, p) for motion in motions]
    return _measured(motions, torques, [motion.angle for motion in motions]), torques


def measure_admittance(
    torques: Sequence[Array],
    speed: float,
    p: ReferenceParameters,
    instruments: Sequence[Array] | None = None,
) -> tuple[Measured, list[Motion]]:
    """Responses of the admittance generator under torques, and its motions.

    ``instruments`` are what the torques came from; None where the torques came first.
    """
    motions = [admittance_motion(torque, speed, p) for torque in torques]
    return _measured(motions, torques, instruments or torques), motions


def _measured(
    motions: Sequence[Motion], torques: Sequence[Array], instruments: Sequence[Array]
) -> Measured:
    """Both responses by Eq. 5 over all runs."""
    runs = [
        _Recording(PERIOD, {"d": d, "torque": torque, "angle": motion.angle, "rate": motion.rate})
        for motion, torque, d in zip(motions, torques, instruments, strict=True)
    ]
    data = spectra(runs, ("d", "torque", "angle", "rate"))
    return Measured(*(frequency_response(data, "d", "torque", y, y) for y in ("angle", "rate")))


def difference_to_eq_10(found: Measured, speed: float, p: ReferenceParameters) -> Difference:
    """How far measured responses of a linear reference lie from the closed form, at worst."""
    matrices = linear.reference_matrices(speed, p, 1.0 + p.k_gain)
    magnitude = phase = 0.0
    for k, H in enumerate(found):
        lines = linear.frequency_response(matrices, H.line_frequency.ravel())[:, k, 0]
        exact = H.average(lines.reshape(H.line_frequency.shape))
        error = response_error(H.frequency, H.value, exact, BAND_HZ)
        magnitude = max(magnitude, float(np.abs(error.magnitude).max()))
        phase = max(phase, float(np.abs(error.phase).max()))
    return Difference(magnitude, phase)


def _soft_step(x: Array) -> tuple[Array, Array, Array]:
    """From 0 at x = 0 to 1 at x = 1 with three smooth derivatives; the first two of them."""
    u = np.clip(x, 0.0, 1.0)
    v = 1.0 - u
    step = u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)
    return step, 140.0 * u**3 * v**3, 420.0 * u**2 * v**2 * (v - u)


@compiled
def _run_impedance(
    motion: Array,
    x: ReferenceState,
    speed: float,
    p: ReferenceParameters,
    dt: float,
    torque: Array,
) -> None:
    for k in range(len(motion)):
        M_tb, _, x = impedance_step(motion[k, 0], motion[k, 1], motion[k, 2], x, speed, p, dt)
        torque[k] = M_tb


@compiled
def _run_admittance(
    torque: Array,
    x: ReferenceState,
    speed: float,
    p: ReferenceParameters,
    dt: float,
    motion: Array,
) -> None:
    for k in range(len(torque)):
        acceleration, x = admittance_step(torque[k], x, speed, p, dt)
        motion[k, 0] = x.pinion_angle
        motion[k, 1] = x.pinion_rate
        motion[k, 2] = acceleration
