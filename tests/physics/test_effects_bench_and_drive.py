"""The catalogues of bench motor and drive: absent means nothing, units and ranges, Python as compiled code."""

from __future__ import annotations

import math

import numpy as np
import pytest

from steer_env.physics._jit import compiled
from steer_env.physics.effects import EFFECTS, Effect, drive_ports, rig_ports
from steer_env.physics.effects.drive_effects import DriveMoment
from steer_env.physics.effects.rig_moment import RigMoment

KINDS = ("rig", "drive")
# Effects that hold another one inside them: absent only with these at zero as well.
HOLDS = {
    "stribeck_friction": {"level_Nm": 0.0},
    "gravity_unbalance": {"cos_Nm": 0.0},
    "torque_offset_drift": {"wave_2_Nm": 0.0, "wave_3_Nm": 0.0, "wave_4_Nm": 0.0},
}
ROWS = {"rig": rig_ports.rig_row, "drive": drive_ports.drive_row}
EVERY = [pytest.param(effect, id=f"{kind}-{name}") for kind in KINDS for name, effect in EFFECTS[kind].items()]
MECHANICAL = [parameter for parameter in EVERY if parameter.values[0].ports]
MOTIONS = np.random.default_rng(3).uniform([-3.0, -8.0, 0.0], [3.0, 8.0, 1.0], (60, 3)).tolist()


def at_rig_ports(angle, rate, share, row):
    x = RigMoment(angle, rate)
    return (
        rig_ports.torque(x, row), rig_ports.friction_level(x, row), rig_ports.friction_travel(x, row),
        rig_ports.half_gap(x, row), rig_ports.wheel_share(x, row),
    )  # fmt: skip


def at_drive_ports(angle, rate, share, row):
    x = DriveMoment(angle, rate, share)
    return (
        drive_ports.torque(x, row), drive_ports.angle(x, row), drive_ports.friction_level(x, row),
        drive_ports.friction_travel(x, row),
    )  # fmt: skip


PLAIN = {"rig": at_rig_ports, "drive": at_drive_ports}
ABSENT = {"rig": (0.0,) * 5, "drive": (0.0,) * 4}
MACHINE = {kind: compiled(function) for kind, function in PLAIN.items()}


@pytest.mark.parametrize("effect", EVERY)
def test_an_effect_is_searched_from_inside_its_plausible_range(effect: Effect) -> None:
    """Catches a probe that differs from "absent" in nothing, or lies where the name is not believed."""
    for probe in effect.probes:
        assert effect.at(probe) != effect.absent()
        for name, value in probe.items():
            if effect.size is None and name in effect.plausible:
                assert effect.plausible[name].holds(value), name


@pytest.mark.parametrize("effect", MECHANICAL)
def test_without_amplitude_an_effect_is_absent_to_the_bit(effect: Effect) -> None:
    """Catches a shape that acts on its own, and an absent effect that still moves the last bit."""
    probe = {**effect.probes[-1], effect.amplitude: getattr(effect.absent(), effect.amplitude)}
    off = ROWS[effect.kind]({effect.name: {**probe, **HOLDS.get(effect.name, {})}})
    on = ROWS[effect.kind]({effect.name: effect.probes[-1]})
    function = PLAIN[effect.kind]
    for motion in MOTIONS:
        assert function(*motion, off) == function(*motion, None) == ABSENT[effect.kind]
    assert any(function(*motion, on) != ABSENT[effect.kind] for motion in MOTIONS)


@pytest.mark.parametrize("effect", MECHANICAL)
def test_effects_are_the_same_in_python_and_compiled(effect: Effect) -> None:
    row = ROWS[effect.kind]({effect.name: effect.probes[-1]})
    for motion in MOTIONS:
        assert MACHINE[effect.kind](*motion, row) == PLAIN[effect.kind](*motion, row)


def test_all_effects_of_a_kind_add_up() -> None:
    """Catches a port that forgets a row, or counts it twice."""
    everything = {name: effect.probes[0] for name, effect in rig_ports.RIG_MECHANICAL.items()}
    whole = rig_ports.rig_row(everything)
    for motion in MOTIONS:
        single = [at_rig_ports(*motion, rig_ports.rig_row({name: probe})) for name, probe in everything.items()]
        np.testing.assert_allclose(at_rig_ports(*motion, whole), np.sum(single, axis=0), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "values", "angle", "rate", "torque"),
    [
        ("spring_centering", {"stiffness_Nm_per_rad": 2.0}, 0.3, 1.0, 0.6),
        ("quadratic_drag", {"drag_Nms2_per_rad2": 0.01}, 0.3, -4.0, -0.16),
        ("asymmetric_friction", {"viscous_Nms_per_rad": 0.05}, 0.3, -4.0, 0.2),
        ("gravity_unbalance", {"sin_Nm": 0.3, "cos_Nm": 0.1}, math.pi / 2.0, 1.0, 0.3),
        ("gravity_unbalance", {"sin_Nm": 0.3, "cos_Nm": 0.1}, 0.0, 1.0, 0.1),
        ("torque_ripple", {"amplitude_Nm": 0.2, "order": 12.0, "phase": 0.0}, math.pi / 24.0, 1.0, 0.2),
    ],
)
def test_torques_of_the_bench_follow_their_formulas(name, values, angle, rate, torque) -> None:
    """Hand-calculated; the sign says that the torque resists."""
    assert rig_ports.torque(RigMoment(angle, rate), rig_ports.rig_row({name: values})) == pytest.approx(torque)


def test_stribeck_friction_falls_from_rest_to_the_sliding_level() -> None:
    row = rig_ports.rig_row({"stribeck_friction": {"extra_Nm": 0.2, "level_Nm": 0.1, "speed_radps": 0.5}})
    assert rig_ports.friction_level(RigMoment(0.0, 0.0), row) == pytest.approx(0.3)
    assert rig_ports.friction_level(RigMoment(0.0, 0.5), row) == pytest.approx(0.1 + 0.2 * math.exp(-1.0))
    assert rig_ports.friction_level(RigMoment(0.0, 50.0), row) == pytest.approx(0.1)


def test_centring_of_a_drive_levels_off_at_its_angle() -> None:
    """tanh: slope one at the middle, the saturation angle far out."""
    row = drive_ports.drive_row({"stiffness_saturation": {"angle_rad": 0.2}})
    seen = [angle + drive_ports.angle(DriveMoment(angle, 0.0, 0.0), row) for angle in (1e-4, 5.0, -5.0)]
    assert seen == pytest.approx([1e-4, 0.2, -0.2], rel=1e-6)


def test_a_drifting_offset_is_half_waves_over_the_run() -> None:
    row = drive_ports.drive_row({"torque_offset_drift": {"wave_1_Nm": 0.3, "wave_2_Nm": 0.1}})
    bias = [drive_ports.torque(DriveMoment(1.0, 1.0, share), row) for share in (0.0, 0.5, 1.0)]
    assert bias == pytest.approx([0.4, -0.1, -0.2])
