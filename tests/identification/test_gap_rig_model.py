"""The rig's model: what a motion and known effects predict is what was commanded, and J and b cannot stand in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.campaign import KnownRig, read_campaign
from identification.gap.basis import band_of, white_noise
from identification.gap.model import sliding
from identification.gap.rig_model import ANGLE, REST_RATE, TORQUE, RigModel, motion, quiet_band, rig_model, start_values
from identification.motion import band_limited
from steer_env.errors import InputError
from steer_env.testcar.bench import LOADED, Bench, bench_campaign

TRUE = {"J": Bench().J, "b": Bench().b}
# Sizes amid the plausible ranges. Two hundredths of an effect's torque may be left on a clean log: reversals, impacts
# and cogging are quicker than the band. Stribeck's peak, as narrow in time as a few samples, loses more in it.
HIDDEN = {
    "coulomb_friction": {"level_Nm": 0.2},
    "stribeck_friction": {"extra_Nm": 0.2, "level_Nm": 0.2, "speed_radps": 0.3},
    "asymmetric_friction": {"viscous_Nms_per_rad": 0.03},
    "presliding_friction": {"level_Nm": 0.2, "travel_rad": 0.04},
    "gravity_unbalance": {"sin_Nm": 0.3, "cos_Nm": 0.1},
    "torque_ripple": {"amplitude_Nm": 0.08, "order": 15.0, "phase": 1.0},
    "command_latency": {"delay_s": 0.0093},
    "backlash": {"half_gap_rad": 0.008, "wheel_share": 0.65},
    "torque_offset": {"Nm": 0.1},
    "torque_gain": {"ratio": 1.08},
    "quadratic_drag": {"drag_Nms2_per_rad2": 0.003},
    "spring_centering": {"stiffness_Nm_per_rad": 1.0},
}


def modelled(folder: Path, hidden: dict[str, dict[str, float]], **options) -> RigModel:
    bench_campaign(folder, hidden, seed=4, repeats=2, **options)
    return rig_model(read_campaign(folder))


def in_band(model: RigModel, torques: list[np.ndarray]) -> np.ndarray:
    """Cosine coefficients of torques [n], one per record, as they are judged: scaled so that their rms is theirs."""
    parts = []
    for record, torque in zip(model.records, torques, strict=True):
        band = band_of(record, model.band_Hz)
        scale = np.sqrt(band.frequency.size / torque[record.keep].size)
        parts.append(band.of({TORQUE: torque}, [TORQUE])[0] * scale)
    return np.concatenate(parts)


def predicted(model: RigModel, values: dict[str, float], present: dict[str, dict[str, float]]) -> np.ndarray:
    return in_band(model, [model.simulate(record, values, present)[TORQUE] for record in model.records])


def measured(model: RigModel) -> np.ndarray:
    return in_band(model, [record.outputs[TORQUE] for record in model.records])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("name", HIDDEN)
def test_a_known_effect_predicts_a_clean_log_and_cannot_be_mistaken_for_J_and_b(name: str, tmp_path: Path) -> None:
    """Catches a wrong sign, a delay that is not the bench's, an equation that is not the bench's, and an effect whose
    whole torque the nominal parameters would absorb.
    """
    values, share = HIDDEN[name], 0.05 if name == "stribeck_friction" else 0.02
    model = modelled(tmp_path, {name: values}, clean=True, bench=LOADED if name == "torque_gain" else Bench())
    assert name in model.effects
    present = {name: model.effects[name].at(values)._asdict()}
    nominal = predicted(model, TRUE, {})
    without, rest = measured(model) - nominal, measured(model) - predicted(model, TRUE, present)
    assert rms(rest) < share * rms(without)
    steps = {"J": {**TRUE, "J": 1.1 * TRUE["J"]}, "b": {**TRUE, "b": TRUE["b"] + 0.01}}
    table = np.column_stack([predicted(model, moved, {}) - nominal for moved in steps.values()])
    left = without - table @ np.linalg.lstsq(table, without, rcond=None)[0]
    assert rms(left) > 0.3 * rms(without)


def test_a_clean_bench_is_the_nominal_model(tmp_path: Path) -> None:
    """J q'' + b q' of the logged motion is the commanded torque within a thousandth, half a sample late."""
    model = modelled(tmp_path, {}, clean=True)
    assert rms(measured(model) - predicted(model, TRUE, {})) < 1e-3 * rms(measured(model))
    assert model.unknowns[0].start == pytest.approx(TRUE["J"], rel=0.01)
    assert model.unknowns[1].start == pytest.approx(TRUE["b"], abs=0.01)


def test_known_values_start_where_a_log_shows_no_inertia(tmp_path: Path) -> None:
    """A torque logged with its sign turned gives a negative inertia: the [rig] table's values stand in."""
    bench_campaign(tmp_path, {}, seed=4, repeats=1, clean=True)
    runs = read_campaign(tmp_path).runs
    turned = [replace(run, channels={**run.channels, TORQUE: -run.channels[TORQUE]}) for run in runs]
    assert start_values(runs, 8.0, KnownRig(0.5, 0.7))[0] == pytest.approx(TRUE["J"], rel=0.02)
    assert start_values(turned, 8.0, KnownRig(0.5, 0.7)) == (0.5, 0.7)
    assert start_values(turned, 8.0, KnownRig(None, None))[0] > 0.0


