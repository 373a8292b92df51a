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

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from steer_env.physics._jit import named, scalar
from steer_env.physics.effects.effect import Effect, Port
from steer_env.physics.effects.moment import Moment
from steer_env.physics.effects.vehicle_table import VEHICLE_EFFECTS
from steer_env.physics.rows import Layout, Row

MECHANICAL = {name: effect for name, effect in VEHICLE_EFFECTS.items() if effect.ports}
EFFECT_ROW = Layout(**{name: effect.parameters for name, effect in MECHANICAL.items()})


def effect_row(present: Mapping[str, Mapping[str, float]]) -> Row:
    """The row in which the effects in ``present`` (name -> parameters) are on; sensor effects have no place in it."""
    row = np.zeros(EFFECT_ROW.size)
    for name, effect in MECHANICAL.items():
        row[EFFECT_ROW[name]] = effect.at(present.get(name, {}))
    return row


def _nothing(x: Moment, row: Any) -> float:
    return 0.0


def _plus(before: Callable[..., float], load: Callable[[Row], Any], port: Port, name: str) -> Callable[..., float]:
    def total(x: Moment, row: Any) -> float:
        return before(x, row) + port(x, load(row))

    return scalar(named(total, name, port, before))


def port_of(name: str, effects: Mapping[str, Effect] = MECHANICAL) -> Callable[[Moment, Any], float]:
    """(moment, row or None) -> what all effects together add at a port."""
    total: Callable[..., float] = scalar(_nothing)
    for effect in effects.values():
        if name in effect.ports:
            total = _plus(total, EFFECT_ROW.loader(effect.name), effect.ports[name], effect.name)

    def at_port(x: Moment, row: Any) -> float:
        if row is None:
            return 0.0
        return total(x, row)

    return scalar(named(at_port, name))


bar_angle = port_of("bar_angle")
bar_slope = port_of("bar_slope")
bar_torque = port_of("bar_torque")
assist_input = port_of("assist_input")
assist_output = port_of("assist_output")
pinion_torque = port_of("pinion_torque")
pinion_friction_level = port_of("pinion_friction_level")
column_friction_level = port_of("column_friction_level")
rack_torque = port_of("rack_torque")
rack_friction_level = port_of("rack_friction_level")
rack_friction_travel = port_of("rack_friction_travel")
rack_angle = port_of("rack_angle")
rack_ratio = port_of("rack_ratio")
tyre_angle = port_of("tyre_angle")
trail = port_of("trail")
side_acceleration = port_of("side_acceleration")
