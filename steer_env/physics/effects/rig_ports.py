"""Where the effects of a bench motor enter: torques in N m that resist, friction level and wind-up, and play.

torque                     N m, resisting
friction_level, _travel    N m and rad: Dahl friction
half_gap, wheel_share      rad of play, and the share of J that lies behind it
"""

from __future__ import annotations

from steer_env.physics.effects.composed import Ports
from steer_env.physics.effects.rig_table import RIG_EFFECTS

_PORTS = Ports("rig", RIG_EFFECTS)
RIG_MECHANICAL, rig_row = _PORTS.effects, _PORTS.row

torque = _PORTS.at("torque")
friction_level = _PORTS.at("friction_level")
friction_travel = _PORTS.at("friction_travel")
half_gap = _PORTS.at("half_gap")
wheel_share = _PORTS.at("wheel_share")
