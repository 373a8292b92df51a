"""The rows of the vehicle catalogue, by the id that gap.json uses."""

from __future__ import annotations

from steer_env.physics.effects import (
    assist_deadzone,
    assist_saturation,
    backlash,
    column_friction,
    jacking_torque,
    pneumatic_trail_drop,
    road_crown,
    sensors,
    stribeck_friction,
    suspension_compliance,
    torque_ripple,
    torsion_bar_nonlinearity,
    tyre_scrub,
    universal_joint,
    variable_ratio,
)
from steer_env.physics.effects.effect import Effect

VEHICLE_EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        jacking_torque.VEHICLE,
        tyre_scrub.VEHICLE,
        suspension_compliance.VEHICLE,
        pneumatic_trail_drop.VEHICLE,
        road_crown.VEHICLE,
        backlash.VEHICLE,
        torsion_bar_nonlinearity.VEHICLE,
        universal_joint.VEHICLE,
        variable_ratio.VEHICLE,
        torque_ripple.VEHICLE,
        stribeck_friction.VEHICLE,
        column_friction.VEHICLE,
        assist_deadzone.VEHICLE,
        assist_saturation.VEHICLE,
        sensors.LATENCY_IMU,
        sensors.LATENCY_PINION,
        sensors.LATENCY_TORQUE,
        sensors.TORQUE_GAIN,
        sensors.TORQUE_OFFSET,
        sensors.ANGLE_OFFSET,
        sensors.YAW_GAIN,
        sensors.AY_GAIN,
    )
}