def test_gain_needs_a_torque_sensor(tmp_path: Path) -> None:
    """Without one, J and b over the gain are all that any log shows."""
    assert "torque_gain" not in modelled(tmp_path / "bare", {}).effects
    assert "torque_gain" in modelled(tmp_path / "loaded", {}, bench=LOADED).effects


def test_the_split_is_by_role_and_repeats_hold_only_their_noise(tmp_path: Path) -> None:
    """Held-out runs are in no fitted record; the scatter of repeats is of the size of what the truth leaves."""
    bench_campaign(tmp_path, {}, seed=4)
    campaign = read_campaign(tmp_path)
    model = rig_model(campaign)
    held = [run.name for run in campaign.runs if run.role == "validate"]
    assert held
    counted = {"identify": 0, "validate": 0}
    for record in model.records:
        counted[record.role] += len(record.repeats)
        if record.role == "identify":
            assert not any(np.array_equal(record.inputs[ANGLE], r.channels[ANGLE]) for r in campaign.runs)
    assert counted == {"identify": len(campaign.runs) - len(held), "validate": len(held)}
    deviations = []
    for record in model.records:
        if len(record.repeats) == 3:
            runs = [in_band(model, [repeat[TORQUE] if r is record else 0.0 * r.outputs[TORQUE] for r in model.records])
                    for repeat in record.repeats]  # fmt: skip
            deviations.append(np.std(runs, axis=0, ddof=1)[runs[0] != 0.0])
    assert 2e-3 < rms(np.concatenate(deviations)) < 2e-2  # the drive's ripple is 5e-3 N m, the encoder adds its own


def test_white_noise_and_the_band_that_it_leaves() -> None:
    """White noise of known size on a slow sine: its rms, and the torque that it makes up to the band, come out."""
    rng, dt, J = np.random.default_rng(2), 2e-3, 0.04
    noise = 5e-5 * rng.standard_normal(60000)
    angle = np.sin(2.0 * np.pi * 0.5 * dt * np.arange(noise.size)) + noise
    assert white_noise(angle) == pytest.approx(5e-5, rel=0.05)
    band = quiet_band(angle, dt, J, 0.02)
    _, _, acceleration = motion(noise, dt, band)
    # The formula ends at the band; the filter's edge lets through a quarter more of the frequencies.
    assert 0.02 < J * np.std(acceleration[1000:-1000]) < 0.02 * 1.25**2.5


def test_a_coarser_encoder_narrows_the_band(tmp_path: Path) -> None:
    """A step of 0.1 deg instead of 0.009 deg."""
    bench_campaign(tmp_path, {}, seed=4, repeats=2)
    campaign = read_campaign(tmp_path)
    fine = rig_model(campaign).motion_Hz
    for run in campaign.runs:
        run.channels[ANGLE] = 1.745e-3 * np.round(run.channels[ANGLE] / 1.745e-3)
    coarse = rig_model(campaign)
    assert coarse.motion_Hz < 0.5 * fine
    assert coarse.band_Hz < coarse.motion_Hz


def test_rest_does_not_count_and_motion_does() -> None:
    np.testing.assert_allclose(sliding(np.array([0.0, 0.02, 0.045, 0.5, -0.5]), REST_RATE), [0.0, 0.0, 0.5, 1.0, 1.0])


def test_motion_is_that_of_the_closed_form() -> None:
    """A sine inside the band keeps rate and acceleration; catches phase and scale."""
    t = 2e-3 * np.arange(5000)
    angle = np.sin(2.0 * np.pi * 3.0 * t)
    q, rate, acceleration = motion(angle, 2e-3, 20.0)
    inner, omega = slice(1000, 4000), 2.0 * np.pi * 3.0
    np.testing.assert_allclose(q[inner], angle[inner], atol=1e-4)
    np.testing.assert_allclose(rate[inner], omega * np.cos(omega * t)[inner], atol=1e-3 * omega)
    np.testing.assert_allclose(acceleration[inner], -(omega**2) * angle[inner], atol=2e-3 * omega**2)
    assert np.abs(band_limited(np.sin(2.0 * np.pi * 40.0 * t), 2e-3, 20.0).signal()[inner]).max() < 1e-3


def test_another_kind_and_a_missing_torque_are_refused(tmp_path: Path) -> None:
    bench_campaign(tmp_path, {}, seed=4, repeats=1)
    campaign = read_campaign(tmp_path)
    del campaign.runs[0].channels[TORQUE]
    with pytest.raises(InputError, match="motor_torque_Nm"):
        rig_model(campaign)
    object.__setattr__(campaign, "kind", "drive")
    with pytest.raises(InputError, match="not 'rig'"):
        rig_model(campaign)
