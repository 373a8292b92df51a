"""What one environment keeps between periods: which records lie where in its two rows."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.manoeuvres import ManoeuvreParameters
from steer_env.physics.control_unit import Commands, Observation
from steer_env.physics.driver import Driver
from steer_env.physics.motor import Motor
from steer_env.physics.plant import PlantState
from steer_env.physics.reference import ReferenceParameters, ReferenceState, TrackMap
from steer_env.physics.rows import Layout
from steer_env.physics.sensors import Observer, ObserverState, Sensors
from steer_env.physics.steering import Steering
from steer_env.units import Quantity

PERIOD = 1e-3  # s, control period (paper: 1 kHz)
SUBSTEPS = 2  # Runge-Kutta steps per period; the measurements behind it: physics/plant.py
LINE_LENGTH = 16  # periods that a delay line remembers
LINES = ("command", "angle", "torque", "motor_torque")


class Episode(NamedTuple):
    """What is driven and which causality is asked for."""

    kind: Annotated[float, Quantity("-", "number of the manoeuvre", 0, 1000, "MANOEUVRES")] = 0.0
    speed: Annotated[float, Quantity("m/s", "speed at the start", 0.5, 120.0, "-")] = 75.0 / 3.6
    speed_rate: Annotated[float, Quantity("m/s2", "change of speed", -10.0, 10.0, "-")] = 0.0
    speed_end: Annotated[float, Quantity("m/s", "speed at which the change stops", 0.5, 120.0, "-")] = 75.0 / 3.6
    admittance: Annotated[float, Quantity("-", "1 admittance, 0 impedance", 0, 1, "-")] = 0.0
    rack_share: Annotated[float, Quantity("-", "share of the rack torque felt by the lower body", 0, 1, "-")] = 1.0


class CarSpread(NamedTuple):
    """Factors on the car behind the rack, against the car that the reference was identified on."""

    mass: Annotated[float, Quantity("-", "mass and yaw inertia", 0.5, 2.0, "-")] = 1.0
    grip: Annotated[float, Quantity("-", "both cornering stiffnesses", 0.3, 2.0, "-")] = 1.0
    trail: Annotated[float, Quantity("-", "steering trail", 0.3, 2.0, "-")] = 1.0


class Reward(NamedTuple):
    """Scales and weights of the reward's parts; see ``period.py``."""

    torque_scale: Annotated[float, Quantity("N m", "torque error that costs 1", 1e-3, 100.0, "assumption")] = 0.5
    angle_scale: Annotated[float, Quantity("rad", "angle error that costs 1", 1e-5, 10.0, "assumption: 1 deg")] = (
        0.01745
    )
    smoothness: Annotated[float, Quantity("-", "weight of the squared command change", 0.0, 1e6, "assumption")] = 10.0
    effort: Annotated[float, Quantity("-", "weight of the squared command", 0.0, 1e3, "assumption")] = 0.01


class Clock(NamedTuple):
    """Periods so far, present speed in m/s, the control unit's last reference (N m or rad)."""

    period: float
    speed: float
    last_reference: float


class Truth(NamedTuple):
    """What really happened in a period (SI): goes to ``info``, never into an observation.

    ``reference`` is the ideal one (N m or rad), from true signals without sensors or observer;
    ``error`` is the true torsion-bar torque or pinion angle minus it. ``unstable`` is 1 where a
    limit of a sane steering system was left.
    """

    time: float
    speed: float
    steering_angle: float
    steering_rate: float
    steering_torque: float
    pinion_angle: float
    pinion_rate: float
    torsion_bar_torque: float
    motor_torque: float
    command: float
    rack_torque: float
    yaw_rate: float
    lateral_acceleration: float
    reference: float
    error: float
    reward_tracking: float
    reward_smoothness: float
    reward_effort: float
    unstable: float


# What one unit of a scaled observation is, field by field; scaled values end at
# +-OBSERVATION_LIMIT.
OBSERVATION_SCALES = Observation(
    pinion_angle=1.0,
    pinion_rate=10.0,
    pinion_acceleration=200.0,
    torsion_bar_torque=5.0,
    reference=5.0,  # N m; 1 rad in admittance, see SteerEnv
    reference_rate=50.0,  # N m/s; 10 rad/s in admittance
    reference_acceleration=200.0,
    effective_torque=25.0,
    speed=30.0,
    last_torque_1=1.0,  # times the motor's rated torque
    last_torque_2=1.0,
    last_torque_3=1.0,
    last_torque_4=1.0,
)
OBSERVATION_LIMIT = 10.0

PARAMETERS = Layout(
    steering=Steering,
    motor=Motor,
    driver=Driver,
    sensors=Sensors,
    observer=Observer,
    manoeuvre=ManoeuvreParameters,
    episode=Episode,
    car_spread=CarSpread,
    reward=Reward,
)
STATE = Layout(
    plant=PlantState,
    observer=ObserverState,
    generator=ReferenceState,
    judge=ReferenceState,
    commands=Commands,
    clock=Clock,
    reference=ReferenceParameters,
    car=ReferenceParameters,
    track=TrackMap,
)
