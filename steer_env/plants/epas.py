"""Electric power steering of a passenger car; each field of Steering names its source."""

from __future__ import annotations

from steer_env.physics.motor import Motor
from steer_env.physics.sensors import Sensors
from steer_env.physics.steering import Steering
from steer_env.plants.plant_set import Plant

EPAS = Plant(
    name="EPAS",
    steering=Steering(),
    motor=Motor(),
    # The motor's resolver sits behind a ratio of 21, so the pinion angle is fine; the torque sensor
    # is the rig's.
    sensors=Sensors(angle_step=1.0e-4, angle_noise=5.0e-5),
    rack_share=1.0,
    observer_bandwidth_Hz=40.0,
    spread={
        "steering.J_s": (0.75, 1.6),
        "steering.b_s": (0.2, 4.0),
        "steering.M_s_fric": (0.35, 2.6),
        "steering.c_tb": (0.7, 1.22),
        "steering.b_tb": (0.2, 3.0),
        "steering.J_pin": (0.7, 1.7),
        "steering.b_pin": (0.25, 3.0),
        "steering.M_fric": (0.4, 2.0),
        "motor.bandwidth_Hz": (0.4, 3.0),
        "sensors.torque_noise": (0.5, 2.0),
    },
)
