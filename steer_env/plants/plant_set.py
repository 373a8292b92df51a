"""What makes up a plant: its parts' parameters, and the spread that randomisation draws from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from steer_env.physics.motor import Motor
from steer_env.physics.sensors import Observer, Sensors
from steer_env.physics.steering import Steering


@dataclass(frozen=True)
class Plant:
    """One steering system; ``rack_share`` is 1 where the rack loads the lower body, else 0.

    ``spread`` maps "part.field" to the (low, high) factors on the nominal value that randomisation
    draws uniformly.
    """

    name: str
    steering: Steering
    motor: Motor
    sensors: Sensors
    rack_share: float
    observer_bandwidth_Hz: float
    spread: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def observer(self) -> Observer:
        """What the control unit believes: the nominal lower body."""
        s = self.steering
        return Observer(s.J_pin, s.b_pin, s.motor_ratio, self.observer_bandwidth_Hz)
