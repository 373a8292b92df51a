"""Where vehicle effects enter: one compiled sum per port over the catalogue's rows.

The parameters of all effects lie in one row of floats, ``EFFECT_ROW`` says where. Every port adds to what is there
without effects, so an absent effect changes nothing, to the bit. Where a row of None is handed in, the compiler
drops the port: an environment without effects pays nothing for them.

bar_angle, bar_slope       rad and rad/rad, what the column adds between wheel and torsion bar
bar_torque                 N m, what the torsion bar gives beyond c_tb twist
assist_input, _output      N m, what the basic assist sees less, and gives less
pinion_torque              N m, resisting at the pinion
pinion_friction_level      N m, beyond the Coulomb level of the pinion
column_friction_level      N m, on the wheel side of the bar
rack_torque                N m at the pinion, beyond the tyres'
rack_friction_level, _travel   N m and rad of pinion angle: Dahl friction of the rack's side
rack_angle, rack_ratio     rad of pinion angle, and factor - 1 of the torque, between pinion and rack
tyre_angle                 rad at the road wheel
trail                      factor - 1 of the steering trail
side_acceleration          m/s2 on the body
"""

from __future__ import annotations

from steer_env.physics.effects.composed import Ports
from steer_env.physics.effects.vehicle_table import VEHICLE_EFFECTS

_PORTS = Ports("vehicle", VEHICLE_EFFECTS)
MECHANICAL, EFFECT_ROW, effect_row = _PORTS.effects, _PORTS.layout, _PORTS.row

bar_angle = _PORTS.at("bar_angle")
bar_slope = _PORTS.at("bar_slope")
bar_torque = _PORTS.at("bar_torque")
assist_input = _PORTS.at("assist_input")
assist_output = _PORTS.at("assist_output")
pinion_torque = _PORTS.at("pinion_torque")
pinion_friction_level = _PORTS.at("pinion_friction_level")
column_friction_level = _PORTS.at("column_friction_level")
rack_torque = _PORTS.at("rack_torque")
rack_friction_level = _PORTS.at("rack_friction_level")
rack_friction_travel = _PORTS.at("rack_friction_travel")
rack_angle = _PORTS.at("rack_angle")
rack_ratio = _PORTS.at("rack_ratio")
tyre_angle = _PORTS.at("tyre_angle")
trail = _PORTS.at("trail")
side_acceleration = _PORTS.at("side_acceleration")
