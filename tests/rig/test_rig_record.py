"""steer-env rig record: what passes on a bus lies in the log, and nothing was sent."""

import json
import threading
import time
from pathlib import Path

import can
from click.testing import CliRunner

from experiments.cli import main
from steer_env.rig.bus import open_bus
from steer_env.rig.frame import Frame


def test_frames_of_others_are_logged_in_order(tmp_path: Path) -> None:
    """Fifty numbered frames on an in-process bus: all in the log as sent; the other node hears nothing."""
    frames = [Frame(0x211, bytes([k, *range(7)])) for k in range(50)]
    heard = []

    def talk() -> None:
        with open_bus("virtual", "record") as other:
            time.sleep(0.5)  # until somebody listens
            for frame in frames:
                other.send(frame)
            heard.append(other.receive(0.3))

    talker = threading.Thread(target=talk)
    talker.start()
    arguments = ["--interface", "virtual", "--channel", "record", "--seconds", "1.5", "--out", str(tmp_path), "--json"]
    result = CliRunner().invoke(main, ["rig", "record", *arguments])
    talker.join()
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    with can.LogReader(found["log"]) as log:
        logged = [bytes(message.data) for message in log]
    assert logged == [frame.data for frame in frames]
    assert found["frames"] == len(frames)
    assert heard == [None]


def test_a_log_is_not_written_over(tmp_path: Path) -> None:
    """A second recording into the same folder is refused before anything is opened for writing."""
    (tmp_path / "rig.blf").write_bytes(b"precious")
    arguments = ["--interface", "virtual", "--channel", "again", "--seconds", "0.1", "--out", str(tmp_path)]
    result = CliRunner().invoke(main, ["rig", "record", *arguments])
    assert result.exit_code == 2
    assert (tmp_path / "rig.blf").read_bytes() == b"precious"
