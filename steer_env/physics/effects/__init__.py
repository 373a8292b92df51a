"""The effect catalogue: what a plain model of a steering system may lack, one file per effect.

To add one: write ``effects/my_effect.py`` with a NamedTuple of parameters (defaults: absent), scalar functions
(moment, parameters) -> float for the ports where it enters, and an ``Effect`` row; list the row in the table of its
kind. It then exists in the environments, in the virtual test vehicle (``steer-env simulate --hide``) and for the gap
workflow, and is tested by being listed.
"""

from steer_env.physics.effects.drive_table import DRIVE_EFFECTS
from steer_env.physics.effects.effect import Effect, Plausible, SensorError
from steer_env.physics.effects.rig_table import RIG_EFFECTS
from steer_env.physics.effects.vehicle_table import VEHICLE_EFFECTS

EFFECTS: dict[str, dict[str, Effect]] = {"vehicle": VEHICLE_EFFECTS, "rig": RIG_EFFECTS, "drive": DRIVE_EFFECTS}

__all__ = ["EFFECTS", "Effect", "Plausible", "SensorError"]
