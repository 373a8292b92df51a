"""Where the effects of a drive's log enter.

torque                     N m, beside centring and damping
angle                      rad, beside the measured angle in the centring torque
friction_level, _travel    N m and rad: Dahl friction
"""

from __future__ import annotations

from steer_env.physics.effects.composed import Ports
from steer_env.physics.effects.drive_table import DRIVE_EFFECTS

_PORTS = Ports("drive", DRIVE_EFFECTS)
DRIVE_MECHANICAL, drive_row = _PORTS.effects, _PORTS.row

torque = _PORTS.at("torque")
angle = _PORTS.at("angle")
friction_level = _PORTS.at("friction_level")
friction_travel = _PORTS.at("friction_travel")
