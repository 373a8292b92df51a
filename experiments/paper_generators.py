"""The two reference generators of Fig. 2 on their own: driven, and measured as a plant would be.

The impedance generator is driven by a motion, the admittance generator by a torque. The linear ones get the paper's
sweep (0.2 to 5 Hz in 17.5 s), but with a soft start and end: a motion whose rate jumps would ask the impedance
generator for an impulse of torque. The complete ones get one sine after the other at the sweep's amplitude, and their
first harmonic is taken: friction and assist answer a sweep with harmonics that fall on frequencies it reaches later.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from experiments.measures import response_error
from identification.frf import Complexes, Floats, FrequencyResponse, frequency_response, spectra
from steer_env.envs.layout import PERIOD
from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics import linear
from steer_env.physics._jit import compiled
from steer_env.physics.reference import (
    ReferenceParameters,
    ReferenceState,
    TrackMap,
    admittance_step,
    impedance_step,
    track_map,
)
from steer_env.plants.amplitude import paper_acceleration, steering_amplitude

BAND_HZ = (0.2, 5.0)
RISE = 4.0  # s in which the amplitude rises at the first frequency
HOLD = 5.0  # s at the first frequency: one period
FADE = 0.6  # s of the last frequency that die away
REST = 4.0  # s after it, so that the slowest mode of the published rows has died away too
STEPPED_HZ = np.geomspace(0.2, 5.0, 41)
SETTLED = 2.5  # s and cycles, at least, before a sine counts
SINE_HZ = 0.2
SINE_CYCLES = 3
AT_REST = ReferenceState(*[0.0] * len(ReferenceState._fields))


class Motion(NamedTuple):
    """Pinion angle in rad, rate and acceleration [n], one sample per PERIOD."""

    angle: Floats
    rate: Floats
    acceleration: Floats


class Measured(NamedTuple):
    """Pinion angle and pinion rate per torsion-bar torque, rad/(N m) and rad/(s N m)."""

    angle: FrequencyResponse
    rate: FrequencyResponse


class Harmonics(NamedTuple):
    """Pinion angle and rate per torsion-bar torque [n] at frequency [n] in Hz, by their first harmonics."""

    frequency: Floats
    angle: Complexes
    rate: Complexes


@dataclass
class _Recording:
    dt: float
    channels: dict[str, Floats]


class Difference(NamedTuple):
    """Largest error of measured responses against Eq. 10 in 0.2 to 5 Hz."""

    magnitude_dB: float
    phase_deg: float


def sweep(amplitude: float) -> Motion:
    """The sweep with soft ends, as angle in rad with its exact derivatives."""
    p = MANOEUVRES["frequency_response"].parameters
    t = np.arange(round((HOLD + p.duration + FADE + REST) / PERIOD)) * PERIOD
    swept = np.clip(t - HOLD, 0.0, p.duration)
    after = np.maximum(t - HOLD - p.duration, 0.0)
    slope = (p.frequency_end - p.frequency) / p.duration
    turns = p.frequency * np.minimum(t, HOLD) + (p.frequency + 0.5 * slope * swept) * swept
    phase = 2.0 * np.pi * (turns + p.frequency_end * after)
    omega = 2.0 * np.pi * (p.frequency + slope * swept)
    omega_rate = np.where((swept > 0.0) & (after == 0.0), 2.0 * np.pi * slope, 0.0)
    rise, fall = _soft_step(t / RISE), _soft_step(after / FADE)
    e = rise[0] - fall[0]
    e1 = rise[1] / RISE - fall[1] / FADE
    e2 = rise[2] / RISE**2 - fall[2] / FADE**2
    s, c = np.sin(phase), np.cos(phase)
    acceleration = e2 * s + 2.0 * e1 * omega * c + e * (omega_rate * c - omega**2 * s)
    return Motion(amplitude * e * s, amplitude * (e1 * s + e * omega * c), amplitude * acceleration)


def sine(amplitude: float, frequency: float = SINE_HZ, cycles: int = SINE_CYCLES) -> Motion:
    """A sine from rest: one cycle that swells, then ``cycles``; by default the steady-state manoeuvre."""
    omega = 2.0 * np.pi * frequency
    t = np.arange(round((cycles + 1) / frequency / PERIOD)) * PERIOD
    e, e1, e2 = _soft_step(t * frequency)
    s, c = np.sin(omega * t), np.cos(omega * t)
    rate = e1 * frequency * s + e * omega * c
    acceleration = e2 * frequency**2 * s + 2.0 * e1 * frequency * omega * c - e * omega**2 * s
    return Motion(amplitude * e * s, amplitude * rate, amplitude * acceleration)


def paper_amplitude(speed: float, p: ReferenceParameters, peak_Hz: float = SINE_HZ) -> float:
    """Pinion angle in rad that the paper's manoeuvres take at a speed in m/s (3 to 4 m/s2)."""
    return steering_amplitude(paper_acceleration(speed), speed, p, peak_Hz)


