"""Steer-by-wire feedback wheel: the paper's rig (section 2); assumptions where it is silent."""

from __future__ import annotations

from steer_env.physics.motor import Motor
from steer_env.physics.sensors import Sensors
from steer_env.physics.steering import Steering
from steer_env.plants.plant_set import Plant

SBW = Plant(
    name="SbW",
    steering=Steering(
        J_s=0.035,  # public SbW model 0.0344 kg m2
        b_s=0.02,  # assumption: one bearing
        M_s_fric=0.05,  # assumption: one bearing
        c_s_fric=30.0,
        c_tb=3000.0,  # assumption: torque flange; 0.03 N m is then 0.0006 deg of twist
        b_tb=0.5,  # assumption: 2 % damping of the flange mode
        J_pin=0.006,  # assumption: 7.5 N m direct-drive rotor
        b_pin=0.05,  # assumption
        M_fric=0.12,  # assumption: bearing and seal
        c_fric=60.0,
        motor_ratio=1.0,  # direct drive
        angle_limit=9.42,  # 540 deg, the drive's default end stop
        c_stop=200.0,
        b_stop=2.0,
    ),
    motor=Motor(rated_torque=7.5, slew_rate=3000.0, bandwidth_Hz=300.0, dead_time=1.0),
    sensors=Sensors(),
    rack_share=0.0,
    observer_bandwidth_Hz=40.0,
    # Flange and rotor of a given rig are known better than a car's: the notch of a controller counts on it.
    spread={
        "steering.J_s": (0.8, 1.5),
        "steering.b_s": (0.5, 4.0),
        "steering.M_s_fric": (0.5, 3.0),
        "steering.c_tb": (0.75, 1.3),
        "steering.J_pin": (0.8, 1.25),
        "steering.b_pin": (0.3, 3.0),
        "steering.M_fric": (0.4, 2.5),
        "motor.bandwidth_Hz": (0.4, 2.0),
        "sensors.torque_noise": (0.5, 2.0),
    },
)
