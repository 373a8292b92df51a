"""Errors of the measurement of a vehicle: late signal groups, gains and offsets."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics.effects.effect import Effect, Plausible, SensorError
from steer_env.units import Quantity

IMU = ("lateral_speed_mps", "yaw_rate_radps", "lateral_acceleration_mps2", "sideslip_angle_rad")
PINION = ("pinion_angle_rad",)
TORQUE = ("torsion_bar_torque_Nm",)


class Latency(NamedTuple):
    """Absent at zero."""

    delay_s: Annotated[float, Quantity("s", "how late the signals are stamped", -0.1, 0.5, "absent")] = 0.0


class Gain(NamedTuple):
    """Absent at one."""

    ratio: Annotated[float, Quantity("-", "logged over true", 0.2, 5.0, "absent")] = 1.0


class TorqueOffset(NamedTuple):
    """Absent at zero."""

    Nm: Annotated[float, Quantity("N m", "logged minus true", -5.0, 5.0, "absent")] = 0.0


class AngleOffset(NamedTuple):
    """Absent at zero."""

    rad: Annotated[float, Quantity("rad", "logged minus true steering-wheel angle", -0.5, 0.5, "absent")] = 0.0


def _latency(group: str, channels: tuple[str, ...]) -> Effect:
    return Effect(
        name=f"latency_{group}",
        kind="vehicle",
        enters=f"the {group} signals are late",
        parameters=Latency,
        amplitude="delay_s",
        plausible={"delay_s": Plausible(0.004, 0.06)},
        probes=({"delay_s": 0.01},),
        sensor=SensorError(channels, delay="delay_s"),
        needs=channels[:1] if group != "imu" else (),
        shows_in="phase linear in frequency in those channels only",
    )


def _gain(name: str, channel: str, low: float, high: float) -> Effect:
    return Effect(
        name=name,
        kind="vehicle",
        enters=f"{channel} is scaled",
        parameters=Gain,
        amplitude="ratio",
        plausible={"ratio": Plausible(low, high)},
        probes=({"ratio": 1.03},),
        sensor=SensorError((channel,), gain="ratio"),
        needs=(channel,),
        shows_in="proportional to the signal, in this channel only",
    )


LATENCY_IMU = _latency("imu", IMU)
LATENCY_PINION = _latency("pinion", PINION)
LATENCY_TORQUE = _latency("torque", TORQUE)
TORQUE_GAIN = _gain("torque_gain", TORQUE[0], 0.85, 1.15)
YAW_GAIN = _gain("yaw_gain", "yaw_rate_radps", 0.9, 1.1)
AY_GAIN = _gain("ay_gain", "lateral_acceleration_mps2", 0.9, 1.1)
TORQUE_OFFSET = Effect(
    name="torque_offset",
    kind="vehicle",
    enters="the torsion-bar torque is shifted",
    parameters=TorqueOffset,
    amplitude="Nm",
    plausible={"Nm": Plausible(0.03, 0.5, signed=True)},
    probes=({"Nm": 0.1},),
    sensor=SensorError(TORQUE, offset="Nm"),
    needs=TORQUE,
    shows_in="constant, in the torsion-bar torque only",
)
ANGLE_OFFSET = Effect(
    name="angle_offset",
    kind="vehicle",
    enters="the steering-wheel angle is shifted",
    parameters=AngleOffset,
    amplitude="rad",
    plausible={"rad": Plausible(0.002, 0.05, signed=True)},
    probes=({"rad": 0.01},),
    sensor=SensorError(("steering_angle_rad",), offset="rad"),
    needs=("steering_angle_rad",),
    shows_in="constant, between the wheel angle and everything else",
)
