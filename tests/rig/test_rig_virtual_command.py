"""The command line of the virtual motor: what it takes, and what it says of what it does not take."""

import pytest
from click.testing import CliRunner

from experiments.cli import main
from experiments.rig_virtual import fault_of
from steer_env.errors import InputError
from steer_env.rig.virtual.faults import FAULTS, Fault


def run(*arguments: str):
    return CliRunner().invoke(main, ["rig", *arguments])


def test_a_fault_is_read():
    assert fault_of("power_drop") == Fault("power_drop", size=1.0)
    assert fault_of("loss_to_drive@2+0.5=0.25") == Fault("loss_to_drive", 2.0, 0.5, 0.25)
    assert fault_of("sensor_jump@1.5=-0.4") == Fault("sensor_jump", 1.5, size=-0.4)
    for text in ("power drop", "loss_to_drive@", "loss_to_drive=1.2.3", "=1"):
        with pytest.raises(InputError, match=r"--fault|there is no"):
            fault_of(text)


def test_faults_are_listed():
    result = run("virtual", "--fault", "list")
    assert result.exit_code == 0
    assert all(name in result.stdout for name in FAULTS)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--channel", "239.0.0.1"), "ff11::"),
        (("--channel", "ff15::1"), "leave this host"),
        (("--fault", "gremlins"), "gremlins"),
        (("--set", "rated_torque"), "NAME=VALUE"),
        (("--set", "colour=red"), "colour"),
        (("--motor", "odrive", "--set", "rated_torque=-1"), "rated_torque"),
        (("--interface", "teleport"), "teleport"),
        (("--motor", "joystick"), "joystick"),
        (("--seconds", "0"), "--seconds"),
    ],
)
def test_bad_input_ends_with_status_2_and_one_message(arguments, word):
    result = run("virtual", *arguments, "--quiet")
    assert result.exit_code == 2
    assert word in result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.stderr


def test_a_short_life_is_reported():
    result = run(
        "virtual", "--interface", "virtual", "--channel", "short-life", "--seconds", "0.05", "--quiet", "--json"
    )
    assert result.exit_code == 0
    assert '"state": "off"' in result.stdout


def test_the_group_names_what_is_there():
    result = run("--help")
    assert result.exit_code == 0
    assert "virtual" in result.stdout
