"""Effects at work in a steering system: the torsion bar and the front axle as they are with a row of effects.

Used alike by the environments' plant, the virtual test vehicle and the model of the gap workflow. Without a row (None)
each function is the plain equation.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects import vehicle_ports as ports
from steer_env.physics.effects.column_friction import STIFFNESS as COLUMN_STIFFNESS
from steer_env.physics.effects.moment import Moment, at_assist, at_bar, at_rack, at_wheel
from steer_env.physics.friction import dahl_over, dahl_step


class FrontAxle(NamedTuple):
    """What the front axle does: tyre steer angle in rad, torque at the pinion in N m, side acceleration in m/s2.

    ``M_sensed`` in N m is the rack force as a sensor on the rack has it, over i_rp: a ratio that varies changes what of
    it reaches the pinion, not the force itself.
    """

    tyre_angle: float
    M_rack: float
    M_sensed: float
    side_acceleration: float


@scalar
def bar_torques(
    steering_angle: float, steering_rate: float, pinion_angle: float, pinion_rate: float, c_tb: float, b_tb: float,
    row: Any,
) -> tuple[float, float]:  # fmt: skip
    """M_tb in N m, and what of it reaches the wheel: more or less where the column's slope is not one."""
    wheel = at_wheel(steering_angle)
    slope = 1.0 + ports.bar_slope(wheel, row)
    twist = steering_angle + ports.bar_angle(wheel, row) - pinion_angle
    torque = c_tb * twist + b_tb * (steering_rate * slope - pinion_rate) + ports.bar_torque(at_bar(twist, c_tb), row)
    return torque, torque * slope


@scalar
def seen_by_assist(M_tb: float, row: Any) -> float:
    """Torsion-bar torque in N m that the basic assist acts on."""
    return M_tb + ports.assist_input(at_assist(M_tb, 0.0), row)


@scalar
def given_by_assist(M_tb: float, assist_torque: float, row: Any) -> float:
    """Basic assist in N m that arrives, of the torque that is asked for."""
    return assist_torque + ports.assist_output(at_assist(M_tb, assist_torque), row)


@scalar
def pinion_moment(pinion_angle: float, pinion_rate: float, speed: float) -> Moment:
    """What is known at the pinion before the axle is asked."""
    return at_rack(pinion_angle, pinion_rate, speed, 0.0, 0.0, 0.0)


@scalar
def scrub_after(rack_friction: float, travel: float, x: Moment, row: Any) -> float:
    """Dahl torque in N m of the rack's side after a pinion travel in rad (exact)."""
    return dahl_over(rack_friction, travel, ports.rack_friction_level(x, row), ports.rack_friction_travel(x, row))


@scalar
def column_after(column_friction: float, travel: float, steering_angle: float, row: Any) -> float:
    """Dahl torque in N m of the wheel's side after a travel of the wheel in rad (exact)."""
    level = ports.column_friction_level(at_wheel(steering_angle), row)
    if level <= 0.0:
        return 0.0
    return dahl_step(column_friction, travel, level, COLUMN_STIFFNESS)


@scalar
def front_axle(
    pinion_angle: float, pinion_rate: float, speed: float, front_slip: float, front_force: float, tyre_torque: float,
    rack_friction: float, per_ratio: float, row: Any,
) -> FrontAxle:  # fmt: skip
    """What pinion and rack make of each other; ``tyre_torque`` in N m is the tyres' plain share of M_rack.

    ``per_ratio`` is 1 / i_s; ``rack_friction`` in N m as it stands.
    """
    x = at_rack(pinion_angle, pinion_rate, speed, front_slip, front_force, tyre_torque)
    tyres = tyre_torque * (1.0 + ports.trail(x, row))
    resisting = ports.rack_torque(x, row)
    return FrontAxle(
        (pinion_angle + ports.rack_angle(x, row)) * per_ratio + ports.tyre_angle(x, row),
        tyres * (1.0 + ports.rack_ratio(x, row)) + resisting + rack_friction,
        tyres + resisting + rack_friction,
        ports.side_acceleration(x, row),
    )
