"""Bad campaigns are answered by one message that names the place, the fault and the mend."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from experiments.cli import main
from identification.campaign import read_campaign, require
from steer_env.errors import InputError
from tests.identification.broken_campaigns import BROKEN
from tests.identification.synthetic_campaign import write_rig_campaign, write_vehicle_campaign


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_vehicle_campaign(tmp_path_factory.mktemp("valid"))


@pytest.fixture
def campaign(valid: Path, tmp_path: Path) -> Path:
    """A copy of the valid campaign, to be spoiled."""
    return Path(shutil.copytree(valid, tmp_path / "campaign"))


def test_the_campaign_that_the_others_are_made_from_is_accepted(campaign: Path) -> None:
    """Without this, every case below could fail for a reason of the generator's."""
    assert len(read_campaign(campaign).runs) == 4


@pytest.mark.parametrize("case", BROKEN)
def test_message_names_place_fault_and_mend(case: str, campaign: Path) -> None:
    """Catches a fault that passes unseen, crashes, or is reported without saying where."""
    spoil, named = BROKEN[case]
    spoil(campaign)
    with pytest.raises(InputError) as caught:
        read_campaign(campaign)
    message = str(caught.value)
    assert str(campaign) in caught.value.where
    for part in named:
        assert part in message
    assert len(caught.value.what) > 8
    assert len(caught.value.mend) > 8
    assert "\n" not in message


@pytest.mark.parametrize("case", BROKEN)
def test_command_ends_with_status_2_and_one_line(case: str, campaign: Path, tmp_path: Path) -> None:
    """Catches a traceback, a wrong exit status, and output written before the input was checked."""
    spoil, named = BROKEN[case]
    spoil(campaign)
    before = sorted(tmp_path.rglob("*"))
    out = tmp_path / "out"
    result = CliRunner().invoke(main, ["identify", str(campaign), "--out", str(out), "--quiet"])
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.output
    for part in named:
        assert part in result.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_missing_channel_is_named_with_the_step(campaign: Path) -> None:
    """Catches a KeyError deep inside a step."""
    run = read_campaign(campaign).runs[0]
    require(run, ["yaw_rate_radps"], "step I-a1")
    del run.channels["rack_force_N"]
    with pytest.raises(InputError, match=r"step I-b1 needs the channel rack_force_N") as caught:
        require(run, ["yaw_rate_radps", "rack_force_N"], "step I-b1")
    assert "060_frequency_response_1.csv" in caught.value.where


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"motor_angle_rad": None}, "motor_angle_rad"),
        ({"motor_torque_Nm": None}, "no torque"),
        ({"motor_angle_rad": "constant"}, "never moves"),
    ],
)
def test_rig_campaign_without_what_it_needs(
    change: dict[str, str | None], named: str, tmp_path: Path
) -> None:
    """Catches a rig log that is accepted although no inertia can come out of it."""
    write_rig_campaign(tmp_path, change)
    with pytest.raises(InputError, match=named):
        read_campaign(tmp_path)
