"""Does a run obey physics? Finds wrong units, swapped columns and wrong signs.

Each check compares sizes that physics ties together, with a margin (stated beside it) far wider
than any vehicle, sensor error or effect needs, and far narrower than the fault it is there to find:
a degree taken for a radian is a factor 57, g for m/s2 a factor 10.
"""

import numpy as np

from identification.campaign_values import Suspect
from identification.channels import CHANNELS, FloatArray
from steer_env.errors import InputError
from steer_env.plants.reference_row import KnownVehicle
from steer_env.units import GRAVITY

SMOOTH = 0.25  # s; comparisons are made below about 2 Hz
MOVING = 5.0  # m/s; below it yaw rate and lateral acceleration are too small to compare
FLOOR = 0.005  # of a channel's limit: less motion is too little to judge by


def check_steering_wheel(run: Suspect) -> None:
    """Above 12 m/s a wheel is stiffer than 1 N m/rad: less means degrees, or swapped columns.

    Assumption, margin: the lightest published car of the paper's tables has 6 N m/rad at 15 km/h
    and 53 at 105 km/h, at the pinion and before assist; a degree would make 1/57 of it.
    """
    needed = ("steering_angle_rad", "steering_torque_Nm", "vehicle_speed_mps")
    if run.manoeuvre == "release" or not all(name in run.channels for name in needed):
        return
    angle, torque, speed = (run.channels[name] for name in needed)
    fast = speed > 12.0
    if np.count_nonzero(fast) * run.dt < 5.0:
        return
    stiffness = float(np.std(torque[fast])) / max(float(np.std(angle[fast])), 1e-6)
    if stiffness < 1.0:
        raise InputError(
            f"{run.where}: columns 'steering_angle_rad', 'steering_torque_Nm'",
            f"above 12 m/s the torque varies by only {stiffness:.2g} N m per rad of angle",
            "the angle may be in degrees, or the two columns swapped; see [channels]",
        )
    if stiffness > 2000.0:
        raise InputError(
            f"{run.where}: columns 'steering_angle_rad', 'steering_torque_Nm'",
            f"above 12 m/s the torque varies by {stiffness:.3g} N m per rad of angle",
            "the angle hardly moves: check the units of both columns; see [channels]",
        )


def check_torsion_bar(run: Suspect, stiffness: float) -> None:
    """The bar's twist, steering minus pinion angle, must be of the size of M_tb / c_tb.

    0.1 rad of difference is allowed: universal joints and sensor offsets reach 0.05 rad.
    """
    needed = ("steering_angle_rad", "pinion_angle_rad", "torsion_bar_torque_Nm")
    if not all(name in run.channels for name in needed):
        return
    steering, pinion, torque = (_smooth(run, name) for name in needed)
    twist = steering - pinion
    expected = torque / stiffness
    sizes = float(np.std(twist)), float(np.std(expected))
    place = (
        f"{run.where}: columns 'steering_angle_rad', 'pinion_angle_rad', 'torsion_bar_torque_Nm'"
    )
    if max(sizes) > 0.1 + 3.0 * min(sizes):
        raise InputError(
            place,
            f"the bar twists by {sizes[0]:.3g} rad, but its torque over its stiffness is "
            f"{sizes[1]:.3g} rad",
            "check the units of the three columns and whether two are swapped; see [channels]",
        )
    slope, correlation = _regress(twist, expected)
    if correlation < -0.9 and -2.0 < slope < -0.5:
        raise InputError(
            place,
            "the bar's torque is the negative of stiffness times twist",
            "steering and pinion angle are swapped, or the torque's sign is wrong (scale = -1)",
        )


def check_vehicle(run: Suspect, vehicle: KnownVehicle, speed: float) -> None:
    """Angle, yaw rate, lateral acceleration, sideslip and rack force must fit one another."""
    if speed > MOVING:
        base = vehicle.cg_to_front_axle + vehicle.cg_to_rear_axle
        kinematic = speed / (vehicle.steering_ratio * base)  # yaw rate per pinion angle
        # Understeer takes up to 80 % of the kinematic yaw gain, oversteer may double it.
        for angle in ("pinion_angle_rad", "steering_angle_rad"):
            _check_gain(run, angle, "yaw_rate_radps", kinematic, (0.08, 5.0))
        _check_gain(run, "yaw_rate_radps", "lateral_acceleration_mps2", speed, (0.25, 4.0))
        _check_gain(run, "lateral_speed_mps", "sideslip_angle_rad", 1.0 / speed, (0.25, 4.0))
    rack = 1.0 / vehicle.pinion_ratio  # rack torque at the pinion is hand torque times the assist
    _check_gain(run, "rack_force_N", "torsion_bar_torque_Nm", rack, (5e-3, 8.0))


def _check_gain(
    run: Suspect, cause: str, effect: str, gain: float, window: tuple[float, float]
) -> None:
    """Compare the size and the sign of ``effect`` with ``gain`` times ``cause``."""
    if cause not in run.channels or effect not in run.channels:
        return
    x, y = _smooth(run, cause), _smooth(run, effect)
    expected = gain * float(np.std(x))
    if max(expected, float(np.std(y))) < FLOOR * CHANNELS[effect].limit:
        return
    ratio = float(np.std(y)) / max(expected, 1e-12)
    place = f"{run.where}: columns '{cause}', '{effect}'"
    if not window[0] <= ratio <= window[1]:
        raise InputError(
            place,
            f"'{effect}' is {ratio:.3g} times what '{cause}' lets expect",
            f"check the units (degree and radian differ by 57, g and m/s2 by {GRAVITY:.1f}) "
            "and whether columns are swapped; see [channels]",
        )
    if _regress(x, y)[1] < -0.7:
        raise InputError(
            place,
            f"'{effect}' is opposite to '{cause}'",
            "steering left, yaw to the left and lateral acceleration to the left are positive: "
            "turn the sign with scale = -1 in [channels]",
        )


def _smooth(run: Suspect, name: str) -> FloatArray:
    """The channel as moving average without its mean, so that noise and servo ripple are out."""
    values = run.channels[name]
    width = max(1, min(len(values), round(SMOOTH / run.dt)))
    total = np.cumsum(np.concatenate(([0.0], values - np.mean(values))))
    averaged: FloatArray = (total[width:] - total[:-width]) / width
    return averaged


def _regress(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return slope of y on x and their correlation."""
    a, b = x - np.mean(x), y - np.mean(y)
    xx, yy, xy = float(a @ a), float(b @ b), float(a @ b)
    if xx == 0.0 or yy == 0.0:
        return 0.0, 0.0
    return xy / xx, xy / np.sqrt(xx * yy)
