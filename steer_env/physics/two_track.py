"""Two-track vehicle with roll, relaxed tyres, load transfer, compliance and roll steer.

The road is flat and the speed is held by an ideal drive. Lateral speed is taken on the roll axis
below the mass centre, lateral acceleration at the mass centre itself (as an IMU unit refers them).
Load is transferred through the roll springs and dampers only (roll centres on the ground), which
puts all of it behind the roll motion. Signs follow ISO 8855: positive roll leans the body to the
right, as in a left turn.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.two_track_parameters import TwoTrack
from steer_env.physics.tyre import pneumatic_trail, side_force
from steer_env.units import GRAVITY

_HALF = 0.5


class TwoTrackState(NamedTuple):
    """Lateral speed, yaw rate, roll and its rate (SI), relaxed slips (tan) of the four tyres."""

    lateral_speed: float
    yaw_rate: float
    roll: float
    roll_rate: float
    slip_fl: float
    slip_fr: float
    slip_rl: float
    slip_rr: float


class Loads(NamedTuple):
    """Wheel loads in N: front left, front right, rear left, rear right."""

    fl: float
    fr: float
    rl: float
    rr: float


class Contact(NamedTuple):
    """Side forces (N), pneumatic trails (m), steer angles (rad) of front wheels and rear axle."""

    force_fl: float
    force_fr: float
    force_rl: float
    force_rr: float
    trail_fl: float
    trail_fr: float
    trail_rl: float
    trail_rr: float
    steer_fl: float
    steer_fr: float
    steer_r: float


@scalar
def wheel_loads(x: TwoTrackState, p: TwoTrack) -> Loads:
    """Static loads plus what roll springs and dampers carry over; the sum is always the weight."""
    per_length = _HALF * p.m * GRAVITY / (p.l_f + p.l_r)
    transfer_f = (p.c_roll_f * x.roll + p.b_roll_f * x.roll_rate) / p.track_f
    transfer_r = (p.c_roll_r * x.roll + p.b_roll_r * x.roll_rate) / p.track_r
    front = per_length * p.l_r
    rear = per_length * p.l_f
    return Loads(front - transfer_f, front + transfer_f, rear - transfer_r, rear + transfer_r)


@scalar
def ackermann_slope(tyre_angle: float, p: TwoTrack) -> float:
    """How much faster the inner wheel steers than the mean of both (-, signed as the angle)."""
    return p.ackermann * p.track_f / (p.l_f + p.l_r) * tyre_angle


@scalar
def contact(x: TwoTrackState, tyre_angle: float, p: TwoTrack) -> Contact:
    """Forces and steer angles; compliance and roll steer take from the pinion's ``tyre_angle``."""
    load = wheel_loads(x, p)
    force_fl = side_force(x.slip_fl, load.fl, p.front)
    force_fr = side_force(x.slip_fr, load.fr, p.front)
    force_rl = side_force(x.slip_rl, load.rl, p.rear)
    force_rr = side_force(x.slip_rr, load.rr, p.rear)
    spread = _HALF * ackermann_slope(tyre_angle, p) * tyre_angle
    mean = tyre_angle - p.compliance_f * (force_fl + force_fr) - p.roll_steer_f * x.roll
    return Contact(
        force_fl,
        force_fr,
        force_rl,
        force_rr,
        pneumatic_trail(x.slip_fl, load.fl, p.front),
        pneumatic_trail(x.slip_fr, load.fr, p.front),
        pneumatic_trail(x.slip_rl, load.rl, p.rear),
        pneumatic_trail(x.slip_rr, load.rr, p.rear),
        mean + spread,
        mean - spread,
        -p.compliance_r * (force_rl + force_rr) - p.roll_steer_r * x.roll,
    )


@scalar
def rack_torque_of(c: Contact, tyre_angle: float, p: TwoTrack) -> float:
    """M_rack in N m at the pinion, by virtual work of both front wheels' steering moments."""
    slope = ackermann_slope(tyre_angle, p)
    left = c.force_fl * (p.mechanical_trail + c.trail_fl) * (1.0 + slope)
    right = c.force_fr * (p.mechanical_trail + c.trail_fr) * (1.0 - slope)
    return (left + right) * (1.0 / p.i_s)


