"""The rows of the catalogue of a force-feedback motor on a bench, by the id that gap.json uses."""

from __future__ import annotations

from steer_env.physics.effects import (
    asymmetric_friction,
    coulomb_friction,
    gravity_unbalance,
    presliding_friction,
    quadratic_drag,
    rig_backlash,
    rig_sensors,
    rig_stribeck,
    spring_centering,
    torque_ripple,
)
from steer_env.physics.effects.effect import Effect

RIG_EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        coulomb_friction.RIG,
        rig_stribeck.RIG,
        asymmetric_friction.RIG,
        presliding_friction.RIG,
        gravity_unbalance.RIG,
        torque_ripple.RIG,
        rig_sensors.COMMAND_LATENCY,
        rig_backlash.RIG,
        rig_sensors.TORQUE_OFFSET,
        rig_sensors.TORQUE_GAIN,
        quadratic_drag.RIG,
        spring_centering.RIG,
    )
}
