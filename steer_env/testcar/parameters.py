"""The car, the control unit, the motor and the steering robot of the virtual test, as one value."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics.boost_map import Calibration
from steer_env.physics.motor import Motor
from steer_env.physics.steering import Steering
from steer_env.physics.two_track_parameters import TwoTrack
from steer_env.units import Quantity


class Robot(NamedTuple):
    """Steering robot: a servo that holds the wheel at a target angle."""

    J: Annotated[
        float, Quantity("kg m2", "robot inertia on the wheel", 0.0, 0.2, "assumption: 0.03-0.06")
    ] = 0.030
    wheel_J: Annotated[
        float, Quantity("kg m2", "wheel inertia that the servo is tuned for", 0.0, 0.3, "car")
    ] = 0.040
    bandwidth_Hz: Annotated[
        float, Quantity("Hz", "servo bandwidth", 2.0, 40.0, "assumption: 8-15")
    ] = 14.0
    damping: Annotated[float, Quantity("-", "servo damping ratio", 0.2, 2.0, "assumption")] = 0.7
    torque_limit: Annotated[
        float, Quantity("N m", "largest torque", 1.0, 200.0, "assumption: 60-70 of an SR60")
    ] = 60.0
    rate_limit: Annotated[
        float,
        Quantity(
            "rad/s",
            "fastest wheel rate in a planned manoeuvre",
            1.0,
            60.0,
            "assumption: 1090 deg/s",
        ),
    ] = 19.0


class UnitSensors(NamedTuple):
    """What the EPAS control unit itself measures with (finer than what it sends on the bus)."""

    torque_step: Annotated[float, Quantity("N m", "torque resolution", 0.0, 1.0, "assumption")] = (
        0.005
    )
    angle_step: Annotated[
        float,
        Quantity(
            "rad", "angle resolution at the pinion", 0.0, 0.1, "assumption: 14 bit rotor angle / 22"
        ),
    ] = 1.745e-5


class Disturbance(NamedTuple):
    """What the road and the wind do on a good day: filtered white noise."""

    road_torque: Annotated[
        float, Quantity("N m", "rack load from the road, rms at the pinion", 0.0, 5.0, "assumption")
    ] = 0.10
    road_Hz: Annotated[float, Quantity("Hz", "its bandwidth", 0.1, 100.0, "assumption")] = 12.0
    side_force: Annotated[float, Quantity("N", "side wind, rms", 0.0, 2000.0, "assumption")] = 25.0
    side_Hz: Annotated[float, Quantity("Hz", "its bandwidth", 0.01, 100.0, "assumption")] = 1.0


class VirtualCar(NamedTuple):
    """Everything that drives through one campaign."""

    vehicle: TwoTrack = TwoTrack()
    steering: Steering = Steering(
        J_s=0.040,
        b_s=0.10,
        M_s_fric=0.15,
        c_tb=115.0,
        b_tb=0.30,
        J_pin=0.074,
        b_pin=0.35,
        M_fric=2.9,
        c_fric=200.0,
        motor_ratio=22.0,
    )
    calibration: Calibration = Calibration()
    motor: Motor = Motor(rated_torque=4.2, slew_rate=1000.0, bandwidth_Hz=250.0, dead_time=1.0)
    robot: Robot = Robot()
    sensors: UnitSensors = UnitSensors()
    disturbance: Disturbance = Disturbance()
    i_rp: Annotated[
        float,
        Quantity("rad/m", "pinion angle per rack travel", 20.0, 400.0, "assumption: 53 mm/rev"),
    ] = 118.0
