"""Cases over a Ray cluster: a node that dies loses none, and the bits are those of one machine."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from experiments.cli import main

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = Path(__file__).with_name("cluster_with_a_loss.py")


@pytest.mark.slow
def test_a_node_killed_midway_loses_no_case():
    """Two nodes on this machine, the second killed with its worker after the first results."""
    pytest.importorskip("ray", reason="Ray is not installed (extra: learn)")
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    quiet = {"RAY_DEDUP_LOGS": "0", "RAY_USAGE_STATS_ENABLED": "0", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
    done = subprocess.run(
        [sys.executable, str(SCRIPT)], capture_output=True, text=True, timeout=400, cwd=ROOT,
        env={**os.environ, **quiet, "PYTHONPATH": path},
    )  # fmt: skip
    told = [line for line in done.stdout.splitlines() if line.startswith("TOLD ")]
    assert told, done.stdout[-2000:] + done.stderr[-2000:]
    found = json.loads(told[0].removeprefix("TOLD "))
    assert found["nodes"] == 2
    assert 0 < found["done_at_loss"] < found["cases"]
    assert found["done"] == found["cases"]
    assert found["same"]


def test_no_cluster_is_a_clear_message(tmp_path):
    pytest.importorskip("ray", reason="Ray is not installed (extra: learn)")
    arguments = ["benchmark", "--quick", "--only", "pid", "--ray", "127.0.0.1:1", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 2, done.output
    assert "ray start --head" in done.stderr
