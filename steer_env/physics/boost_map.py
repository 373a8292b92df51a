"""Production-like open-loop EPAS control.

A boost table, active damping, friction and inertia compensation.

The unit reads the torsion-bar torque and the pinion angle once per period and commands a torque; it
follows no reference. All its numbers are scheduled on speed. The boost table has knots every 0.5 N
m with straight lines between them, as a control unit stores it. Its values are sampled from a
smooth law whose gain 1/h, h(M) = (1 - r) exp(-M^2 / 2 w^2) + r, runs from 1 on centre to 1/r off
centre (the shape of Eqs. 13-14 of the paper), so that an off-centre stiffness exists that an
identification can be judged against; between knots the table is not that law.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.units import Quantity, from_kmh

KNOT_STEP = 0.5  # N m between two knots of the boost table
KNOTS = 25  # from 0 to 12 N m of torsion-bar torque; beyond the last knot the assist stays constant
RATE_SMOOTHING = 0.15  # rad/s at which friction compensation reaches 1/sqrt(2) of its level; assumption

Knots = tuple[float, ...]


class Calibration(NamedTuple):
    """What the engineers who tuned the car wrote down, by speed in km/h.

    All numbers are assumptions.

    They make the car resemble the paper's Tables 2 and 3: r falls with falling speed as c_off /
    c_on of Table 3 does (with a floor, so that the loop keeps its margin), damping is added at
    speed, friction is taken away when slow.
    """

    speed_kmh: Knots = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0, 105.0, 130.0)
    off_centre_ratio: Knots = (0.14, 0.14, 0.13, 0.135, 0.16, 0.19, 0.22, 0.26, 0.30)
    active_damping: Knots = (0.0, 0.0, 0.1, 0.25, 0.4, 0.55, 0.65, 0.75, 0.85)
    friction_compensation: Knots = (0.5, 0.5, 0.45, 0.4, 0.33, 0.25, 0.17, 0.1, 0.0)
    on_centre_width: Annotated[float, Quantity("N m", "w of the boost law", 0.5, 5.0, "field value 1.8")] = 1.8


class ControlLaw(NamedTuple):
    """The calibration at one speed and what does not depend on speed; torques act at the pinion."""

    knots: Knots
    active_damping: Annotated[float, Quantity("N m s/rad", "added damping", -5.0, 20.0, "calibration")]
    friction_compensation: Annotated[float, Quantity("N m", "level of friction taken away", 0.0, 5.0, "calibration")]
    inertia_compensation: Annotated[float, Quantity("kg m2", "inertia taken away", 0.0, 0.1, "assumption")] = 0.012
    rate_filter_Hz: Annotated[float, Quantity("Hz", "rate and acceleration filters", 1.0, 400.0, "assumption")] = 80.0
    friction_filter_Hz: Annotated[
        float,
        Quantity("Hz", "rate filter before the sign, against hunting", 0.5, 400.0, "assumption"),
    ] = 4.0
    lead_time: Annotated[float, Quantity("s", "lead of the phase compensation", 0.0, 0.05, "assumption")] = 0.0042
    lag_time: Annotated[float, Quantity("s", "lag of the phase compensation", 1e-4, 0.05, "assumption")] = 0.0020
    torque_limit: Annotated[float, Quantity("N m", "largest command", 1.0, 300.0, "assumption")] = 90.0


class ControlState(NamedTuple):
    """Memory of the filters, SI."""

    angle: float
    rate: float
    slow_rate: float
    acceleration: float
    slow_torque: float


@scalar
def smooth_boost(torque: float, r: float, width: float) -> float:
    """Assist in N m of the smooth law that the table samples: M / h(M) - M, odd and increasing."""
    ratio = torque / width
    return torque / ((1.0 - r) * math.exp(-0.5 * ratio * ratio) + r) - torque


@scalar
def boost_torque(torque: float, knots: Knots) -> float:
    """Assist in N m at the pinion for a torsion-bar torque in N m.

    Straight lines between knots, odd, constant beyond the last knot.
    """
    place = min(abs(torque) * (1.0 / KNOT_STEP), KNOTS - 1.0)
    low = min(int(place), KNOTS - 2)
    value = knots[low] + (place - low) * (knots[low + 1] - knots[low])
    return math.copysign(value, torque)


@scalar
def low_pass(value: float, target: float, frequency_Hz: float, dt: float) -> float:
    """First-order low-pass after a step of dt seconds with a constant input."""
    return target + (value - target) * math.exp(-2.0 * math.pi * frequency_Hz * dt)


@scalar
def control_step(
    x: ControlState, torque: float, angle: float, law: ControlLaw, dt: float
) -> tuple[float, float, ControlState]:
    """Return (basic assist, compensation, new state), torques in N m at the pinion.

    ``torque`` in N m and ``angle`` in rad are sensor readings. Basic assist: the boost table behind
    a lead-lag that makes up for the motor's delay. Compensation: damping on the filtered rate,
    inertia on the filtered acceleration, friction on a smooth sign of a slowly filtered rate (a
    direct sign would drive the steering into hunting: it is a large negative damping around zero).
    """
    rate = low_pass(x.rate, (angle - x.angle) / dt, law.rate_filter_Hz, dt)
    acceleration = low_pass(x.acceleration, (rate - x.rate) / dt, law.rate_filter_Hz, dt)
    slow_rate = low_pass(x.slow_rate, rate, law.friction_filter_Hz, dt)
    slow_torque = torque + (x.slow_torque - torque) * math.exp(-dt / law.lag_time)
    led = torque + (law.lead_time / law.lag_time - 1.0) * (torque - slow_torque)
    basic = boost_torque(led, law.knots)
    sign = slow_rate / math.sqrt(slow_rate * slow_rate + RATE_SMOOTHING * RATE_SMOOTHING)
    compensation = (
        law.friction_compensation * sign + law.inertia_compensation * acceleration - law.active_damping * rate
    )
    total = min(max(basic + compensation, -law.torque_limit), law.torque_limit)
    return basic, total - basic, ControlState(angle, rate, slow_rate, acceleration, slow_torque)


def between(speed: float, speed_kmh: Knots, values: Knots) -> float:
    """Value at a speed in m/s: straight lines between the speeds of the table, constant outside."""
    last = len(speed_kmh) - 1
    for k in range(last):
        low, high = from_kmh(speed_kmh[k]), from_kmh(speed_kmh[k + 1])
        if speed < high:
            share = max(speed - low, 0.0) / (high - low)
            return values[k] + share * (values[k + 1] - values[k])
    return values[last]


def boost_table(calibration: Calibration) -> tuple[Knots, ...]:
    """The stored table: one row of knots in N m per speed of the calibration."""
    width = calibration.on_centre_width
    return tuple(
        tuple(smooth_boost(k * KNOT_STEP, r, width) for k in range(KNOTS)) for r in calibration.off_centre_ratio
    )


def law_at(speed: float, calibration: Calibration) -> ControlLaw:
    """The control law that the unit runs at a speed in m/s, interpolated in its tables."""
    c = calibration
    columns = zip(*boost_table(c), strict=True)
    return ControlLaw(
        tuple(between(speed, c.speed_kmh, column) for column in columns),
        between(speed, c.speed_kmh, c.active_damping),
        between(speed, c.speed_kmh, c.friction_compensation),
    )
