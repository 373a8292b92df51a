"""The drive's model: the split over time, what is predicted, and what each effect changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.campaign import Campaign, read_campaign
from identification.drive_signals import hats
from identification.gap.drive_model import BLOCK_S, SLIDING_RATE, TORQUE, DriveGapModel, drive_model, wheel_torque
from identification.gap.model import sliding as moving
from steer_env.errors import InputError
from steer_env.physics.effects.drive_ports import drive_row
from tests.identification.synthetic_drive import DAMPING, LEVEL, PRESLIDING, drive, stiffness, write_drive_campaign

MID = {
    "coulomb_friction": {"level_Nm": 0.4},
    "presliding_friction": {"level_Nm": 0.4, "travel_rad": 0.05},
    "torque_offset_drift": {"wave_1_Nm": 0.3, "wave_2_Nm": -0.2},
    "angle_offset": {"rad": 0.03},
    "latency_torque": {"delay_s": 0.06},
    "stiffness_saturation": {"angle_rad": 0.15},
}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    folder = tmp_path_factory.mktemp("gap") / "drive"
    return read_campaign(write_drive_campaign(folder, drive(2, noise=0.02)))


@pytest.fixture(scope="module")
def model(campaign: Campaign) -> DriveGapModel:
    return drive_model(campaign)


def true_values(model: DriveGapModel) -> dict[str, float]:
    c = {f"c{k}": float(stiffness(speed)) for k, speed in enumerate(model.speeds)}
    return {**c, "b": DAMPING, "bias": 0.0}


def predicted(model: DriveGapModel, values: dict[str, float], present: dict[str, dict[str, float]]) -> np.ndarray:
    return np.concatenate([model.simulate(r, values, present)[TORQUE][r.keep] for r in model.records])


def test_stretches_alternate_and_share_no_sample(model: DriveGapModel) -> None:
    """Catches a held-out sample that was fitted, and a split that depends on the fit."""
    seen = np.zeros(model.records[0].outputs[TORQUE].size, dtype=int)
    for record in model.records:
        seen[record.keep] += 1
        assert (record.keep.stop - record.keep.start) * record.dt <= 1.5 * BLOCK_S
    assert seen.max() == 1
    roles = [record.role for record in model.records]
    assert roles == ["identify", "validate"] * (len(roles) // 2) + ["identify"] * (len(roles) % 2)


def test_the_true_drive_leaves_its_bias_and_noise(model: DriveGapModel) -> None:
    """Beside the bias, a random walk that knots 5 s apart follow, true stiffness, damping and friction leave little."""
    friction = {"presliding_friction": {"level_Nm": LEVEL, "travel_rad": LEVEL / PRESLIDING}}
    measured = np.concatenate([r.outputs[TORQUE][r.keep] for r in model.records])
    s = next(iter(model.signals.values()))
    bias = (moving(s.rate, SLIDING_RATE)[:, None] * hats(s.time, np.arange(0.0, s.time[-1], 5.0)))[: measured.size]
    left = []
    for present in ({}, friction):
        rest = measured - predicted(model, true_values(model), present)
        left.append(float(np.std(rest - bias @ np.linalg.lstsq(bias, rest, rcond=None)[0])))
    assert left[1] < 0.4 * left[0]


@pytest.mark.parametrize("name", MID)
def test_an_effect_is_not_what_stiffness_damping_and_bias_can_do(name: str, model: DriveGapModel) -> None:
    """Its change of the torque, less the best the nominal parameters make of it, is a quarter of it or more."""
    values = true_values(model)
    nominal = predicted(model, values, {})
    change = predicted(model, values, {name: model.effects[name].at(MID[name])._asdict()}) - nominal
    steps = [predicted(model, {**values, key: value + 0.1}, {}) - nominal for key, value in values.items()]
    table = np.column_stack(steps)
    left = change - table @ np.linalg.lstsq(table, change, rcond=None)[0]
    assert np.std(change) > 0.01
    assert np.sqrt(np.mean(left**2)) > 0.25 * np.sqrt(np.mean(change**2))


def test_absent_effects_change_no_bit_and_compiled_is_python(model: DriveGapModel) -> None:
    values = true_values(model)
    off = {name: effect.absent()._asdict() for name, effect in model.effects.items()}
    assert (predicted(model, values, off) == predicted(model, values, {})).all()
    s = next(iter(model.signals.values()))
    c = np.full(400, 5.0)
    row = drive_row({name: p for name, p in MID.items() if name != "latency_torque"})
    arguments = (s.angle[:400], s.rate[:400], c, 0.3, 0.1, row)
    assert (wheel_torque(*arguments) == wheel_torque.py_func(*arguments)).all()


def test_a_late_torque_is_the_prediction_shifted(model: DriveGapModel) -> None:
    """60 ms at 50 Hz are three samples, where the wheel moves before and after."""
    record, values = model.records[0], true_values(model)
    plain = model.simulate(record, values, {})[TORQUE]
    late = model.simulate(record, values, {"latency_torque": {"delay_s": 0.06}})[TORQUE]
    weight = moving(next(iter(model.signals.values())).rate, SLIDING_RATE)
    both = np.flatnonzero((weight[3:] == 1.0) & (weight[:-3] == 1.0)) + 3
    np.testing.assert_allclose(late[both], plain[both - 3], atol=0.01)


def test_a_short_drive_and_another_kind_are_refused(campaign: Campaign, tmp_path: Path) -> None:
    short = read_campaign(write_drive_campaign(tmp_path / "short", drive(2, seconds=40.0)))
    with pytest.raises(InputError, match="log a minute"):
        drive_model(short)
    object.__setattr__(short, "kind", "rig")
    with pytest.raises(InputError, match="not 'drive'"):
        drive_model(short)
