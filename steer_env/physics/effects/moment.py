"""What an effect may depend on in a vehicle's steering, at one instant."""

from __future__ import annotations

from typing import NamedTuple


class Moment(NamedTuple):
    """SI: rad, rad/s, N m, N, m/s. Fields that are not known yet where a port is asked are zero.

    ``twist`` is the angle over the torsion bar and ``bar_stiffness`` its c_tb; ``assist_torque`` is what the basic
    assist adds to the torsion-bar torque; ``rack_torque`` is the tyres' share of M_rack at the pinion.
    """

    steering_angle: float = 0.0
    pinion_angle: float = 0.0
    pinion_rate: float = 0.0
    twist: float = 0.0
    bar_stiffness: float = 0.0
    torsion_bar_torque: float = 0.0
    assist_torque: float = 0.0
    speed: float = 0.0
    front_slip: float = 0.0
    front_force: float = 0.0
    rack_torque: float = 0.0
