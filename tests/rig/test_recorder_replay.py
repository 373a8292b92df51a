"""What is recorded can be read back, even after a kill; a log becomes a campaign; a real car's bus plays back."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from experiments.cli import main
from identification.campaign import read_campaign
from steer_env.errors import InputError
from steer_env.plants.sbw import SBW
from steer_env.rig.campaign import write_campaign
from steer_env.rig.frame import Frame
from steer_env.rig.log_file import Logged, read_log
from steer_env.rig.motors import MOTORS, make
from steer_env.rig.recorder import Recorder
from steer_env.rig.replay import MotorDecoder, replay
from steer_env.rig.virtual import settings
from tests.rig.conversation import Conversation


def record(folder: Path, name: str, torque, periods: int, **virtual) -> Conversation:
    """Bring a virtual motor up and run a torque (index of the period -> N m) while everything is recorded."""
    talk = Conversation(name, **virtual)
    with Recorder(folder) as recorder:

        def period(*frames: Frame):
            now = talk.virtual.now
            for frame in frames:
                recorder.frame(frame, now, True)
            heard = Conversation.period(talk, *frames)
            for received in heard.frames:
                recorder.frame(received.frame, received.host_time, False)
            return heard

        talk.period = period
        talk.until("on")
        for k in range(periods):
            talk.run(torque(k), 1)
        talk.until("off")
    return talk


@pytest.mark.parametrize("name", list(MOTORS))
@pytest.mark.parametrize("suffix", ["blf", "log"])
def test_a_recording_is_read_back_frame_by_frame(name, suffix, tmp_path):
    """Catches a lost frame, a lost direction, a wrong time, a length that a format does not keep."""
    talk = record(tmp_path, name, lambda k: 0.5, 100)
    log = read_log(tmp_path / f"rig.{suffix}")
    assert not log.torn
    assert [logged.frame for logged in log.frames if logged.sent] == talk.sent
    assert len(log.frames) > len(talk.sent) + 90
    times = [logged.time for logged in log.frames]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(talk.virtual.now, abs=2e-3)
    found = replay(log.frames, MotorDecoder(make(name, **settings(name))))
    assert not any(entry.rejected or entry.counter_errors for entry in found.regularity.values())
    assert found.signals["commanded_torque_Nm"][1][-1] == 0.0
    assert found.signals["commanded_torque_Nm"][1].max() == pytest.approx(0.5, abs=4e-3)


KILLED = """
import sys, time
from steer_env.rig.frame import Frame
from steer_env.rig.recorder import Recorder
recorder = Recorder(sys.argv[1])
k = 0
while True:
    recorder.frame(Frame(0x211, k.to_bytes(8, "little")), time.monotonic(), False)
    k += 1
    print(k, flush=True)
    time.sleep(0.001)
