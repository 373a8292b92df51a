"""The program steer-env: a table of commands, each loaded when it is called, and the exit statuses.

0 done, 1 a fault of ours, 2 bad input or usage, 130 interrupted.
"""

import errno
import traceback
from typing import Any

import click

from experiments.cli_options import debug_option
from experiments.cli_table import Entry, TableGroup
from steer_env import __version__
from steer_env.errors import InputError, RigError

FAULT, BAD_INPUT, INTERRUPTED = 1, 2, 130
# What the user can mend although Python, not we, noticed it.
_USERS_DISK = (errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EPERM)


COMMANDS = {
    "demo": Entry(
        "experiments.demo:command", "The main job, end to end, on what the package ships."
    ),
    "simulate": Entry(
        "experiments.simulate:command", "Drive the virtual test vehicle: a campaign."
    ),
    "identify": Entry("experiments.identify:command", "Turn a campaign into a haptic reference."),
    "benchmark": Entry(
        "experiments.benchmark:command", "Score controllers on tracking a reference."
    ),
    "robustness": Entry("experiments.robustness:command", "Prove controllers stable before they are scored."),
    "tune": Entry("experiments.tune:command", "Tune a controller's gains on the training cases."),
    "train": Entry("experiments.train:command", "Train a torque policy."),
    "gap": Entry("experiments.gap:command", "Find, name and add the effect that a model misses."),
    "rig": Entry("experiments.rig:command", "A force-feedback motor on a CAN bus."),
    "reproduce-paper": Entry(
        "experiments.reproduce_paper:command", "Lay the published figures and tables beside ours."
    ),
}


class Program(TableGroup):
    """A group that loads a command when it is named and turns exceptions into exit statuses."""

    table = COMMANDS

    def invoke(self, ctx: click.Context) -> Any:
        """Run, and say what went wrong in one message on stderr."""
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit):
            raise  # click's own: usage errors (2), --help
        except InputError as error:
            _stop(ctx, BAD_INPUT, str(error), error)
        except RigError as error:
            _stop(ctx, BAD_INPUT, str(error), error)
        except (KeyboardInterrupt, click.Abort) as error:
            _stop(ctx, INTERRUPTED, "interrupted; partial results kept", error)
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise  # the reader of our stdout left; click ends quietly
            if error.errno in _USERS_DISK:
                _stop(ctx, BAD_INPUT, f"{error.filename or 'what is written'}: {error.strerror}", error)
            _stop(ctx, FAULT, _fault(error), error)
        except Exception as error:
            _stop(ctx, FAULT, _fault(error), error)


def _fault(error: Exception) -> str:
    return (
        f"a fault in steer-env ({type(error).__name__}: {error}). "
        "Run again with --debug and report what it prints."
    )


def _stop(ctx: click.Context, status: int, message: str, error: BaseException) -> None:
    if ctx.find_root().meta.get("debug"):
        click.echo("".join(traceback.format_exception(error)), err=True)
    click.echo(f"steer-env: {message}", err=True)
    ctx.exit(status)


@click.group(cls=Program, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="steer-env")
@debug_option
def main() -> None:
    """From steering measurements to a haptic reference, and to environments that track it."""


if __name__ == "__main__":
    main(prog_name="steer-env")
