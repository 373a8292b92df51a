"""What is written appears whole or not at all."""

import os
import stat

import pytest

from steer_env import atomic


def test_text_replaces_the_old_and_leaves_nothing_beside(tmp_path):
    path = tmp_path / "deep" / "reference.json"
    atomic.write_text(path, "old")
    atomic.write_text(path, "new\n")
    assert path.read_bytes() == b"new\n"
    assert os.listdir(path.parent) == ["reference.json"]


def test_a_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "scores.json"
    atomic.write_text(path, "old")

    def full_disk(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        atomic.write_text(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["scores.json"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no permission bits")
def test_permissions_are_those_of_an_ordinary_file(tmp_path):
    """Temporary files are private by default; a report that a colleague cannot read is a fault."""
    atomic.write_text(tmp_path / "ours", "x")
    (tmp_path / "theirs").write_text("x")
    with atomic.folder(tmp_path / "our_folder"):
        pass
    (tmp_path / "their_folder").mkdir()
    mode = {path.name: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    assert mode["ours"] == mode["theirs"]
    assert mode["our_folder"] == mode["their_folder"]


def test_a_folder_appears_at_the_end_only(tmp_path):
    target = tmp_path / "campaign"
    with atomic.folder(target) as staging:
        (staging / "runs").mkdir()
        (staging / "runs" / "1.csv").write_text("1")
        (staging / "campaign.toml").write_text("name")
        assert not target.exists()
    assert (target / "runs" / "1.csv").read_text() == "1"
    assert os.listdir(tmp_path) == ["campaign"]


def test_an_interrupted_folder_leaves_nothing(tmp_path):
    def interrupted():
        with atomic.folder(tmp_path / "campaign") as staging:
            (staging / "half").write_text("x")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert os.listdir(tmp_path) == []


def test_a_resumable_folder_comes_back_for_the_same_inputs_only(tmp_path):
    def interrupted():
        with atomic.folder(tmp_path / "campaign", resume_key="abc") as staging:
            (staging / "1.csv").write_text("1")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not (tmp_path / "campaign").exists()
    with atomic.folder(tmp_path / "other", resume_key="def") as staging:
        assert os.listdir(staging) == []
    with atomic.folder(tmp_path / "campaign", resume_key="abc") as staging:
        assert os.listdir(staging) == ["1.csv"]
    assert sorted(os.listdir(tmp_path)) == ["campaign", "other"]


def test_an_existing_folder_keeps_what_is_not_ours(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "report.html").write_text("old")
    with atomic.folder(tmp_path) as staging:
        (staging / "report.html").write_text("new")
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert (tmp_path / "report.html").read_text() == "new"
