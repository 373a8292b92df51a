"""What a design takes from a plant: nominal numbers, the loop's delay, the torsion-bar mode and its notch."""

from __future__ import annotations

import math
from typing import Any

from controllers.blocks import Notch, notch
from controllers.schedule import schedule_of
from steer_env.physics.motor import lag_decay
from steer_env.plants import Plant, Reference

ACTIVE_DAMPING_LIMIT = 1.5  # rad of phase lost in T_d; a mode beyond it is notched, not damped
NOTCH_DEPTH, NOTCH_WIDTH = 0.1, 1.3  # holds c_tb within 30 % and J_pin within 25 % of nominal
NOTCH_HAND = 0.03  # kg m2 on the wheel that the notch is tuned for; arms move the mode by 6 %


# dM_eff/dM_tb beyond which an angle law yields; found by eigenvalues (experiments.robustness).
SLOPE_LIMIT_RACK, SLOPE_LIMIT_FREE = 12.0, 8.0
SEEN_COMMANDS = 4  # periods of past commands in an observation


def hardware_of(plant: Plant, reference: Reference, period: float) -> dict[str, Any]:
    """Fields that most parameter records begin with: the reference over speed, lower body and motor."""
    s = plant.steering
    return {
        "schedule": schedule_of(reference),
        "period": period,
        "motor_ratio": s.motor_ratio,
        "rack_share": plant.rack_share,
        "J_pin": s.J_pin,
        "b_pin": s.b_pin,
        "M_fric": s.M_fric,
        "c_fric": s.c_fric,
        "slope_limit": SLOPE_LIMIT_RACK if plant.rack_share > 0.5 else SLOPE_LIMIT_FREE,
        "prediction": total_delay(plant, period),
        "damping_prediction": total_delay(plant, period),
        "command_age": min(1.0 + plant.sensors.angle_delay + plant.motor.dead_time, SEEN_COMMANDS),
        "motor_decay": lag_decay(plant.motor.bandwidth_Hz, period),
    }


def total_delay(plant: Plant, period: float) -> float:
    """T_d in s: sensor latency, computation, dead time, hold and current loop."""
    sensors, motor = plant.sensors, plant.motor
    periods = max(sensors.angle_delay, sensors.torque_delay) + motor.dead_time + 1.5
    return periods * period + 1.0 / (2.0 * math.pi * motor.bandwidth_Hz)


def bar_frequency(plant: Plant) -> float:
    """Torsion-bar mode in rad/s: wheel with a light hand against the lower body."""
    s = plant.steering
    return math.sqrt(s.c_tb * (1.0 / s.J_pin + 1.0 / (s.J_s + NOTCH_HAND)))


def bar_notch(plant: Plant, period: float) -> Notch:
    """Notch at the torsion-bar (torque sensor) mode where it is too fast to be damped actively."""
    frequency = bar_frequency(plant)
    if frequency * total_delay(plant, period) <= ACTIVE_DAMPING_LIMIT:
        return Notch()
    return notch(frequency, NOTCH_DEPTH, NOTCH_WIDTH, period)
