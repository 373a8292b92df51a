"""The torque between wheel and motor for drives without a sensor: estimated from the motor's torque and the motion.

The rotor obeys J q'' + b q' = M_tb + i M_motor - M_friction - M_stop (the lower body of ``physics/steering.py``). The
control unit's own observer, told the motor's torque and the plant's friction and end stop at the measured angle, finds
all that it was not told as a load, and that is -M_tb.

It is as good as the plant's J, b and friction are, and late by about 3 / (2 pi f) = 12 ms at the default 40 Hz: a
controller that leans on a fast torque signal loses what a torque sensor would have given it. Resolution of 0.009 deg
makes little noise (physics/sensors.py: 12500 rad/s2 per rad at 40 Hz, times the rotor's 0.006 kg m2 and 45 urad rms
of quantisation, is 0.0034 N m rms).
"""

from __future__ import annotations

from steer_env.physics.friction import dahl_step
from steer_env.physics.sensors import Observer, ObserverState, observer_step
from steer_env.physics.steering import Steering, end_stop_torque
from steer_env.plants import Plant

BANDWIDTH_HZ = 40.0


class DriverTorque:
    """Estimates M_tb in N m and the rotor's rate in rad/s, one angle at a time."""

    def __init__(self, plant: Plant, bandwidth_Hz: float = BANDWIDTH_HZ) -> None:
        self._steering: Steering = plant.steering
        s = self._steering
        self._observer = Observer(s.J_pin, s.b_pin, s.motor_ratio, bandwidth_Hz, 1.0)
        self.restart(0.0)

    def restart(self, angle: float) -> None:
        """Begin at rest at an angle in rad."""
        self._state = ObserverState(angle, 0.0, 0.0)
        self._angle, self._friction = angle, 0.0

    @property
    def rate(self) -> float:
        """Rotor's rate in rad/s."""
        return self._state.rate

    def update(self, angle: float, motor_torque: float, dt: float) -> float:
        """M_tb in N m, dt seconds after the last update, with the angle in rad and the motor's torque in N m."""
        s = self._steering
        self._friction = dahl_step(self._friction, angle - self._angle, s.M_fric, s.c_fric)
        self._angle = angle
        told = -self._friction - end_stop_torque(angle, self._state.rate, s)
        _, self._state = observer_step(self._state, angle, told, motor_torque, self._observer, dt)
        return -self._state.load
