"""What README and docs/rig.md tell a user to type, typed."""

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from experiments.cli import COMMANDS, main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text("utf-8")
RIG = (ROOT / "docs" / "rig.md").read_text("utf-8")


def test_the_environment_example_runs():
    """Catches an example that no longer matches the names, arguments or return values of the package."""
    (code,) = re.findall(r"```python\n(.*?)```", README, re.S)
    assert "found/reference.json" in code
    code = code.replace("found/reference.json", "published").replace("10_000", "400")
    names: dict = {}
    exec(code, names)
    assert np.isfinite(names["observation"]).all()
    assert abs(names["info"]["error"]) < 5.0


@pytest.mark.parametrize("text", [README, RIG], ids=["README", "rig"])
def test_every_command_in_the_text_exists(text):
    """Catches a command or an option that was renamed."""
    lines = re.findall(r"bin/steer-env ([a-z][a-z-]*)([^#\n]*)", text)
    assert len(lines) >= 4
    for name, rest in lines:
        assert name in COMMANDS, name
        inner = re.findall(r"^ ([a-z]+)", rest) if name == "rig" else []
        help_text = CliRunner().invoke(main, [name, *inner, "--help"]).output
        for option in re.findall(r"--[a-z]+", rest):
            assert option in help_text, (name, option)
