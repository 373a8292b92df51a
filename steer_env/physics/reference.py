"""The haptic reference (Eqs. 4 and 10) and its two generators (Fig. 2).

    J_ref d'' + b_ref d' + M_rack + c_extra d + M_ref,fric = M_eff,   M_eff = K_assist(M_tb) M_tb

Admittance: torsion-bar torque in, pinion motion out. Impedance: pinion motion in, torsion-bar
torque out. Both use the same M_rack and the same friction, so one undoes the other.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics import vehicle
from steer_env.physics._jit import scalar
from steer_env.physics.assist import assist, inverse_assist
from steer_env.physics.friction import dahl_step
from steer_env.physics.vehicle import SingleTrack, SingleTrackState
from steer_env.units import Quantity

_T2 = "Table 2, 75 km/h"
_T3 = "Table 3, 75 km/h"


class ReferenceParameters(NamedTuple):
    """One speed's reference with its single track; defaults: published row of 75 km/h, set R."""

    J_ref: Annotated[float, Quantity("kg m2", "reference inertia", 1e-3, 1.0, _T2)] = 0.0613
    b_ref: Annotated[float, Quantity("N m s/rad", "reference damping", -5.0, 20.0, _T2)] = 1.006
    k_gain: Annotated[float, Quantity("-", "linearised basic assist", 0.0, 60.0, _T2)] = 2.647
    M_fric_C: Annotated[float, Quantity("N m", "Coulomb friction at the pinion", 0.0, 20.0, _T3)] = 2.494
    c_fric: Annotated[float, Quantity("N m/rad", "Dahl stiffness", 1.0, 1e5, "assumption")] = 200.0
    r: Annotated[float, Quantity("-", "c_pin_off / c_pin_on", 0.0, 1.0, _T3)] = 6.979 / 35.482
    sigma: Annotated[float, Quantity("N m", "width of the on-centre region", 0.1, 20.0, "assumption")] = 1.8
    c_extra: Annotated[
        float,
        Quantity("N m/rad", "pinion stiffness beyond the single track's", -50.0, 50.0, "assumption: none"),
    ] = 0.0
    relaxed: Annotated[float, Quantity("-", "1: M_rack from relaxed slip, 0: kinematic (Eq. 10)", 0, 1, "Eq. 10")] = 0.0
    linear: Annotated[float, Quantity("-", "1: K = 1 + k_gain and no friction, 0: Eqs. 14-15", 0, 1, "Fig. 9")] = 0.0
    m: Annotated[float, Quantity("kg", "vehicle mass", 500.0, 10000.0, "set R")] = SingleTrack().m
    l_f: Annotated[float, Quantity("m", "centre of gravity to front axle", 0.3, 5.0, "set R")] = SingleTrack().l_f
    l_r: Annotated[float, Quantity("m", "centre of gravity to rear axle", 0.3, 5.0, "set R")] = SingleTrack().l_r
    J_z: Annotated[float, Quantity("kg m2", "yaw inertia", 300.0, 60000.0, _T2)] = SingleTrack().J_z
    C_f: Annotated[float, Quantity("N/rad", "front axle cornering stiffness", 1e4, 1e6, _T2)] = SingleTrack().C_f
    C_r: Annotated[float, Quantity("N/rad", "rear axle cornering stiffness", 1e4, 1e6, _T2)] = SingleTrack().C_r
    sigma_f: Annotated[float, Quantity("m", "front relaxation length", 0.005, 3.0, _T2)] = SingleTrack().sigma_f
    sigma_r: Annotated[float, Quantity("m", "rear relaxation length", 0.005, 3.0, _T2)] = SingleTrack().sigma_r
    n_t: Annotated[float, Quantity("m", "steering trail", 0.0, 0.5, _T2)] = SingleTrack().n_t
    i_s: Annotated[float, Quantity("-", "pinion angle / road-wheel angle", 5.0, 30.0, "set R")] = SingleTrack().i_s


class ReferenceState(NamedTuple):
    """State of a generator: pinion angle (rad), rate (rad/s), car, friction and M_eff (N m)."""

    pinion_angle: float
    pinion_rate: float
    lateral_speed: float
    yaw_rate: float
    slip_front: float
    slip_rear: float
    friction: float
    effective_torque: float


@scalar
def single_track_of(p: ReferenceParameters) -> SingleTrack:
    """The vehicle inside the reference."""
    return SingleTrack(p.m, p.l_f, p.l_r, p.J_z, p.C_f, p.C_r, p.sigma_f, p.sigma_r, p.n_t, p.i_s)


