"""Errors between the commanded torque of a bench motor and the torque that acts."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics.effects.effect import Effect, Plausible, SensorError
from steer_env.physics.effects.sensors import Gain, TorqueOffset
from steer_env.units import Quantity

COMMAND = ("motor_torque_Nm",)


class CommandLatency(NamedTuple):
    """Absent at zero."""

    delay_s: Annotated[float, Quantity("s", "from command to torque", -0.05, 0.2, "absent")] = 0.0


COMMAND_LATENCY = Effect(
    name="command_latency",
    kind="rig",
    enters="the torque acts later than it is commanded",
    parameters=CommandLatency,
    amplitude="delay_s",
    plausible={"delay_s": Plausible(0.002, 0.04)},
    probes=({"delay_s": 0.005},),
    sensor=SensorError(COMMAND, delay="delay_s"),
    shows_in="phase linear in frequency",
)
TORQUE_OFFSET = Effect(
    name="torque_offset",
    kind="rig",
    enters="a constant torque acts besides the command",
    parameters=TorqueOffset,
    amplitude="Nm",
    plausible={"Nm": Plausible(0.01, 1.0, signed=True)},
    probes=({"Nm": 0.05},),
    sensor=SensorError(COMMAND, offset="Nm"),
    shows_in="constant torque",
)
TORQUE_GAIN = Effect(
    name="torque_gain",
    kind="rig",
    enters="the torque is a multiple of the command; without a torque sensor J and b absorb it",
    parameters=Gain,
    amplitude="ratio",
    plausible={"ratio": Plausible(0.8, 1.2)},
    probes=({"ratio": 1.03},),
    sensor=SensorError(COMMAND, gain="ratio"),
    needs=("sensor_torque_Nm",),
    shows_in="torque against the torque sensor",
)
