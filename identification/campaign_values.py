"""Are the values of a run finite, of a sensible size, and at the speed that was declared?"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from identification.channels import CHANNELS, FloatArray
from steer_env.errors import InputError
from steer_env.units import to_kmh

FASTEST_WHEEL = 45.0  # rad/s; a steering robot reaches 2600 deg/s, a person 1500 deg/s
CAN_REST = {"steering_torque_Nm": ("release",), "motor_torque_Nm": ("release", "free")}
MUST_MOVE = (
    "steering_angle_rad",
    "pinion_angle_rad",
    "motor_angle_rad",
    "steering_torque_Nm",
    "torsion_bar_torque_Nm",
    "motor_torque_Nm",
)


class Suspect(NamedTuple):
    """A run before it is accepted: SI channels [n] on their step, and how to name its rows."""

    where: str
    row: Callable[[int], str]
    manoeuvre: str
    dt: float
    channels: Mapping[str, FloatArray]


def check_values(run: Suspect) -> None:
    """Refuse values that are not finite, too large for their unit, or an angle that never moves."""
    for name, values in run.channels.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputError(
                f"{run.row(int(bad[0]))}: column '{name}'",
                f"the value is {values[bad[0]]} ({bad.size} such samples)",
                "remove the incomplete samples at the ends of the run, or log again",
            )
        limit = CHANNELS[name].limit
        large = np.flatnonzero(np.abs(values) > limit)
        if large.size:
            raise InputError(
                f"{run.row(int(large[0]))}: column '{name}'",
                f"{values[large[0]]:.4g} is beyond +-{limit:g}, what this channel can reach in SI",
                "check the unit (degrees? km/h? g?) and whether columns are swapped; "
                "map it in campaign.toml, [channels]",
            )
        if name in MUST_MOVE and run.manoeuvre not in CAN_REST.get(name, ()) and not np.ptp(values):
            raise InputError(
                f"{run.where}: column '{name}'",
                f"the value is {values[0]:g} throughout: the channel never moves",
                "check that the sensor was connected and the right column is mapped",
            )
        if CHANNELS[name].dimension == "angle" and not name.startswith(("motor", "sideslip")):
            _check_rate(run, name, values)


def _check_rate(run: Suspect, name: str, angle: FloatArray) -> None:
    """No hand or robot turns a wheel faster; over 50 ms, so that noise does not count."""
    span = max(1, round(0.05 / run.dt))
    rate = np.abs(angle[span:] - angle[:-span]) / (span * run.dt)
    if rate.size and np.max(rate) > FASTEST_WHEEL:
        first = int(np.argmax(rate))
        jump = first + 1 + int(np.argmax(np.abs(np.diff(angle[first : first + span + 1]))))
        raise InputError(
            f"{run.row(jump)}: column '{name}'",
            f"the angle changes by {np.max(rate):.3g} rad/s; no hand or robot is that fast",
            "check the unit (degrees?), and the log for jumps or a wrap at +-pi",
        )


def check_speed(run: Suspect, nominal: float) -> None:
    """Refuse a mean speed off the nominal one by more than 5 % and more than 2 km/h."""
    speed = run.channels.get("vehicle_speed_mps")
    if speed is None:
        return
    mean = float(np.mean(speed))
    if abs(mean - nominal) <= max(0.05 * nominal, 2.0 / 3.6):
        return
    hint = ""
    for factor, unit in ((3.6, "km/h"), (2.237, "mph")):
        if nominal and abs(mean / nominal / factor - 1.0) < 0.1:
            hint = f"; the channel looks like {unit}"
    raise InputError(
        f"{run.where}: column 'vehicle_speed_mps'",
        f"the mean is {to_kmh(mean):.1f} km/h, but campaign.toml says speed_kmh = "
        f"{to_kmh(nominal):g} (5 % or 2 km/h is allowed){hint}",
        "correct speed_kmh, or the unit of the channel",
    )
