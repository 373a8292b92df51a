"""The command: a campaign that the reader accepts, the same bits for the same seed, resuming, and
bad usage.
"""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from experiments import simulate
from experiments.cli import main
from identification.campaign import read_campaign

SMALL = ["simulate", "--speeds", "60", "--repeats", "1", "--quiet"]


def run(*arguments: str) -> int:
    return CliRunner().invoke(main, list(arguments)).exit_code


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("simulate") / "campaign"
    assert run(*SMALL, "--seed", "5", "--out", str(out)) == 0
    return out


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_reader_accepts_the_campaign(campaign: Path) -> None:
    """Formats and plausibility checks of the reader hold for what we write."""
    read = read_campaign(campaign)
    assert read.kind == "vehicle"
    assert [r.manoeuvre for r in read.runs].count("steady_state") == 3
    assert len(read.runs) == 5
    assert not any(r.notes for r in read.runs)


def test_truth_stands_beside_and_is_not_given_away(campaign: Path) -> None:
    """campaign.toml holds what a test team knows; no identified number stands in it, nor the name
    of the truth.
    """
    truth = json.loads((campaign / "truth.json").read_text())
    (row,) = truth["rows"]
    toml = (campaign / "campaign.toml").read_text()
    assert "truth" not in toml
    for key in (
        "n_t_m",
        "C_f_N_per_rad",
        "J_ref_kgm2",
        "b_ref_Nms_per_rad",
        "c_pin_off_Nm_per_rad",
        "M_fric_C_Nm",
    ):
        assert key not in toml
        assert row[key] > 0.0


def test_same_seed_same_bytes(campaign: Path, tmp_path: Path) -> None:
    """Also with another number of jobs."""
    assert run(*SMALL, "--seed", "5", "--jobs", "1", "--out", str(tmp_path / "again")) == 0
    assert contents(tmp_path / "again") == contents(campaign)


def test_another_seed_changes_the_runs_and_clean_has_none(tmp_path: Path, campaign: Path) -> None:
    """Seeds act; a clean campaign does not depend on the seed."""
    assert run(*SMALL, "--seed", "6", "--out", str(tmp_path / "other")) == 0
    name = "runs/060_frequency_response_1.csv"
    assert (tmp_path / "other" / name).read_bytes() != (campaign / name).read_bytes()
    for seed in ("1", "2"):
        assert run(*SMALL, "--clean", "--seed", seed, "--out", str(tmp_path / seed)) == 0
    assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()


def test_finished_campaign_is_not_driven_again(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rerun of the same order costs nothing and changes nothing."""
    before = contents(campaign)

    def refuse(*_: object) -> None:
        raise AssertionError("driven again")

    monkeypatch.setattr(simulate, "drive", refuse)
    assert run(*SMALL, "--seed", "5", "--out", str(campaign)) == 0
    assert contents(campaign) == before


def test_damaged_campaign_is_mended(campaign: Path, tmp_path: Path) -> None:
    """A file that was changed by hand after the fact is driven again, not trusted."""
    out = tmp_path / "campaign"
    assert run(*SMALL, "--seed", "5", "--out", str(out)) == 0
    (out / "runs/060_steady_state_1.csv").write_text("time_s\n0\n")
    assert run(*SMALL, "--seed", "5", "--out", str(out)) == 0
    assert contents(out) == contents(campaign)


def test_interrupted_command_keeps_and_resumes(
    campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Status 130, no half campaign in its place; the rerun drives only what is missing and ends
    with the same bytes.
    """
    driven: list[str] = []
    real = simulate.drive

    def stop_at_third(planned: simulate.PlannedRun, *rest: object) -> object:
        if len(driven) == 2:
            raise KeyboardInterrupt
        driven.append(planned.name)
        return real(planned, *rest)

    out = tmp_path / "campaign"
    monkeypatch.setattr(simulate, "drive", stop_at_third)
    assert run(*SMALL, "--seed", "5", "--out", str(out)) == 130
    assert not out.exists()
    again: list[str] = []

    def count(planned: simulate.PlannedRun, *rest: object) -> object:
        again.append(planned.name)
        return real(planned, *rest)

    monkeypatch.setattr(simulate, "drive", count)
    assert run(*SMALL, "--seed", "5", "--out", str(out)) == 0
    assert len(again) == 3
    assert not set(again) & set(driven)
    assert contents(out) == contents(campaign)


@pytest.mark.parametrize("speeds", ["", "fast", "60,60", "0", "400", "60,nan"])
def test_bad_speeds_are_a_usage_error(speeds: str, tmp_path: Path) -> None:
    """Status 2 and nothing written."""
    assert run("simulate", "--speeds", speeds, "--out", str(tmp_path / "out")) == 2
    assert not (tmp_path / "out").exists()