"""


def test_a_kill_loses_less_than_a_second(tmp_path):
    """kill -9 in the middle of a run: both files read back, and end within a second of the end."""
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    last = 0
    while last < 300:
        last = int(process.stdout.readline())
    started = time.monotonic()
    os.kill(process.pid, signal.SIGKILL)
    rest = process.communicate()[0].split()
    last = int(rest[-1]) if rest else last
    assert time.monotonic() - started < 30.0
    for suffix in ("blf", "log"):
        frames = read_log(tmp_path / f"rig.{suffix}").frames
        numbers = [int.from_bytes(logged.frame.data, "little") for logged in frames]
        assert numbers == list(range(len(numbers)))
        assert last - len(numbers) <= 20  # frames; a container holds about eight


@pytest.mark.parametrize("suffix", ["blf", "log"])
def test_a_file_that_ends_in_the_middle_is_read_up_to_there(suffix, tmp_path):
    record(tmp_path, "senso_wheel", lambda k: 0.1, 50)
    path = tmp_path / f"rig.{suffix}"
    whole = read_log(path).frames
    path.write_bytes(path.read_bytes()[:-11])
    torn = read_log(path)
    assert torn.torn
    assert torn.frames == whole[: len(torn.frames)]
    assert len(whole) - 12 <= len(torn.frames) < len(whole)


def test_a_recording_is_not_overwritten(tmp_path):
    """And one that never heard a frame is none: the folder is free again."""
    Recorder(tmp_path).close()
    with Recorder(tmp_path) as recorder:
        recorder.frame(Frame(0x211, b"12345678"), 0.0, False)
    with pytest.raises(InputError, match="already"):
        Recorder(tmp_path)
    assert len(read_log(tmp_path / "rig.blf").frames) == 1


@pytest.mark.parametrize(
    ("file", "content", "word"),
    [
        ("x.log", "hello\n", "read"),
        ("x.blf", "hello", "read"),
        ("x.log", "", "no frames"),
        ("x.xyz", "", "no kind"),
        ("no.log", None, "not there"),
    ],
)
def test_what_is_no_log_is_said(file, content, word, tmp_path):
    if content is not None:
        (tmp_path / file).write_text(content)
    with pytest.raises(InputError, match=word):
        read_log(tmp_path / file)


def test_a_log_becomes_a_campaign_from_which_the_inertia_comes_back(tmp_path):
    """A swept torque without friction: J and b by least squares, of the rotor alone where the sensor is logged."""
    bare = SBW.steering._replace(M_fric=0.0, M_s_fric=0.0)
    plant = replace(SBW, steering=bare)
    for name, J, b in (
        ("senso_wheel", bare.J_s + bare.J_pin, bare.b_s + bare.b_pin),
        ("simulated", bare.J_pin, bare.b_pin),
    ):
        folder = tmp_path / name
        record(folder, name, lambda k: np.sin(2e-3 * k + 2e-6 * k * k), 5200, plant=plant)
        motor = make(name, **settings(name))
        (run,) = write_campaign(folder / "campaign", read_log(folder / "rig.blf"), motor, "bench")
        assert run.seconds == pytest.approx(5.2, abs=0.02)
        campaign = read_campaign(folder / "campaign")
        assert campaign.kind == "rig"
        channels = campaign.runs[0].channels
        assert ("sensor_torque_Nm" in channels) == (name == "simulated")
        torque = channels["motor_torque_Nm"] - channels.get("sensor_torque_Nm", 0.0)
        impulse = np.cumsum(torque)[:-1] * campaign.runs[0].dt
        rate, angle = channels["motor_velocity_radps"][1:], channels["motor_angle_rad"][1:]
        base = np.column_stack([rate, angle, np.ones_like(rate), np.arange(rate.size)])
        found = np.linalg.lstsq(base, impulse, rcond=None)[0]
        assert found[0] == pytest.approx(J, rel=0.03)
        assert found[1] == pytest.approx(b, rel=0.2)


def test_a_campaign_leaves_out_what_was_not_under_control(tmp_path):
    """Two stretches with the drive off between them are two runs; a log without any is refused."""
    talk = Conversation("senso_wheel")
    frames: list[Logged] = []

    def period(*sent: Frame):
        now = talk.virtual.now
        frames.extend(Logged(now, frame, True, "") for frame in sent)
        heard = Conversation.period(talk, *sent)
        frames.extend(Logged(r.host_time, r.frame, False, "") for r in heard.frames)
        return heard

    talk.period = period
    for _ in range(2):
        talk.until("on")
        talk.run(0.002, 5100)
        talk.until("off")
        for _ in range(300):
            talk.period(*talk.motor.poll_frames())
    motor = make("senso_wheel")
    log = read_log_like(frames)
    runs = write_campaign(tmp_path / "two", log, motor, "two")
    assert [run.seconds for run in runs] == pytest.approx([5.1, 5.1], abs=0.05)
    with pytest.raises(InputError, match="drive was on"):
        write_campaign(tmp_path / "none", read_log_like(frames[:200]), motor, "none")
    assert not (tmp_path / "none").exists()


def read_log_like(frames: list[Logged]):
    from steer_env.rig.log_file import Log

    return Log(sorted(frames, key=lambda logged: logged.time), False)


def test_the_command_prints_a_table_and_writes_a_campaign(tmp_path):
    record(tmp_path, "odrive", lambda k: 0.3 * np.sin(0.01 * k), 5100)
    arguments = ["rig", "replay", str(tmp_path / "rig.log"), "--motor", "odrive", "--set", "rated_torque=7.5", "--json"]
    result = CliRunner().invoke(main, [*arguments, "--campaign", "--out", str(tmp_path / "campaign")])
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    rows = {row["identifier"]: row for row in content["identifiers"]}
    assert rows["0x9"]["period_ms"] == pytest.approx(1.0, abs=0.02)
    assert all(row["rejected"] == 0 for row in rows.values())
    assert len(read_campaign(tmp_path / "campaign").runs) == 1
    for wrong in (["x.log"], ["x.log", "--motor", "odrive", "--dbc", "y.dbc"], ["x.log", "--motor", "moteus"]):
        assert CliRunner().invoke(main, ["rig", "replay", *wrong]).exit_code == 2
