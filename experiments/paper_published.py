"""The published rows executed: Eq. 10 in closed form, both generators measured, slow loops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments import paper_generators as generators
from experiments.paper_generators import Difference, Harmonics, Measured
from identification.frf import Complexes, Floats
from steer_env.physics import linear
from steer_env.physics.reference import ReferenceParameters, single_track_of
from steer_env.plants import Reference
from steer_env.units import from_kmh

LINE_HZ = np.geomspace(0.2, 5.0, 160)
TORQUE_SWEEP = 3.0  # N m: what the linear admittance generator is driven with (any size would do)
NARROW = 0.1  # N m: a Gaussian so narrow that the assist is c_on / c_off everywhere


@dataclass(frozen=True)
class Executed:
    """One published row, driven through the paper's manoeuvres.

    ``linear`` and ``complete`` hold (impedance, admittance) responses; ``difference`` is that of the linear ones to
    Eq. 10; ``frictional`` is the impedance generator with friction and the linearised assist; ``loop`` holds pinion
    angle in rad and torsion-bar torque in N m over whole cycles at 0.2 Hz.
    """

    speed_kmh: float
    linear: tuple[Measured, Measured]
    difference: tuple[Difference, Difference]
    complete: tuple[Harmonics, Harmonics]
    frictional: Harmonics
    loop: tuple[Floats, Floats]


def execute(speed_kmh: float, reference: Reference) -> Executed:
    """Drive both generators of a complete reference, and of its linear part, at one speed."""
    speed = from_kmh(speed_kmh)
    p = reference.at(speed)._replace(linear=0.0)
    plain = p._replace(linear=1.0)
    amplitude = generators.paper_amplitude(speed, p, generators.BAND_HZ[1])
    linear_ones = (
        generators.measure_impedance(generators.sweep(amplitude), speed, plain),
        generators.measure_admittance(generators.sweep(TORQUE_SWEEP).angle, speed, plain),
    )
    first, second = (generators.difference_to_eq_10(found, speed, plain) for found in linear_ones)
    return Executed(
        speed_kmh,
        linear_ones,
        (first, second),
        generators.harmonics(amplitude, speed, p),
        generators.harmonics(amplitude, speed, _friction_only(p))[0],
        steady_loop(speed, p),
    )


def steady_loop(speed: float, p: ReferenceParameters) -> tuple[Floats, Floats]:
    """Angle and torque of the impedance generator over SINE_CYCLES cycles at 0.2 Hz."""
    motion = generators.sine(generators.paper_amplitude(speed, p))
    torque = generators.impedance_torque(motion, speed, p)
    first = motion.angle.size // (generators.SINE_CYCLES + 1)
    return motion.angle[first:], torque[first:]


def eq_10(reference: Reference, speed_kmh: float) -> Complexes:
    """Angle and rate per torsion-bar torque at LINE_HZ [n, 2], linearised assist, no friction."""
    return eq_10_at(reference, speed_kmh, LINE_HZ)


def eq_10_at(reference: Reference, speed_kmh: float, frequency: Floats) -> Complexes:
    """The same at any frequencies in Hz."""
    speed = from_kmh(speed_kmh)
    p = reference.at(speed)
    matrices = linear.reference_matrices(speed, p, 1.0 + p.k_gain)
    return linear.frequency_response(matrices, frequency)[:, :, 0]


def vehicle_lines(reference: Reference, speed_kmh: float, i_rp: float) -> dict[str, Complexes]:
    """Eqs. 6 and 9 at LINE_HZ: body motion per tyre angle, rack force per rack travel in N/m."""
    speed = from_kmh(speed_kmh)
    p = reference.at(speed)._replace(relaxed=1.0, c_extra=0.0)
    track = linear.frequency_response(linear.single_track_matrices(speed, single_track_of(p)), LINE_HZ)[:, :, 0]
    load = linear.frequency_response(linear.load_matrices(speed, p), LINE_HZ)[:, 0, 0]
    return {
        "yaw_rate": track[:, 0],
        "lateral_acceleration": track[:, 1],
        "sideslip_angle": track[:, 2],
        "rack": load * i_rp * i_rp,
    }


def _friction_only(p: ReferenceParameters) -> ReferenceParameters:
    """The row with friction, and the linearised assist in place of the Gaussian one."""
    return p._replace(r=1.0 / (1.0 + p.k_gain), sigma=NARROW)