def impedance_torque(motion: Motion, speed: float, p: ReferenceParameters) -> Floats:
    """Torsion-bar torque [n] in N m that the impedance generator asks for."""
    torque = np.zeros(motion.angle.size)
    _run_impedance(np.column_stack(motion), AT_REST, speed, p, track_map(speed, p, PERIOD), torque)
    return torque


def admittance_motion(torque: Floats, speed: float, p: ReferenceParameters) -> Motion:
    """Pinion motion that the admittance generator asks for under a torque [n] in N m."""
    motion = np.zeros((torque.size, 3))
    _run_admittance(np.ascontiguousarray(torque), AT_REST, speed, p, PERIOD, motion)
    return Motion(motion[:, 0], motion[:, 1], motion[:, 2])


def measure_impedance(motion: Motion, speed: float, p: ReferenceParameters) -> Measured:
    """Responses of the impedance generator under a motion."""
    return _measured(motion, impedance_torque(motion, speed, p), motion.angle)


def measure_admittance(torque: Floats, speed: float, p: ReferenceParameters) -> Measured:
    """Responses of the admittance generator under a torque."""
    return _measured(admittance_motion(torque, speed, p), torque, torque)


def harmonics(amplitude: float, speed: float, p: ReferenceParameters) -> tuple[Harmonics, Harmonics]:
    """First harmonics at STEPPED_HZ under sines of an amplitude in rad: impedance, and admittance on its torque."""
    forward, back = [], []
    for frequency in STEPPED_HZ:
        cycles = 2 + int(np.ceil(max(SETTLED * frequency, SETTLED)))
        motion = sine(amplitude, frequency, cycles)
        torque = impedance_torque(motion, speed, p)
        returned = admittance_motion(torque, speed, p)
        last = round(2.0 / frequency / PERIOD)
        M_tb = _first_harmonic(torque[-last:], frequency)
        forward.append([_first_harmonic(y[-last:], frequency) / M_tb for y in motion[:2]])
        back.append([_first_harmonic(y[-last:], frequency) / M_tb for y in returned[:2]])
    found = (np.array(rows).T for rows in (forward, back))
    impedance, admittance = (Harmonics(STEPPED_HZ, angle, rate) for angle, rate in found)
    return impedance, admittance


def _first_harmonic(signal: Floats, frequency: float) -> complex:
    """Complex amplitude at ``frequency`` in Hz by least squares beside an offset."""
    turn = 2.0 * np.pi * frequency * PERIOD * np.arange(signal.size)
    basis = np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(turn)])
    a, b, _ = np.linalg.lstsq(basis, signal, rcond=None)[0]
    return complex(a, -b)


def _measured(motion: Motion, torque: Floats, instrument: Floats) -> Measured:
    """Both responses by Eq. 5."""
    run = _Recording(PERIOD, {"d": instrument, "torque": torque, "angle": motion.angle, "rate": motion.rate})
    data = spectra([run], ("d", "torque", "angle", "rate"))
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


def _soft_step(x: Floats) -> tuple[Floats, Floats, Floats]:
    """From 0 at x = 0 to 1 at x = 1 with three smooth derivatives; the first two of them."""
    u = np.clip(x, 0.0, 1.0)
    v = 1.0 - u
    step = u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)
    return step, 140.0 * u**3 * v**3, 420.0 * u**2 * v**2 * (v - u)


@compiled
def _run_impedance(
    motion: Floats,
    x: ReferenceState,
    speed: float,
    p: ReferenceParameters,
    track: TrackMap,
    torque: Floats,
) -> None:
    for k in range(len(motion)):
        M_tb, _, x = impedance_step(motion[k, 0], motion[k, 1], motion[k, 2], x, speed, p, track)
        torque[k] = M_tb


@compiled
def _run_admittance(
    torque: Floats,
    x: ReferenceState,
    speed: float,
    p: ReferenceParameters,
    dt: float,
    motion: Floats,
) -> None:
    for k in range(len(torque)):
        acceleration, x = admittance_step(torque[k], x, speed, p, dt)
        motion[k, 0] = x.pinion_angle
        motion[k, 1] = x.pinion_rate
        motion[k, 2] = acceleration
