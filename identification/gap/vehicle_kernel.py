"""The null model of a car's steering, and the same with effects, led by the measured steering angle.

    J_ref d'' + b_ref d' + M_rack + M_fric(d) = M_eff(M_tb),   M_tb = c_tb (delta_s - d) + b_tb (delta_s' - d')

(Eqs. 4, 6, 9, 13-15 of the paper, slip relaxed). Every port of the effect catalogue is asked where it belongs, so the
model with an effect is the null model plus the catalogue's own equation and nothing else.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from identification.frf import Floats
from steer_env.physics import vehicle
from steer_env.physics._jit import compiled, scalar
from steer_env.physics.assist import assist
from steer_env.physics.effects import vehicle_ports as ports
from steer_env.physics.effects.acting import (
    bar_torques,
    column_after,
    front_axle,
    given_by_assist,
    pinion_moment,
    scrub_after,
    seen_by_assist,
)
from steer_env.physics.friction import dahl_step
from steer_env.physics.vehicle import SingleTrack, SingleTrackState

RECORD = (
    "pinion_angle",
    "torsion_bar_torque",
    "column_torque",
    "rack_torque",
    "lateral_speed",
    "yaw_rate",
    "lateral_acceleration",
)


class Steering(NamedTuple):
    """Reference and torsion bar, SI, by the paper's names."""

    J_ref: float
    b_ref: float
    r: float
    sigma_assist: float
    M_fric_C: float
    c_fric: float
    c_tb: float
    b_tb: float


class State(NamedTuple):
    """Pinion motion in rad and rad/s, and the three Dahl torques in N m."""

    angle: float
    rate: float
    pinion_friction: float
    rack_friction: float
    column_friction: float


class Loads(NamedTuple):
    """What acts at one instant: torques in N m."""

    bar_torque: float
    passed_up: float
    rack_torque: float


@scalar
def assisted(M_tb: float, p: Steering, row: Any) -> float:
    """M_eff in N m: torsion-bar torque plus basic assist, as the effects leave it."""
    seen = seen_by_assist(M_tb, row)
    return M_tb + given_by_assist(seen, assist(seen, p.r, p.sigma_assist) - seen, row)


@scalar
def rates(
    start: State, angle: float, rate: float, track: SingleTrackState, steer: float, steer_rate: float, speed: float,
    p: Steering, car: SingleTrack, row: Any,
) -> tuple[float, SingleTrackState, Loads]:  # fmt: skip
    """Pinion acceleration in rad/s2, the car's derivatives, and the loads, reached one way from ``start``."""
    M_tb, passed_up = bar_torques(steer, steer_rate, angle, rate, p.c_tb, p.b_tb, row)
    x = pinion_moment(angle, rate, speed)
    travel = angle - start.angle
    level = p.M_fric_C + ports.pinion_friction_level(x, row)
    pinion_friction = dahl_step(start.pinion_friction, travel, level, p.c_fric)
    rack_friction = scrub_after(start.rack_friction, travel, x, row)
    slip = track.slip_front
    axle = front_axle(
        angle, rate, speed, slip, car.C_f * slip, vehicle.rack_torque(slip, car), rack_friction, 1.0 / car.i_s, row
    )
    resist = axle.M_rack + pinion_friction + ports.pinion_torque(x, row) + p.b_ref * rate
    acceleration = (assisted(M_tb, p, row) - resist) * (1.0 / p.J_ref)
    drift = vehicle.single_track_rates(track, axle.tyre_angle, speed, car)
    pulled = SingleTrackState(
        drift.lateral_speed + axle.side_acceleration, drift.yaw_rate, drift.slip_front, drift.slip_rear
    )
    return acceleration, pulled, Loads(M_tb, passed_up, axle.M_sensed)


@compiled
def rollout(
    steer: Floats, steer_rate: Floats, h: float, every: int, speed: float, p: Steering, car: SingleTrack, row: Any
) -> Floats:
    """Record [n, len(RECORD)] every ``every`` steps of h seconds; inputs in rad and rad/s at steps and midpoints.

    Classical Runge-Kutta with the four stages as a loop; Dahl friction takes its exact value at each stage's own
    displacement. ``row`` holds the effects' parameters (``vehicle_ports.effect_row``) or is None.
    """
    steps = (steer.size - 1) // 2
    out = np.zeros((steps // every + 1, len(RECORD)))
    state = State(steer[0], 0.0, 0.0, 0.0, 0.0)
    track = SingleTrackState(0.0, 0.0, 0.0, 0.0)
    for k in range(steps + 1):
        go_x = go_v = slope_x = slope_v = 0.0
        slope_t = SingleTrackState(0.0, 0.0, 0.0, 0.0)
        go_t = SingleTrackState(0.0, 0.0, 0.0, 0.0)
        for stage in range(4):
            i = min(2 * k + (stage + 1) // 2, steer.size - 1)
            reach = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            weight = (1.0 if stage in (0, 3) else 2.0) * (h * (1.0 / 6.0))
            v = state.rate + reach * slope_v
            a, slope_t, loads = rates(
                state, state.angle + reach * slope_x, v, vehicle.moved(track, reach, slope_t), steer[i],
                steer_rate[i], speed, p, car, row,
            )  # fmt: skip
            slope_x, slope_v = v, a
            if stage == 0 and k % every == 0:
                j = k // every
                out[j, 0], out[j, 1] = state.angle, loads.bar_torque
                out[j, 2], out[j, 3] = loads.passed_up + state.column_friction, loads.rack_torque
                out[j, 4], out[j, 5] = track.lateral_speed, track.yaw_rate
                out[j, 6] = vehicle.lateral_acceleration(track, car)
            go_x += weight * v
            go_v += weight * a
            go_t = vehicle.moved(go_t, weight, slope_t)
        if k == steps:
            break
        angle, rate = state.angle + go_x, state.rate + go_v
        track = vehicle.moved(track, 1.0, go_t)
        x = pinion_moment(angle, rate, speed)
        level = p.M_fric_C + ports.pinion_friction_level(x, row)
        turned = steer[2 * k + 2] - steer[2 * k]
        state = State(
            angle,
            rate,
            dahl_step(state.pinion_friction, go_x, level, p.c_fric),
            scrub_after(state.rack_friction, go_x, x, row),
            column_after(state.column_friction, turned, steer[2 * k + 2], row),
        )
    return out