@scalar
def reference_load(angle: float, x: SingleTrackState, speed: float, p: ReferenceParameters) -> float:
    """M_rack + c_extra d in N m; slip kinematic (row 2 of Eq. 10) or relaxed (Eq. 9)."""
    track = single_track_of(p)
    kinematic = vehicle.kinematic_front_slip(x, angle * (1.0 / p.i_s), speed, track)
    slip = x.slip_front if p.relaxed > 0.5 else kinematic
    return vehicle.rack_torque(slip, track) + p.c_extra * angle


class TrackMap(NamedTuple):
    """What a period does to the single track: each new state is the sum of the old ones times these.

    One speed, one period; states are lateral speed, yaw rate, front and rear slip, SI. The pinion angle in rad runs
    straight from ``before`` to ``now``.
    """

    lateral_of_lateral: float
    yaw_of_lateral: float
    front_of_lateral: float
    rear_of_lateral: float
    lateral_of_yaw: float
    yaw_of_yaw: float
    front_of_yaw: float
    rear_of_yaw: float
    lateral_of_front: float
    yaw_of_front: float
    front_of_front: float
    rear_of_front: float
    lateral_of_rear: float
    yaw_of_rear: float
    front_of_rear: float
    rear_of_rear: float
    lateral_of_before: float
    yaw_of_before: float
    front_of_before: float
    rear_of_before: float
    lateral_of_now: float
    yaw_of_now: float
    front_of_now: float
    rear_of_now: float


@scalar
def track_after(
    x: SingleTrackState, angle_before: float, angle_now: float, speed: float, p: ReferenceParameters, dt: float
) -> SingleTrackState:
    """The single track dt seconds later, the pinion angle in rad running straight: two Runge-Kutta steps."""
    a0, a2 = angle_before * (1.0 / p.i_s), angle_now * (1.0 / p.i_s)
    a1 = 0.5 * (a0 + a2)
    half = vehicle.single_track_step(x, a0, 0.5 * (a0 + a1), a1, speed, single_track_of(p), 0.5 * dt)
    return vehicle.single_track_step(half, a1, 0.5 * (a1 + a2), a2, speed, single_track_of(p), 0.5 * dt)


@scalar
def track_map_column(k: int, speed: float, p: ReferenceParameters, dt: float) -> SingleTrackState:
    """Column ``k`` of the TrackMap over dt seconds: ``track_after`` is linear, so one in each variable shows it."""
    x = SingleTrackState(
        1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0, 1.0 if k == 3 else 0.0
    )
    return track_after(x, 1.0 if k == 4 else 0.0, 1.0 if k == 5 else 0.0, speed, p, dt)


def track_map(speed: float, p: ReferenceParameters, dt: float) -> TrackMap:
    """The six columns, from Python."""
    return TrackMap(*(value for k in range(6) for value in track_map_column(k, speed, p, dt)))


@scalar
def mapped(x: SingleTrackState, before: float, now: float, m: TrackMap) -> SingleTrackState:
    """The single track a period later; the pinion angle in rad ran from ``before`` to ``now``."""
    vy, r, front, rear = x.lateral_speed, x.yaw_rate, x.slip_front, x.slip_rear
    return SingleTrackState(
        m.lateral_of_lateral * vy
        + m.lateral_of_yaw * r
        + m.lateral_of_front * front
        + m.lateral_of_rear * rear
        + m.lateral_of_before * before
        + m.lateral_of_now * now,
        m.yaw_of_lateral * vy
        + m.yaw_of_yaw * r
        + m.yaw_of_front * front
        + m.yaw_of_rear * rear
        + m.yaw_of_before * before
        + m.yaw_of_now * now,
        m.front_of_lateral * vy
        + m.front_of_yaw * r
        + m.front_of_front * front
        + m.front_of_rear * rear
        + m.front_of_before * before
        + m.front_of_now * now,
        m.rear_of_lateral * vy
        + m.rear_of_yaw * r
        + m.rear_of_front * front
        + m.rear_of_rear * rear
        + m.rear_of_before * before
        + m.rear_of_now * now,
    )


@scalar
def reference_rates(
    angle: float,
    rate: float,
    x: SingleTrackState,
    M_eff: float,
    M_fric: float,
    speed: float,
    p: ReferenceParameters,
) -> tuple[float, SingleTrackState]:
    """Pinion acceleration in rad/s2 (Eq. 4) and the single track's derivatives (Eq. 6)."""
    acceleration = (M_eff - M_fric - reference_load(angle, x, speed, p) - p.b_ref * rate) * (1.0 / p.J_ref)
    return acceleration, vehicle.single_track_rates(x, angle * (1.0 / p.i_s), speed, single_track_of(p))


