"""The program's contract: exit statuses, one message, nothing on stdout but the result."""

import importlib
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from experiments import cli
from experiments.cli_options import common_options, print_json, print_table, progress
from steer_env import __version__
from steer_env.errors import InputError

FAKE_MODULE = """
import click
from experiments.cli_options import common_options
from steer_env.errors import InputError

@click.command()
@click.option("--how", default="well")
@common_options
def command(how, out, seed, jobs, quiet, as_json):
    match how:
        case "bad-input":
            raise InputError("campaign.toml: vehicle.mass_kg", "is -3", "write the mass in kg")
        case "interrupt":
            raise KeyboardInterrupt
        case "fault":
            raise ZeroDivisionError("division by zero")
        case "read-only":
            raise PermissionError(13, "Permission denied", str(out))
    click.echo(f"{out} {seed} {jobs > 0} {quiet} {as_json}")
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run the program with one more command, 'fake', and one whose module does not exist."""
    (tmp_path / "fake_steer_command.py").write_text(FAKE_MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(cli.COMMANDS, "fake", cli.Entry("fake_steer_command:command", "A fake."))
    monkeypatch.setitem(cli.COMMANDS, "absent", cli.Entry("no_such_module:command", "Not here."))
    yield lambda *arguments: CliRunner().invoke(cli.main, arguments)
    sys.modules.pop("fake_steer_command", None)


def test_options_reach_the_command_with_their_defaults(run):
    result = run("fake")
    assert result.exit_code == 0
    assert result.stdout == f"{Path('outputs/fake')} 0 True False False\n"
    result = run("fake", "--out", "here", "--seed", "7", "--quiet", "--json")
    assert result.stdout == "here 7 True True True\n"
    module = importlib.import_module("fake_steer_command")
    result = CliRunner().invoke(module.command, prog_name="python -m experiments.fake")
    assert result.stdout.startswith(f"{Path('outputs/fake')} ")  # and not a folder with blanks in its name


@pytest.mark.parametrize(
    ("how", "status", "message"),
    [
        (
            "bad-input",
            2,
            "campaign.toml: vehicle.mass_kg: is -3. To mend it: write the mass in kg.",
        ),
        ("interrupt", 130, "interrupted; partial results kept"),
        ("fault", 1, "ZeroDivisionError"),
        ("read-only", 2, "Permission denied"),
    ],
)
def test_every_ending_has_its_status_and_one_message(run, how, status, message):
    """Catches a traceback shown to a user, a wrong status, and a message on stdout."""
    result = run("fake", "--how", how)
    assert result.exit_code == status
    assert message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ""


@pytest.mark.parametrize("arguments", [("--debug", "fake"), ("fake", "--debug")])
def test_debug_shows_the_traceback(run, arguments):
    result = run(*arguments, "--how", "fault")
    assert result.exit_code == 1
    assert "Traceback" in result.stderr


@pytest.mark.parametrize(
    "arguments", [("nonsense",), ("absent",), ("fake", "--seed", "-1"), ("fake", "--jobs", "0")]
)
def test_wrong_usage_is_status_2(run, arguments):
    result = run(*arguments)
    assert result.exit_code == 2
    assert "Error:" in result.stderr


def test_help_lists_what_is_here_without_loading_it(run):
    result = run("--help")
    assert "fake" in result.stdout
    assert "absent" not in result.stdout
    assert "fake_steer_command" not in sys.modules


@pytest.mark.parametrize("name", list(cli.COMMANDS))
def test_every_command_that_is_here_has_help_and_the_common_options(name):
    """Catches a command module that does not import, or forgot the common options."""
    if name not in cli.main.list_commands(click.Context(cli.main)):
        assert CliRunner().invoke(cli.main, [name]).exit_code == 2
        return
    result = CliRunner().invoke(cli.main, [name, "--help"])
    assert result.exit_code == 0, result.output
    command = cli.main.get_command(click.Context(cli.main), name)
    if not isinstance(command, click.Group):
        for option in ("--out", "--seed", "--jobs", "--quiet", "--json"):
            assert option in result.stdout


def test_runs_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "experiments.cli", "--version"], capture_output=True, text=True
    )
    assert done.returncode == 0
    assert __version__ in done.stdout


def test_progress_goes_to_stderr_and_quiet_silences_it(capsys):
    for quiet in (False, True):
        with progress("drive", total=2, quiet=quiet) as advance:
            advance(note="60 km/h")
            advance()
        captured = capsys.readouterr()
        assert captured.out == ""
        assert ("drive" in captured.err) is not quiet


def test_results_on_stdout(capsys):
    print_table(["name", "value"], [["J_ref", 0.0412345], ["[b]", 2.0]])
    out = capsys.readouterr().out
    assert "0.04123" in out
    assert "[b]" in out  # markup in a user's name is text, not a command
    with pytest.raises(ValueError, match="Out of range"):
        print_json({"value": float("nan")})


def test_input_errors_travel_between_processes():
    """A worker process pickles the error; an __init__ with other args would break on arrival."""
    import pickle

    error = pickle.loads(pickle.dumps(InputError("a.toml", "is\nempty.", "fill it.")))
    assert str(error) == "a.toml: is empty. To mend it: fill it."


def test_common_options_keep_the_functions_own_arguments():
    @click.command()
    @click.argument("campaign")
    @common_options
    def command(campaign, **options):
        click.echo(f"{campaign} {sorted(options)}")

    result = CliRunner().invoke(command, ["folder"])
    assert result.stdout == "folder ['as_json', 'jobs', 'out', 'quiet', 'seed']\n"
