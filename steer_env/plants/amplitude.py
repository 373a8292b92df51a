"""How far to steer: the amplitude for a lateral acceleration, within what a robot can do."""

from __future__ import annotations

import numpy as np

from steer_env.physics import linear
from steer_env.physics.driver import Driver
from steer_env.physics.reference import ReferenceParameters, single_track_of, torsion_bar_torque_for
from steer_env.units import from_kmh

# Lateral acceleration in m/s2 over speed in km/h: 3-4 m/s2 (paper, section 2), less where the speed
# cannot reach it.
PAPER_ACCELERATION = ((15.0, 1.5), (30.0, 2.5), (45.0, 3.0), (60.0, 3.5), (250.0, 3.5))
LARGEST_ANGLE = 3.7  # rad, 210 deg: the paper's range at 15 km/h
LARGEST_RATE = 20.0  # rad/s, assumption: about what a steering robot does (ATI: 1800-2600 deg/s)
STEADY_FREQUENCY_Hz = 0.2


def paper_acceleration(speed: float) -> float:
    """Lateral acceleration in m/s2 aimed at in the paper's manoeuvres at a speed in m/s."""
    speeds, values = zip(*PAPER_ACCELERATION, strict=True)
    return float(np.interp(speed, [from_kmh(v) for v in speeds], values))


def steering_amplitude(acceleration: float, speed: float, car: ReferenceParameters, peak_frequency_Hz: float) -> float:
    """Pinion angle in rad for ``acceleration`` in m/s2 at 0.2 Hz, capped to a feasible sweep."""
    matrices = linear.single_track_matrices(speed, single_track_of(car))
    output = linear.VEHICLE_OUTPUTS.index("lateral_acceleration")
    gain = abs(linear.frequency_response(matrices, STEADY_FREQUENCY_Hz)[0, output, 0]) / car.i_s
    feasible = min(LARGEST_ANGLE, LARGEST_RATE / (2.0 * np.pi * peak_frequency_Hz))
    return float(min(acceleration / gain, feasible))


def hand_amplitude(angle: float, driver: Driver, reference: ReferenceParameters, stiffness: float) -> float:
    """Hand angle in rad that moves the wheel by about ``angle``.

    A soft arm must reach further, against the felt torque. ``stiffness`` in N m/rad is the pinion's
    steady stiffness (c_pin_on).
    """
    if driver.k <= 0.0:
        return angle
    return angle + torsion_bar_torque_for(stiffness * angle + reference.M_fric_C, reference) / driver.k
