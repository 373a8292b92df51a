"""Two-mass steering: the same equations for the EPAS column and the steer-by-wire wheel.

EPAS (Eq. 2): the upper body is the steering wheel, the elastic element the torsion bar, the lower
body pinion, rack and reflected motor, loaded by the rack. Steer-by-wire: the same with the torque
sensor as the elastic element, the motor's rotor as the lower body, motor_ratio 1 and no rack.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.units import Quantity


class Steering(NamedTuple):
    """Mechanical parameters; defaults are an EPAS of a passenger car."""

    J_s: Annotated[float, Quantity("kg m2", "steering-wheel inertia", 0.01, 0.3, "median of public EPS models")] = 0.04
    b_s: Annotated[float, Quantity("N m s/rad", "wheel-side damping", 0.0, 3.0, "median of public EPS models")] = 0.1
    M_s_fric: Annotated[float, Quantity("N m", "wheel-side Coulomb friction", 0.0, 3.0, "assumption")] = 0.15
    c_s_fric: Annotated[float, Quantity("N m/rad", "wheel-side Dahl stiffness", 0.1, 1e4, "assumption")] = 30.0
    c_tb: Annotated[float, Quantity("N m/rad", "torsion-bar stiffness", 10.0, 5e4, "systune EPS example")] = 143.24
    b_tb: Annotated[float, Quantity("N m s/rad", "torsion-bar damping", 0.0, 20.0, "bldc-foc-sim EPS model")] = 0.1
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, "rotor 1.5e-4 kg m2 x 21^2")] = 0.065
    b_pin: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, "assumption")] = 0.4
    M_fric: Annotated[float, Quantity("N m", "lower-body Coulomb friction", 0.0, 20.0, "assumption")] = 2.0
    c_fric: Annotated[float, Quantity("N m/rad", "lower-body Dahl stiffness", 0.1, 1e5, "assumption")] = 200.0
    motor_ratio: Annotated[float, Quantity("-", "motor angle / lower-body angle", 0.1, 100.0, "assumption")] = 21.0
    angle_limit: Annotated[float, Quantity("rad", "end stop of the lower body", 0.1, 30.0, "assumption")] = 9.0
    c_stop: Annotated[float, Quantity("N m/rad", "end-stop stiffness", 0.0, 1e4, "assumption")] = 400.0
    b_stop: Annotated[float, Quantity("N m s/rad", "end-stop damping", 0.0, 100.0, "assumption")] = 4.0
    # LuGre instead of Dahl friction on the lower body, where one of the first two is not zero.
    M_fric_extra: Annotated[
        float, Quantity("N m", "friction level at rest beyond M_fric", 0.0, 20.0, "assumption: Dahl")
    ] = 0.0
    sigma_1: Annotated[float, Quantity("N m s/rad", "bristle damping", 0.0, 20.0, "assumption: Dahl")] = 0.0
    stribeck_rate: Annotated[
        float, Quantity("rad/s", "rate at which the extra level has fallen to 1/e", 1e-3, 10.0, "assumption")
    ] = 0.1


class SteeringMotion(NamedTuple):
    """Angles (rad) and rates (rad/s) of the steering wheel and the lower body (pinion or rotor)."""

    steering_angle: float
    steering_rate: float
    pinion_angle: float
    pinion_rate: float


@scalar
def torsion_bar_torque(x: SteeringMotion, p: Steering) -> float:
    """M_tb in N m: torque that the wheel hands down to the lower body (Eq. 2)."""
    return p.c_tb * (x.steering_angle - x.pinion_angle) + p.b_tb * (x.steering_rate - x.pinion_rate)


@scalar
def end_stop_torque(angle: float, rate: float, p: Steering) -> float:
    """End-stop torque in N m against the lower body; zero inside the limit, never pulling."""
    beyond = abs(angle) - p.angle_limit
    outwards = math.copysign(1.0, angle)
    held = max(p.c_stop * beyond + p.b_stop * (rate * outwards), 0.0)
    return held * outwards if beyond > 0.0 else 0.0


@scalar
def steering_rates(
    x: SteeringMotion,
    M_s: float,
    M_s_fric: float,
    M_fric: float,
    M_rack: float,
    motor_torque: float,
    J_driver: float,
    p: Steering,
) -> SteeringMotion:
    """Time derivatives of the motion (Eq. 2).

    ``M_s`` is what the driver applies besides his own inertia ``J_driver``; ``M_s_fric`` and
    ``M_fric`` are the two friction torques (they resist positive motion when positive);
    ``motor_torque`` is at the motor's shaft. All in N m.
    """
    M_tb = torsion_bar_torque(x, p)
    return steering_rates_with(x, M_tb, M_tb, M_s, M_s_fric, M_fric, M_rack, motor_torque, J_driver, p)


@scalar
def steering_rates_with(
    x: SteeringMotion,
    M_tb: float,
    M_up: float,
    M_s: float,
    M_s_fric: float,
    M_fric: float,
    M_rack: float,
    motor_torque: float,
    J_driver: float,
    p: Steering,
) -> SteeringMotion:
    """As ``steering_rates``, with the bar's torque handed in: ``M_tb`` on the pinion, ``M_up`` on the wheel."""
    M_stop = end_stop_torque(x.pinion_angle, x.pinion_rate, p)
    # Frictions last: a processor can do the rest while it works out their exponentials.
    wheel = (M_s - M_up - p.b_s * x.steering_rate - M_s_fric) * (1.0 / (p.J_s + J_driver))
    lower = M_tb + p.motor_ratio * motor_torque - M_rack - M_stop - p.b_pin * x.pinion_rate - M_fric
    return SteeringMotion(x.steering_rate, wheel, x.pinion_rate, lower * (1.0 / p.J_pin))


@scalar
def moved(q: SteeringMotion, h: float, k: SteeringMotion) -> SteeringMotion:
    """Q + h k."""
    return SteeringMotion(
        q.steering_angle + h * k.steering_angle,
        q.steering_rate + h * k.steering_rate,
        q.pinion_angle + h * k.pinion_angle,
        q.pinion_rate + h * k.pinion_rate,
    )
