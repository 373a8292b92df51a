"""The effect catalogue: what every row must keep, and closed forms of single equations."""

import math

import numpy as np
import pytest

from steer_env.physics._jit import compiled
from steer_env.physics.effects import EFFECTS, drive_ports, rig_ports, vehicle_ports
from steer_env.physics.effects.backlash import LAID_ON, Backlash, lost_angle
from steer_env.physics.effects.drive_effects import DriveMoment
from steer_env.physics.effects.moment import Moment, at_rack
from steer_env.physics.effects.pneumatic_trail_drop import PneumaticTrailDrop, factor
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.physics.effects.tyre_scrub import TyreScrub, level
from steer_env.physics.effects.universal_joint import UniversalJoint, angle, slope
from steer_env.physics.effects.variable_ratio import VariableRatio
from steer_env.physics.effects.variable_ratio import angle as ratio_angle
from steer_env.physics.effects.variable_ratio import factor as ratio_factor
from steer_env.units import quantities

ROWS = [(kind, name) for kind, table in EFFECTS.items() for name in table]
# The ids that gap.json uses, to the letter.
IDS = {
    "vehicle": {
        "jacking_torque", "tyre_scrub", "suspension_compliance", "pneumatic_trail_drop", "road_crown", "backlash",
        "torsion_bar_nonlinearity", "universal_joint", "variable_ratio", "torque_ripple", "stribeck_friction",
        "column_friction", "assist_deadzone", "assist_saturation", "latency_imu", "latency_pinion", "latency_torque",
        "torque_gain", "torque_offset", "angle_offset", "yaw_gain", "ay_gain",
    },
    "rig": {
        "coulomb_friction", "stribeck_friction", "asymmetric_friction", "presliding_friction", "gravity_unbalance",
        "torque_ripple", "command_latency", "backlash", "torque_offset", "torque_gain", "quadratic_drag",
        "spring_centering",
    },
    "drive": {
        "coulomb_friction", "presliding_friction", "torque_offset_drift", "angle_offset", "latency_torque",
        "stiffness_saturation",
    },
}  # fmt: skip
VEHICLE_PORTS = (
    vehicle_ports.bar_angle, vehicle_ports.bar_slope, vehicle_ports.bar_torque, vehicle_ports.assist_input,
    vehicle_ports.assist_output, vehicle_ports.pinion_torque, vehicle_ports.pinion_friction_level,
    vehicle_ports.column_friction_level, vehicle_ports.rack_torque, vehicle_ports.rack_friction_level,
    vehicle_ports.rack_friction_travel, vehicle_ports.rack_angle, vehicle_ports.rack_ratio, vehicle_ports.tyre_angle,
    vehicle_ports.trail, vehicle_ports.side_acceleration,
)  # fmt: skip
LIVELY = Moment(0.4, 0.35, 1.2, 0.04, 115.0, 3.0, 12.0, 9.0, 0.03, 3500.0, 7.0)


def present(kind: str, name: str) -> dict[str, dict[str, float]]:
    effect = EFFECTS[kind][name]
    return {name: effect.at(effect.probes[-1])._asdict()}


def test_ids_are_the_contract() -> None:
    """Catches a renamed effect, which readers of gap.json would not find."""
    assert {kind: set(table) for kind, table in EFFECTS.items()} == IDS


@pytest.mark.parametrize(("kind", "name"), ROWS)
def test_row_is_complete(kind: str, name: str) -> None:
    """Units for every field, plausible inside the valid range, probes and amplitude that exist."""
    effect = EFFECTS[kind][name]
    ranges = quantities(effect.parameters)
    assert effect.name == name
    assert effect.kind == kind
    assert set(ranges) == set(effect.parameters._fields)
    assert effect.amplitude in ranges
    assert effect.plausible
    assert effect.enters
    assert effect.shows_in
    assert bool(effect.ports) != (effect.sensor is not None)
    for field, plausible in effect.plausible.items():
        assert ranges[field].low <= plausible.high <= ranges[field].high
    for probe in effect.probes:
        for field, value in effect.at(probe)._asdict().items():
            assert ranges[field].low <= value <= ranges[field].high


@pytest.mark.parametrize("name", [n for k, n in ROWS if k == "vehicle" and EFFECTS[k][n].ports])
def test_absent_is_nothing_and_compiled_is_python(name: str) -> None:
    """An absent effect adds zero at every port; a present one adds the same bits in Python and compiled."""
    absent, there = vehicle_ports.effect_row({}), vehicle_ports.effect_row(present("vehicle", name))
    assert [port(LIVELY, absent) for port in VEHICLE_PORTS] == [0.0] * len(VEHICLE_PORTS)
    assert [port(LIVELY, None) for port in VEHICLE_PORTS] == [0.0] * len(VEHICLE_PORTS)
    plain = [port(LIVELY, there) for port in VEHICLE_PORTS]
    assert any(value != 0.0 for value in plain) or name == "assist_saturation"
    assert list(_all_ports(LIVELY, there)) == plain


