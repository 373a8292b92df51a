"""The wheel on the virtual motor: the steer-by-wire plant, with cogging and a wheel that is not balanced.

The equations are those of the environments (``steer_env.physics``); only the grid differs, because torque commands come
when the bus brings them: from one event to the next in equal steps of at most 0.5 ms.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np

from steer_env.physics import plant
from steer_env.physics._jit import compiled
from steer_env.physics.driver import Driver, Hand
from steer_env.physics.effects import rig_ports, vehicle_ports
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.physics.motor import lag_decay
from steer_env.physics.reference import ReferenceParameters
from steer_env.physics.sensors import measured
from steer_env.physics.steering import Steering, torsion_bar_torque
from steer_env.plants.plant_set import Plant
from steer_env.units import Quantity

LONGEST_STEP = 0.5e-3  # s
QUIET = (0.0, 0.0)
HANDS_OFF = Hand(0.0, 0.0, 0.0, 0.0)


class Imperfections(NamedTuple):
    """What a real wheel has besides the plant's own friction."""

    cogging_Nm: Annotated[float, Quantity("N m", "amplitude of cogging", 0.0, 5.0, "assumption")] = 0.02
    cogging_order: Annotated[float, Quantity("1/rev", "cogging periods per turn", 1.0, 200.0, "assumption")] = 21.0
    unbalance_Nm: Annotated[float, Quantity("N m", "weight times arm of the wheel", 0.0, 5.0, "assumption")] = 0.05


PERFECT = Imperfections(0.0, 21.0, 0.0)


class Readings(NamedTuple):
    """What the drive's sensors give: rad, rad/s, N m, N m."""

    angle: float
    rate: float
    motor_torque: float
    sensor_torque: float


@compiled
def wheel_after(
    x: plant.PlantState, target: float, bandwidth_Hz: float, h: float, n: int, hand: Hand, steering: Steering,
    driver: Driver, car: ReferenceParameters, effects: Any, unbalance: Any,
) -> plant.PlantState:  # fmt: skip
    """State after n steps of h seconds with a constant torque target in N m at the rotor."""
    decay = lag_decay(bandwidth_Hz, 0.5 * h)
    for _ in range(n):
        weight = rig_ports.torque(RigMoment(x.steering_angle, x.steering_rate), unbalance)
        loaded = Hand(hand.angle, hand.rate, hand.torque - weight, hand.grip)
        x = plant.plant_step(x, target, decay, loaded, 1.0, 0.0, steering, driver, car, h, effects)
    return x


class Wheel:
    """State of the plant; ``hand`` and ``driver`` are who holds it, and may be changed at any time.

    ``draws`` gives two standard normal draws for the noise of angle and torque at each reading: by default of the
    generator (without one, zeros); another may take its place, so that two plants can share their noise.
    """

    def __init__(
        self, plant_set: Plant, imperfections: Imperfections, rng: np.random.Generator | None, angle: float = 0.0
    ) -> None:
        self.plant = plant_set
        self.state = plant.PlantState(angle, 0.0, angle, *[0.0] * 10)
        self.hand, self.driver = HANDS_OFF, Driver()
        self.draws: Callable[[], Any] = (lambda: QUIET) if rng is None else partial(rng.standard_normal, 2)
        self._car = ReferenceParameters()
        ripple = {"amplitude_Nm": imperfections.cogging_Nm, "order": imperfections.cogging_order}
        self._effects = vehicle_ports.effect_row({"torque_ripple": ripple})
        self._unbalance = rig_ports.rig_row({"gravity_unbalance": {"sin_Nm": imperfections.unbalance_Nm}})

    def advance(self, target: float, dt: float) -> None:
        """Let dt seconds pass with the current loop's target in N m."""
        # A bit of rounding in dt must not add a step: parity with the environments' own grid.
        n = max(math.ceil(dt / LONGEST_STEP - 1e-6), 1)
        bandwidth_Hz = self.plant.motor.bandwidth_Hz
        self.state = wheel_after(
            self.state, target, bandwidth_Hz, dt / n, n, self.hand, self.plant.steering, self.driver, self._car,
            self._effects, self._unbalance,
        )  # fmt: skip

    def read(self) -> Readings:
        """Angle and torques as the sensors give them, with their noise if there is a generator."""
        x, sensors = self.state, self.plant.sensors
        true_torque = torsion_bar_torque(plant.motion_of(x), self.plant.steering)
        noise_angle, noise_torque = self.draws()
        angle = measured(x.pinion_angle, sensors.angle_step, sensors.angle_noise, noise_angle)
        torque = sensors.torque_gain * true_torque + sensors.torque_offset
        torque = measured(torque, sensors.torque_step, sensors.torque_noise, noise_torque)
        return Readings(angle, x.pinion_rate, x.motor_torque, torque)