@scalar
def effective_torque(M_tb: float, p: ReferenceParameters) -> float:
    """M_eff in N m: Eq. 14, or the linearised assist."""
    if p.linear > 0.5:
        return (1.0 + p.k_gain) * M_tb
    return assist(M_tb, p.r, p.sigma)


@scalar
def torsion_bar_torque_for(M_eff: float, p: ReferenceParameters) -> float:
    """M_tb in N m whose assist is M_eff: the inverse of ``effective_torque``."""
    if p.linear > 0.5:
        return M_eff * (1.0 / (1.0 + p.k_gain))
    return inverse_assist(M_eff, p.r, p.sigma)


@scalar
def impedance_step(
    angle: float,
    rate: float,
    acceleration: float,
    x: ReferenceState,
    speed: float,
    p: ReferenceParameters,
    period: TrackMap,
) -> tuple[float, float, ReferenceState]:
    """Impedance generator (Fig. 2b): (M_tb_ref, M_eff, state) at a motion one ``period`` after ``x``.

    The vehicle moves on with the angle running straight from the last one (``track_map`` at ``speed``);
    friction follows the displacement exactly.
    """
    before = SingleTrackState(x.lateral_speed, x.yaw_rate, x.slip_front, x.slip_rear)
    track = mapped(before, x.pinion_angle, angle, period)
    friction = _friction_at(x, angle, p)
    M_eff = p.J_ref * acceleration + p.b_ref * rate + reference_load(angle, track, speed, p) + friction
    M_tb = torsion_bar_torque_for(M_eff, p)
    new = ReferenceState(
        angle,
        rate,
        track.lateral_speed,
        track.yaw_rate,
        track.slip_front,
        track.slip_rear,
        friction,
        M_eff,
    )
    return M_tb, M_eff, new


@scalar
def admittance_step(
    M_tb: float, x: ReferenceState, speed: float, p: ReferenceParameters, dt: float
) -> tuple[float, ReferenceState]:
    """Admittance generator (Fig. 2a): (pinion acceleration, new state) after dt seconds.

    The step ends at torque ``M_tb``. Effective torque runs straight from the last one, so the
    result is not late by half a step. Two Runge-Kutta steps.
    """
    M_eff = effective_torque(M_tb, p)
    middle = 0.5 * (x.effective_torque + M_eff)
    half = _admittance_substep(x, x.effective_torque, middle, speed, p, 0.5 * dt)
    new = _admittance_substep(half, middle, M_eff, speed, p, 0.5 * dt)
    track = SingleTrackState(new.lateral_speed, new.yaw_rate, new.slip_front, new.slip_rear)
    acceleration, _ = reference_rates(new.pinion_angle, new.pinion_rate, track, M_eff, new.friction, speed, p)
    return acceleration, new


@scalar
def _friction_at(x: ReferenceState, angle: float, p: ReferenceParameters) -> float:
    if p.linear > 0.5:
        return 0.0
    return dahl_step(x.friction, angle - x.pinion_angle, p.M_fric_C, p.c_fric)


@scalar
def _admittance_substep(
    x: ReferenceState, M0: float, M2: float, speed: float, p: ReferenceParameters, h: float
) -> ReferenceState:
    """One classical Runge-Kutta step of Eq. 4 with Eq. 6; friction is exact at every stage."""
    M1 = 0.5 * (M0 + M2)
    track = SingleTrackState(x.lateral_speed, x.yaw_rate, x.slip_front, x.slip_rear)
    q0, w0 = x.pinion_angle, x.pinion_rate
    a0, v0 = reference_rates(q0, w0, track, M0, x.friction, speed, p)
    q1, w1 = q0 + 0.5 * h * w0, w0 + 0.5 * h * a0
    a1, v1 = reference_rates(q1, w1, vehicle.moved(track, 0.5 * h, v0), M1, _friction_at(x, q1, p), speed, p)
    q2, w2 = q0 + 0.5 * h * w1, w0 + 0.5 * h * a1
    a2, v2 = reference_rates(q2, w2, vehicle.moved(track, 0.5 * h, v1), M1, _friction_at(x, q2, p), speed, p)
    q3, w3 = q0 + h * w2, w0 + h * a2
    a3, v3 = reference_rates(q3, w3, vehicle.moved(track, h, v2), M2, _friction_at(x, q3, p), speed, p)
    angle = q0 + vehicle.rk4_mean(w0, w1, w2, w3, h)
    rate = w0 + vehicle.rk4_mean(a0, a1, a2, a3, h)
    t = vehicle.moved_rk4(track, v0, v1, v2, v3, h)
    friction = _friction_at(x, angle, p)
    return ReferenceState(angle, rate, t.lateral_speed, t.yaw_rate, t.slip_front, t.slip_rear, friction, M2)
