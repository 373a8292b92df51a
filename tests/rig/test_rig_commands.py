"""The rig's commands from end to end on a virtual motor in the own process: what is left on disk, how they end."""

import json
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from experiments.cli import main
from experiments.rig_excite import FEEDS, Excitation
from identification.campaign import read_campaign
from steer_env.plants import PLANTS
from steer_env.rig.log_file import read_log


def call(*arguments: str | Path, code: int = 0):
    """Standard output of a command; its exit status is checked."""
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result


STEPPED = ("--interface", "stepped", "--motor", "senso_wheel", "--quiet")


def test_excited_recorded_and_identified_the_virtual_wheel_comes_back(tmp_path):
    """The walk of docs/rig.md: inertia and friction of the plant from what two commands left on disk."""
    s = PLANTS["SbW"].steering
    call("rig", "excite", *STEPPED, "--repeats", "1", "--seconds", "12", "--out", tmp_path / "bench", "--json")
    campaign = read_campaign(tmp_path / "bench")
    assert [run.manoeuvre for run in campaign.runs] == [feed.manoeuvre for feed in FEEDS]
    found = json.loads(call("identify", tmp_path / "bench", "--out", tmp_path / "found", "--json").stdout)
    value = {name: entry["value"] for name, entry in found["parameters"].items()}
    assert value["inertia_kgm2"] == pytest.approx(s.J_s + s.J_pin, rel=0.02)
    assert value["friction_level_Nm"] == pytest.approx(s.M_fric + s.M_s_fric, rel=0.1)
    assert value["damping_Nms_per_rad"] == pytest.approx(s.b_s + s.b_pin, rel=0.1)
    assert found["held_out_rms_Nm"]["model"] < 0.3 * found["held_out_rms_Nm"]["without friction"]
    page = (tmp_path / "found" / "report.html").read_text("utf-8")
    assert "Friction loop" in page
    assert ">nan<" not in page.lower()
    assert json.loads((tmp_path / "found" / "rig.json").read_text()) == found


def test_a_run_leaves_frames_signals_and_a_campaign_of_each_kind(tmp_path):
    pytest.importorskip("asammdf", reason="the extra [formats] is not installed")
    for kind in ("rig", "vehicle"):
        out = tmp_path / kind
        ran = json.loads(
            call("rig", "run", *STEPPED, "--duration", "5.5", "--kind", kind, "--out", out, "--mf4", "--json").stdout
        )
        assert (ran["ended"], ran["runs"], ran["seconds"]) == ("end of the manoeuvre", 1, 6.0)
        assert read_campaign(out).kind == kind
        assert read_campaign(out / "mf4").runs[0].channels.keys() == read_campaign(out).runs[0].channels.keys()
        assert len(read_log(out / "mf4" / "rig.mf4").frames) == len(read_log(out / "rig.blf").frames)
        assert (out / "signals_1.csv").read_text().count("\n") == 6001


def test_a_controller_that_gives_no_number_ends_the_run_and_keeps_what_was_recorded(tmp_path):
    """After 5.5 s: bad input, told as such, and the run up to there is a campaign."""
    (tmp_path / "bad.py").write_text(
        "class Wild:\n"
        "    def __init__(self, plant, reference, causality): self.k = 0\n"
        "    def reset(self, period): self.k = 0\n"
        "    def __call__(self, observation):\n"
        "        self.k += 1\n"
        "        return 0.5 if self.k < 5500 else float('nan')\n"
    )
    out = tmp_path / "out"
    result = CliRunner().invoke(
        main, ["rig", "run", *STEPPED, "--controller", f"{tmp_path / 'bad.py'}:Wild", "--out", str(out)]
    )
    assert result.exit_code == 2
    assert "the controller asks for nan N m after 5.499 s" in result.stderr
    assert len(read_campaign(out).runs) == 1


def test_a_locked_rig_and_a_silent_bus_are_told_in_one_message(tmp_path):
    """Neither is a fault of the program, and a rig that was never opened leaves no log that blocks the next try."""
    out = tmp_path / "out"
    bus = ("--interface", "virtual", "--channel", "silent", "--out", out)
    assert "--arm" in call("rig", "run", *bus, code=2).stderr
    assert not list(out.glob("rig.*"))
    said = call("rig", "run", *bus, "--arm", "--yes", "--quiet", code=2).stderr
    assert "Nothing on this bus answers as senso_wheel" in said
    assert "fault in steer-env" not in said


def test_a_replay_writes_frames_and_runs_as_mf4(tmp_path):
    pytest.importorskip("asammdf", reason="the extra [formats] is not installed")
    call("rig", "run", *STEPPED, "--duration", "5.5", "--out", tmp_path / "run")
    log = tmp_path / "run" / "rig.log"
    call("rig", "replay", log, "--motor", "senso_wheel", "--campaign", "--mf4", "--out", tmp_path / "again")
    declared = tomllib.loads((tmp_path / "again" / "mf4" / "campaign.toml").read_text("utf-8"))
    assert [run["file"] for run in declared["runs"]] == ["runs/free_1.mf4"]
    assert len(read_log(tmp_path / "again" / "mf4" / "rig.mf4").frames) == len(read_log(log).frames)
    wrong = call("rig", "replay", log, "--motor", "senso_wheel", "--campaign", "--manoeuvre", "waltz", code=2)
    assert "free" in wrong.stderr


@pytest.mark.parametrize("feed", FEEDS, ids=lambda feed: feed.name)
def test_an_excitation_is_below_the_cap_and_centred(feed):
    """On a wheel that does not move: never above the cap, no mean that would turn the wheel away, zero at the start."""

    class Still:
        pinion_angle = pinion_rate = 0.0

    law = Excitation(feed, 2.0, 16.0)
    law.reset(1e-3)
    torques = [law(Still()) for _ in range(16_000)]
    assert 0.5 < max(map(abs, torques)) < 2.0
    assert abs(sum(torques)) * 1e-3 < 2.5  # N m s: less than one step of torque
