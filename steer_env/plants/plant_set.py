"""What makes up a plant: its parts' parameters, and the spread that randomisation draws from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from steer_env.physics.motor import Motor
from steer_env.physics.sensors import Observer, Sensors
from steer_env.physics.steering import Steering

DEAD_TIMES = (1, 2, 3)  # periods that a drawn plant's commands may be late, assumption


@dataclass(frozen=True)
class Plant:
    """One steering system; ``rack_share`` is 1 where the rack loads the lower body, else 0.

    ``spread`` maps "part.field" to the (low, high) factors on the nominal value that randomisation
    draws uniformly. ``nominal`` is the plant that the control unit and its controller believe in;
    None: this one. ``observer_known_inputs`` is 1 where the control unit's observer of the motion is
    driven by the measured and the motor's torque, 0 where it filters the angle alone (physics/sensors.py).
    """

    name: str
    steering: Steering
    motor: Motor
    sensors: Sensors
    rack_share: float
    observer_bandwidth_Hz: float
    spread: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    nominal: Plant | None = None
    observer_known_inputs: float = 1.0

    def believed(self) -> Plant:
        """What a controller may be designed for: the nominal plant."""
        return self.nominal or self

    def observer(self) -> Observer:
        """What the control unit believes: the nominal lower body."""
        s = self.believed().steering
        return Observer(s.J_pin, s.b_pin, s.motor_ratio, self.observer_bandwidth_Hz, self.observer_known_inputs)

    def drawn(self, rng: np.random.Generator) -> Plant:
        """One plant out of the spread, with a dead time out of DEAD_TIMES; it believes to be this one."""
        lows, highs = zip(*self.spread.values(), strict=True) if self.spread else ((), ())
        factors = rng.uniform(lows, highs).tolist()
        changed: dict[str, dict[str, float]] = {"steering": {}, "motor": {}, "sensors": {}}
        for name, factor in zip(self.spread, factors, strict=True):
            part, item = name.split(".")
            changed[part][item] = getattr(getattr(self, part), item) * factor
        changed["motor"]["dead_time"] = float(DEAD_TIMES[rng.integers(0, len(DEAD_TIMES))])
        parts = {part: getattr(self, part)._replace(**items) for part, items in changed.items()}
        return replace(self, **parts, nominal=self.believed())