@compiled
def _all_ports(x: Moment, row: np.ndarray) -> tuple[float, ...]:
    return (
        vehicle_ports.bar_angle(x, row), vehicle_ports.bar_slope(x, row), vehicle_ports.bar_torque(x, row),
        vehicle_ports.assist_input(x, row), vehicle_ports.assist_output(x, row), vehicle_ports.pinion_torque(x, row),
        vehicle_ports.pinion_friction_level(x, row), vehicle_ports.column_friction_level(x, row),
        vehicle_ports.rack_torque(x, row), vehicle_ports.rack_friction_level(x, row),
        vehicle_ports.rack_friction_travel(x, row), vehicle_ports.rack_angle(x, row),
        vehicle_ports.rack_ratio(x, row), vehicle_ports.tyre_angle(x, row), vehicle_ports.trail(x, row),
        vehicle_ports.side_acceleration(x, row),
    )  # fmt: skip


def test_rig_and_drive_rows_absent_add_nothing() -> None:
    """As above for the other kinds."""
    x, y = RigMoment(0.3, -2.0), DriveMoment(0.3, -2.0, 0.4)
    row = rig_ports.rig_row({})
    assert [p(x, row) for p in (rig_ports.torque, rig_ports.friction_level, rig_ports.half_gap)] == [0.0] * 3
    row = drive_ports.drive_row({})
    assert [p(y, row) for p in (drive_ports.torque, drive_ports.angle, drive_ports.friction_level)] == [0.0] * 3


def test_universal_joint_does_no_work_over_half_a_turn() -> None:
    """The slope is the derivative of the angle, so its mean over a period is zero: a lost factor of 2 shows."""
    p = UniversalJoint(0.02, 0.7)
    deltas = np.linspace(0.0, math.pi, 400, endpoint=False)
    moments = [Moment(*([d] + [0.0] * 10)) for d in deltas]
    assert abs(np.mean([slope(x, p) for x in moments])) < 1e-15
    step = 1e-6
    there = [(angle(Moment(*([d + s] + [0.0] * 10)), p)) for d in (0.3,) for s in (step, -step)]
    assert (there[0] - there[1]) / (2.0 * step) == pytest.approx(slope(Moment(*([0.3] + [0.0] * 10)), p), rel=1e-8)


@pytest.mark.parametrize(("a", "d"), [(0.1, 1.3), (-0.1, 1.3), (-0.4, 3.5), (-0.4, -3.5)])
def test_variable_ratio_conserves_power(a: float, d: float) -> None:
    """d(angle)/d(delta) equals the factor on the torque: what goes in as work comes out as work."""
    p, step = VariableRatio(a), 1e-6
    rise = (
        ratio_angle(at_rack(d + step, 0.0, 0.0, 0.0, 0.0, 0.0), p)
        - ratio_angle(at_rack(d - step, 0.0, 0.0, 0.0, 0.0, 0.0), p)
    ) / (2.0 * step)
    assert rise == pytest.approx(ratio_factor(at_rack(d, 0.0, 0.0, 0.0, 0.0, 0.0), p), rel=1e-8)
    assert rise > -1.0  # the rack never turns back


def test_backlash_loses_the_gap_on_the_loaded_side() -> None:
    """Firm load: the whole gap, towards the load; no load: nothing."""
    p = Backlash(0.01)
    assert lost_angle(at_rack(0.0, 0.0, 0.0, 0.0, 0.0, 5.0 * LAID_ON), p) == -0.01
    assert lost_angle(at_rack(0.0, 0.0, 0.0, 0.0, 0.0, -5.0 * LAID_ON), p) == 0.01
    assert lost_angle(at_rack(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), p) == 0.0


def test_trail_drop_and_scrub_closed_forms() -> None:
    """Half the slip takes half the pneumatic share; at v0 the scrub is down to 1/e."""
    drop = factor(at_rack(0.0, 0.0, 0.0, -0.05, 0.0, 0.0), PneumaticTrailDrop(0.6, 0.1))
    assert drop == pytest.approx(-0.3)
    assert factor(at_rack(0.0, 0.0, 0.0, 0.4, 0.0, 0.0), PneumaticTrailDrop(0.6, 0.1)) == pytest.approx(-0.6)
    assert level(at_rack(0.0, 0.0, 4.0, 0.0, 0.0, 0.0), TyreScrub(8.0, 4.0, 0.1)) == pytest.approx(8.0 / math.e)