@scalar
def rack_torque(x: TwoTrackState, tyre_angle: float, p: TwoTrack) -> float:
    """M_rack in N m at the pinion; the rack force is i_rp times as much."""
    return rack_torque_of(contact(x, tyre_angle, p), tyre_angle, p)


@scalar
def slip_rate(slip: float, steer: float, across: float, along: float, relaxation: float) -> float:
    """Rate of a relaxed slip in 1/s: sigma a' = -(speed across the wheel) - (speed along it) a."""
    c = math.cos(steer)
    s = math.sin(steer)
    return (along * s - across * c - (along * c + across * s) * slip) / relaxation


@scalar
def body_rates(x: TwoTrackState, c: Contact, disturbance: float, p: TwoTrack) -> tuple[float, float, float, float]:
    """Return lateral acceleration of roll axis and mass centre (m/s2), yaw and roll acceleration.

    ``disturbance``: side wind in N at the mass centre.
    """
    lateral_fl = c.force_fl * math.cos(c.steer_fl)
    lateral_fr = c.force_fr * math.cos(c.steer_fr)
    lateral_r = (c.force_rl + c.force_rr) * math.cos(c.steer_r)
    along = c.force_fl * math.sin(c.steer_fl) - c.force_fr * math.sin(c.steer_fr)
    along_r = (c.force_rl - c.force_rr) * math.sin(c.steer_r)
    aligning = c.force_fl * c.trail_fl + c.force_fr * c.trail_fr + c.force_rl * c.trail_rl + c.force_rr * c.trail_rr
    moment = p.l_f * (lateral_fl + lateral_fr) - p.l_r * lateral_r - aligning
    moment += _HALF * (p.track_f * along + p.track_r * along_r)
    force = lateral_fl + lateral_fr + lateral_r + disturbance
    coupling = p.m_s * p.roll_arm
    inertia = p.J_x + coupling * p.roll_arm
    spring = (coupling * GRAVITY - p.c_roll_f - p.c_roll_r) * x.roll - (p.b_roll_f + p.b_roll_r) * x.roll_rate
    inverse = 1.0 / (p.m * inertia - coupling * coupling)
    axis = (inertia * force + coupling * spring) * inverse
    return axis, force / p.m, moment / p.J_z, (p.m * spring + coupling * force) * inverse


@scalar
def two_track_rates(
    x: TwoTrackState, tyre_angle: float, speed: float, disturbance: float, p: TwoTrack
) -> tuple[TwoTrackState, float, float]:
    """Return (time derivatives, lateral acceleration of the mass centre in m/s2, M_rack in N m).

    ``speed`` in m/s is held; ``disturbance`` is side wind in N.
    """
    c = contact(x, tyre_angle, p)
    axis, a_y, yaw_acceleration, roll_acceleration = body_rates(x, c, disturbance, p)
    across_f = x.lateral_speed + p.l_f * x.yaw_rate
    across_r = x.lateral_speed - p.l_r * x.yaw_rate
    swing_f = _HALF * p.track_f * x.yaw_rate
    swing_r = _HALF * p.track_r * x.yaw_rate
    rates = TwoTrackState(
        axis - speed * x.yaw_rate,
        yaw_acceleration,
        x.roll_rate,
        roll_acceleration,
        slip_rate(x.slip_fl, c.steer_fl, across_f, speed - swing_f, p.front.relaxation),
        slip_rate(x.slip_fr, c.steer_fr, across_f, speed + swing_f, p.front.relaxation),
        slip_rate(x.slip_rl, c.steer_r, across_r, speed - swing_r, p.rear.relaxation),
        slip_rate(x.slip_rr, c.steer_r, across_r, speed + swing_r, p.rear.relaxation),
    )
    return rates, a_y, rack_torque_of(c, tyre_angle, p)
