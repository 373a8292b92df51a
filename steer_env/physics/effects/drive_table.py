"""The rows of the catalogue of a drive's log, by the id that gap.json uses."""

from __future__ import annotations

from steer_env.physics.effects import coulomb_friction, drive_effects, presliding_friction
from steer_env.physics.effects.effect import Effect

DRIVE_EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        coulomb_friction.DRIVE,
        presliding_friction.DRIVE,
        drive_effects.TORQUE_OFFSET_DRIFT,
        drive_effects.ANGLE_OFFSET,
        drive_effects.LATENCY_TORQUE,
        drive_effects.STIFFNESS_SATURATION,
    )
}
