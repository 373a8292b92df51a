"""Effects that a log of steering angle, torque and speed can tell."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible, SensorError
from steer_env.physics.effects.sensors import AngleOffset, Latency
from steer_env.units import Quantity

NO_LIMIT = 1e3  # rad


class DriveMoment(NamedTuple):
    """Steering angle in rad, its rate in rad/s, and the share of the run that has passed."""

    angle: float
    rate: float
    share: float


class TorqueOffsetDrift(NamedTuple):
    """Absent at zeros: a bias that wanders over a run, as the first half waves that fit into it."""

    wave_1_Nm: Annotated[float, Quantity("N m", "half a wave over the run", -10.0, 10.0, "absent")] = 0.0
    wave_2_Nm: Annotated[float, Quantity("N m", "one wave", -10.0, 10.0, "absent")] = 0.0
    wave_3_Nm: Annotated[float, Quantity("N m", "one and a half waves", -10.0, 10.0, "absent")] = 0.0
    wave_4_Nm: Annotated[float, Quantity("N m", "two waves", -10.0, 10.0, "absent")] = 0.0


@scalar
def drift(x: DriveMoment, p: TorqueOffsetDrift) -> float:
    """Bias in N m at a share of the run."""
    if p.wave_1_Nm == 0.0 and p.wave_2_Nm == 0.0 and p.wave_3_Nm == 0.0 and p.wave_4_Nm == 0.0:
        return 0.0
    turn = math.pi * x.share
    return (
        p.wave_1_Nm * math.cos(turn)
        + p.wave_2_Nm * math.cos(2.0 * turn)
        + p.wave_3_Nm * math.cos(3.0 * turn)
        + p.wave_4_Nm * math.cos(4.0 * turn)
    )


def drift_size(p: TorqueOffsetDrift) -> float:
    """Root of the sum of squares in N m."""
    return math.sqrt(sum(wave * wave for wave in p))


class StiffnessSaturation(NamedTuple):
    """Absent at NO_LIMIT."""

    angle_rad: Annotated[
        float, Quantity("rad", "steering angle at which centring levels off", 1e-3, NO_LIMIT, "absent")
    ] = NO_LIMIT


@scalar
def levelled(x: DriveMoment, p: StiffnessSaturation) -> float:
    """Angle in rad that centring does not see any more: a tanh(angle / a) - angle."""
    if p.angle_rad >= NO_LIMIT:
        return 0.0
    return p.angle_rad * math.tanh(x.angle / p.angle_rad) - x.angle


@scalar
def shifted(x: DriveMoment, p: AngleOffset) -> float:
    """Angle in rad that the sensor adds, taken off again."""
    return -p.rad


TORQUE_OFFSET_DRIFT = Effect(
    name="torque_offset_drift",
    kind="drive",
    enters="+ a bias that wanders over the run",
    parameters=TorqueOffsetDrift,
    amplitude="wave_1_Nm",
    plausible={f"wave_{k}_Nm": Plausible(0.0, 3.0, signed=True) for k in (1, 2, 3, 4)},
    probes=({"wave_1_Nm": 0.2}, {"wave_1_Nm": 0.001, "wave_2_Nm": 0.2}),
    ports={"torque": drift},
    size=drift_size,
    least_size=0.05,
    shows_in="a torque bias that is not the same at the start and at the end",
)
STIFFNESS_SATURATION = Effect(
    name="stiffness_saturation",
    kind="drive",
    enters="c(v) a tanh(angle / a)",
    parameters=StiffnessSaturation,
    amplitude="angle_rad",
    plausible={"angle_rad": Plausible(0.05, 3.0)},
    probes=({"angle_rad": 0.15}, {"angle_rad": 0.5}, {"angle_rad": 1.5}),
    ports={"angle": levelled},
    shows_in="torque that stops growing with the angle",
)
ANGLE_OFFSET = Effect(
    name="angle_offset",
    kind="drive",
    enters="c(v) (angle - offset)",
    parameters=AngleOffset,
    amplitude="rad",
    plausible={"rad": Plausible(0.002, 0.2, signed=True)},
    probes=({"rad": 0.02},),
    ports={"angle": shifted},
    shows_in="a bias that grows with speed as centring does",
)
LATENCY_TORQUE = Effect(
    name="latency_torque",
    kind="drive",
    enters="the torque is late",
    parameters=Latency,
    amplitude="delay_s",
    plausible={"delay_s": Plausible(0.01, 0.2)},
    probes=({"delay_s": 0.03},),
    sensor=SensorError(("steering_torque_Nm",), delay="delay_s"),
    shows_in="phase linear in frequency",
)
