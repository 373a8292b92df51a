"""What a drive reported, completed by what its protocol does not tell."""

from __future__ import annotations

import math
from typing import NamedTuple

from steer_env.physics.motor import lag_decay, lag_step
from steer_env.plants import Plant
from steer_env.rig.driver_torque import DriverTorque
from steer_env.rig.frame import Received
from steer_env.rig.motors.motor import Sample


class Reading(NamedTuple):
    """The latest measurement, SI; ``device_time`` and ``host_time`` in s as in ``frame.Received``."""

    angle: float
    rate: float
    motor_torque: float
    torsion_bar_torque: float
    device_time: float
    host_time: float
    counter: int


class Gauge:
    """Makes readings of samples: the motor's torque from the command, torsion-bar torque and rate from the motion.

    ``plant`` is what the control side believes of the wheel; ``period`` in s is how often samples are asked for.
    """

    def __init__(self, plant: Plant, period: float) -> None:
        self._motor, self._period = plant.motor, period
        self._driver = DriverTorque(plant)
        self.reading: Reading | None = None
        self.sensor_torque = math.nan  # N m as a torque sensor last read it; nan where the protocol has none

    def restart(self) -> None:
        """Begin anew at the present angle, with a wheel at rest."""
        if self.reading is not None:
            self._driver.restart(self.reading.angle)

    def take(self, sample: Sample, received: Received, applied: float) -> Reading:
        """The reading of a sample; ``applied`` is the torque in N m that the drive was last told."""
        last, self.sensor_torque = self.reading, sample.sensor_torque
        passed = 0.0 if last is None else received.host_time - last.host_time
        dt = self._period * max(round(passed / self._period), 1)
        torque = sample.torque
        if math.isnan(torque):
            before = 0.0 if last is None else last.motor_torque
            torque = lag_step(before, applied, lag_decay(self._motor.bandwidth_Hz, dt))
        if last is None:
            self._driver.restart(sample.angle)
        estimate = self._driver.update(sample.angle, torque, dt)
        self.reading = Reading(
            sample.angle,
            self._driver.rate if math.isnan(sample.rate) else sample.rate,
            torque,
            estimate if math.isnan(sample.sensor_torque) else sample.sensor_torque,
            received.device_time,
            received.host_time,
            sample.counter,
        )
        return self.reading
