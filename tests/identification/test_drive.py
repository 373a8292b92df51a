"""The drive model: known parameters come back with honest intervals, and the real car's do."""

from pathlib import Path

import numpy as np
import pytest

from identification.campaign import Campaign, read_campaign
from identification.drive import DriveModel
from identification.drive_signals import dahl_shape
from steer_env.errors import InputError
from tests.identification.synthetic_drive import (
    DAMPING,
    LEVEL,
    PRESLIDING,
    drive,
    stiffness,
    write_drive_campaign,
)

REAL = Path(__file__).parents[3] / "shared" / "data" / "mkz_drive"


def _campaign(folder: Path, seed: int, **options: float) -> Campaign:
    return read_campaign(write_drive_campaign(folder / str(seed), drive(seed, **options)))


def test_friction_shape_is_the_closed_form_of_a_ramp_and_its_reversal() -> None:
    """Eq. 15 over M_C on a ramp is 1 - exp(-x / travel); catches a wrong sign or scale."""
    up = np.linspace(0.0, 0.1, 101)
    shape = dahl_shape(np.concatenate([up, up[::-1]]), 0.02)
    np.testing.assert_allclose(shape[:101], 1.0 - np.exp(-up / 0.02), atol=1e-12)
    top = shape[100]
    np.testing.assert_allclose(shape[101:], -1.0 + (1.0 + top) * np.exp(-up / 0.02), atol=1e-12)


def test_known_parameters_come_back(tmp_path: Path) -> None:
    """Catches a bias that swallows the stiffness, or torque held at rest taken for sliding."""
    model = DriveModel().fit(_campaign(tmp_path, 11, noise=0.02, seconds=300.0))
    assert model.params_["friction_level_Nm"] == pytest.approx(LEVEL, rel=0.05)
    assert model.params_["damping_Nms_per_rad"] == pytest.approx(DAMPING, abs=0.1)
    assert model.params_["friction_stiffness_Nm_per_rad"] == pytest.approx(PRESLIDING, rel=0.25)
    np.testing.assert_allclose(
        model.params_["stiffness_Nm_per_rad"], stiffness(model.speeds_), atol=0.8
    )


def test_no_friction_is_found_where_there_is_none(tmp_path: Path) -> None:
    """Catches a friction level made of noise and rounding."""
    model = DriveModel().fit(_campaign(tmp_path, 5, level=0.0))
    low, high = model.interval_["friction_level_Nm"]
    assert low < 0.02
    assert high < 0.1


@pytest.mark.slow
def test_intervals_cover_the_truth(tmp_path: Path) -> None:
    """40 intervals of 95 %: 33 or more must hold the truth (right ones do in 99.9 % of cases).

    White-noise standard errors, four to five times too small here, held it 9 times. The width is
    bounded as well.
    """
    covered, widths = [], []
    for seed in range(100, 108):
        model = DriveModel().fit(_campaign(tmp_path, seed))
        truth = {"stiffness_Nm_per_rad": stiffness(model.speeds_), "friction_level_Nm": LEVEL}
        for name, value in truth.items():
            low, high = model.interval_[name]
            covered.append(np.atleast_1d((low <= value) & (value <= high)))
        widths.append(model.std_["friction_level_Nm"])
    inside = np.concatenate(covered)
    assert len(inside) == 40
    assert np.count_nonzero(inside) >= 33
    assert np.mean(widths) < 0.04


def test_friction_earns_its_place_on_blocks_that_were_left_out(tmp_path: Path) -> None:
    """Catches a held-out score that has seen its blocks: it must exceed the fit's own residual."""
    model = DriveModel().fit(_campaign(tmp_path, 3))
    score = model.held_out_
    assert score["model"] < 0.75 * score["without friction"] < score["bias alone"]
    assert score["model"] > model.residual_rms_


def test_fit_is_deterministic_and_leaves_the_arguments_alone(tmp_path: Path) -> None:
    """scikit-learn manners: the constructor's arguments are as given, two fits are the same."""
    campaign = _campaign(tmp_path, 7)
    model = DriveModel(speed_knots=3)
    assert model.fit(campaign) is model
    again = DriveModel(speed_knots=3).fit(campaign)
    assert model.speed_knots == 3
    assert model.params_["friction_level_Nm"] == again.params_["friction_level_Nm"]
    parts = model.components(campaign.runs[0])
    whole = parts["stiffness"] + parts["damping"] + parts["friction"] + parts["bias"]
    np.testing.assert_allclose(whole, parts["model"], atol=1e-12)
    error = (parts["measured"] - parts["model"])[parts["sliding"]]
    # The fit sees every second sample, at 20 Hz or more.
    assert np.sqrt(np.mean(error**2)) == pytest.approx(model.residual_rms_, rel=0.06)


def test_a_wheel_that_hardly_turns_is_refused(tmp_path: Path) -> None:
    """Catches numbers made of nothing: friction shows only while the wheel slides."""
    channels = drive(1, seconds=60.0)
    channels["steering_angle_rad"] = channels["steering_angle_rad"] * 0.02
    campaign = read_campaign(write_drive_campaign(tmp_path / "still", channels))
    with pytest.raises(InputError, match="friction needs"):
        DriveModel().fit(campaign)


@pytest.mark.skipif(not REAL.is_dir(), reason="../shared/data/mkz_drive is not on this machine")
def test_real_car() -> None:
    """Half the vertical width of the loops, read off the plot by eye, is 0.25 to 0.45 N m.

    The stiffness must rise with speed (centring does), and what friction held at rest, which the
    fit did not see, must be of the fitted level.
    """
    campaign = read_campaign(REAL)
    assert campaign.runs[0].time[0] == 0.0
    assert "jitters" in campaign.runs[0].notes[0]
    model = DriveModel().fit(campaign)
    low, high = model.interval_["friction_level_Nm"]
    assert 0.2 < low < model.params_["friction_level_Nm"] < high < 0.45
    assert model.rest_ == pytest.approx(model.params_["friction_level_Nm"], rel=0.3)
    assert np.all(np.diff(model.params_["stiffness_Nm_per_rad"]) > 0.0)
    assert model.held_out_["model"] < 0.75 * model.held_out_["without friction"]
