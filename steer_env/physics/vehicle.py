"""Linear single track with tyre relaxation (Eq. 6) and the rack torque it causes (Eq. 9)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.units import Quantity

_R = "assumption: set R, which meets Table 3 within 0.4 % at 60 km/h and above"


class SingleTrack(NamedTuple):
    """Parameters of the single track; defaults are set R with the published row of 75 km/h."""

    m: Annotated[float, Quantity("kg", "vehicle mass", 500.0, 10000.0, _R)] = 1784.0
    l_f: Annotated[float, Quantity("m", "centre of gravity to front axle", 0.3, 5.0, _R)] = 1.274
    l_r: Annotated[float, Quantity("m", "centre of gravity to rear axle", 0.3, 5.0, _R)] = 1.502
    J_z: Annotated[float, Quantity("kg m2", "yaw inertia", 300.0, 60000.0, "Table 2, 75 km/h")] = 3299.0
    C_f: Annotated[float, Quantity("N/rad", "front axle cornering stiffness", 1e4, 1e6, "Table 2, 75 km/h")] = 138080.0
    C_r: Annotated[float, Quantity("N/rad", "rear axle cornering stiffness", 1e4, 1e6, "Table 2, 75 km/h")] = 159010.0
    sigma_f: Annotated[float, Quantity("m", "front relaxation length", 0.005, 3.0, "Table 2, 75 km/h")] = 0.0313
    sigma_r: Annotated[float, Quantity("m", "rear relaxation length", 0.005, 3.0, "Table 2, 75 km/h")] = 0.3666
    n_t: Annotated[float, Quantity("m", "steering trail", 0.0, 0.5, "Table 2, 75 km/h")] = 0.0838
    i_s: Annotated[float, Quantity("-", "pinion angle / road-wheel angle", 5.0, 30.0, _R)] = 16.5


class SingleTrackState(NamedTuple):
    """Lateral speed in m/s, yaw rate in rad/s, front and rear slip angle in rad."""

    lateral_speed: float
    yaw_rate: float
    slip_front: float
    slip_rear: float


@scalar
def single_track_rates(x: SingleTrackState, tyre_angle: float, speed: float, p: SingleTrack) -> SingleTrackState:
    """Derivatives of the state (Eq. 6) at a road-wheel angle in rad and a forward speed in m/s.

    Slip is positive where the tyre pushes to the left. The equations stay regular as speed goes to
    zero.
    """
    force_front = p.C_f * x.slip_front
    force_rear = p.C_r * x.slip_rear
    return SingleTrackState(
        (force_front + force_rear) * (1.0 / p.m) - speed * x.yaw_rate,
        (p.l_f * force_front - p.l_r * force_rear) * (1.0 / p.J_z),
        (speed * (tyre_angle - x.slip_front) - x.lateral_speed - p.l_f * x.yaw_rate) * (1.0 / p.sigma_f),
        (p.l_r * x.yaw_rate - x.lateral_speed - speed * x.slip_rear) * (1.0 / p.sigma_r),
    )


@scalar
def lateral_acceleration(x: SingleTrackState, p: SingleTrack) -> float:
    """Lateral acceleration of the centre of gravity in m/s2 (tyre forces over mass)."""
    return (p.C_f * x.slip_front + p.C_r * x.slip_rear) * (1.0 / p.m)


@scalar
def kinematic_front_slip(x: SingleTrackState, tyre_angle: float, speed: float, p: SingleTrack) -> float:
    """Front slip in rad without relaxation, as row 2 of Eq. 10 prints it; needs speed > 0."""
    return tyre_angle - (x.lateral_speed + p.l_f * x.yaw_rate) * (1.0 / speed)


@scalar
def rack_torque(slip_front: float, p: SingleTrack) -> float:
    """M_rack in N m at the pinion (Eq. 9): C_f n_t a_f / i_s. Rack force is i_rp times this."""
    return p.C_f * p.n_t * (1.0 / p.i_s) * slip_front


@scalar
def rk4_mean(k0: float, k1: float, k2: float, k3: float, h: float) -> float:
    """Increment of a classical Runge-Kutta step of h seconds from its four slopes."""
    return (k0 + 2.0 * (k1 + k2) + k3) * (h * (1.0 / 6.0))


@scalar
def moved(x: SingleTrackState, h: float, k: SingleTrackState) -> SingleTrackState:
    """X + h k."""
    return SingleTrackState(
        x.lateral_speed + h * k.lateral_speed,
        x.yaw_rate + h * k.yaw_rate,
        x.slip_front + h * k.slip_front,
        x.slip_rear + h * k.slip_rear,
    )


@scalar
def moved_rk4(
    x: SingleTrackState,
    k0: SingleTrackState,
    k1: SingleTrackState,
    k2: SingleTrackState,
    k3: SingleTrackState,
    h: float,
) -> SingleTrackState:
    """The state after a classical Runge-Kutta step of h seconds."""
    return SingleTrackState(
        x.lateral_speed + rk4_mean(k0.lateral_speed, k1.lateral_speed, k2.lateral_speed, k3.lateral_speed, h),
        x.yaw_rate + rk4_mean(k0.yaw_rate, k1.yaw_rate, k2.yaw_rate, k3.yaw_rate, h),
        x.slip_front + rk4_mean(k0.slip_front, k1.slip_front, k2.slip_front, k3.slip_front, h),
        x.slip_rear + rk4_mean(k0.slip_rear, k1.slip_rear, k2.slip_rear, k3.slip_rear, h),
    )


@scalar
def single_track_step(
    x: SingleTrackState,
    angle_0: float,
    angle_1: float,
    angle_2: float,
    speed: float,
    p: SingleTrack,
    h: float,
) -> SingleTrackState:
    """State after h seconds with road-wheel angles in rad at start, middle and end of the step."""
    k0 = single_track_rates(x, angle_0, speed, p)
    k1 = single_track_rates(moved(x, 0.5 * h, k0), angle_1, speed, p)
    k2 = single_track_rates(moved(x, 0.5 * h, k1), angle_1, speed, p)
    k3 = single_track_rates(moved(x, h, k2), angle_2, speed, p)
    return moved_rk4(x, k0, k1, k2, k3, h)
