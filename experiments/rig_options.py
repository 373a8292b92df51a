"""Options that the rig's subcommands share: which motor, which bus, the motor's own settings."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from steer_env.errors import InputError
from steer_env.rig.motors import MOTORS

INTERFACE, CHANNEL = "udp_multicast", "ff11::7079:1"


def bus_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --motor, --set, --interface, --channel, --bitrate, --port.

    The command receives motor (str), settings (dict), interface, channel (str), bitrate (int or None), port (int).
    """
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def arm_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --torque-cap, --patience, --no-watchdog, --mf4, --arm, --yes of the commands that give torque.

    The command receives torque_cap (float or None), patience (float), no_watchdog, mf4, arm and yes (bool).
    """
    for option in reversed(_ARM_OPTIONS):
        function = option(function)
    return function


def unlocked(env: Any, question: str, arm: bool, yes: bool) -> None:
    """Unlock a ``RigEnv`` if --arm was given and the question, with {cap} in N m, is answered by ARM.

    Raises InputError otherwise, but for the virtual motor of this process, which can hurt nobody.
    """
    connection = env.connection
    if connection.interface == "stepped":
        return
    if not arm:
        raise InputError("rig", "is locked, and nothing was sent", "add --arm when hands are clear of the wheel")
    cap = connection.limits_of(connection.codec()).torque_cap
    if not yes and click.prompt(question.format(cap=cap), default="", show_default=False, err=True) != "ARM":
        raise InputError("rig", "is locked, and nothing was sent", "answer ARM when hands are clear of the wheel")
    env.unlock()


def fresh(ctx: click.Context, out: Path) -> Path:
    """The folder of --out; where it was not given and holds a recording already, the next one with a number."""
    if ctx.get_parameter_source("out") is not ParameterSource.DEFAULT:
        return out
    numbered = (out if k == 1 else out.with_name(f"{out.name}_{k}") for k in count(1))
    return next(folder for folder in numbered if not folder.exists() or not any(folder.iterdir()))


def _settings(ctx: click.Context, parameter: click.Parameter, given: tuple[str, ...]) -> dict[str, Any]:
    settings: dict[str, Any] = {}
    for text in given:
        name, found, value = text.partition("=")
        if not found:
            raise InputError(f"--set {text}", "has no value", "write NAME=VALUE, such as rated_torque=2.5")
        settings[name.strip()] = value_of(value.strip())
    return settings


def value_of(text: str) -> int | float | str:
    """A whole number, a number, or else the text itself."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


settings_option = click.option(
    "--set",
    "settings",
    multiple=True,
    callback=_settings,
    metavar="NAME=VALUE",
    help="A setting of the motor (sign, zero, node, rated_torque, ...); may be repeated.",
)
_OPTIONS = (
    click.option("--motor", type=click.Choice(list(MOTORS)), default="senso_wheel", show_default=True),
    settings_option,
    click.option(
        "--interface", default=INTERFACE, show_default=True, metavar="NAME",
        help="python-can's: socketcan, pcan, slcan, ...; udp_multicast stays on this computer.",
    ),
    click.option("--channel", default=CHANNEL, show_default=True, metavar="NAME", help="can0, or a group's address."),
    click.option("--bitrate", type=click.IntRange(10_000, 1_000_000), default=None, metavar="N", help="Of the bus."),
    click.option(
        "--port", type=click.IntRange(1024, 65535), default=43113, show_default=True, metavar="N",
        help="UDP port of udp_multicast.",
    ),
)  # fmt: skip
_ARM_OPTIONS = (
    click.option(
        "--torque-cap", type=float, default=None, metavar="NM", help="[default: 2 N m, or the drive's rating]"
    ),
    click.option(
        "--patience", type=float, default=1.0, show_default=True, metavar="FACTOR",
        help="On how late a cycle, a measurement or a beat may be: up to 10, for virtual motors on a busy computer.",
    ),
    click.option("--no-watchdog", is_flag=True, help="For a bus that only one process can open."),
    click.option("--mf4", is_flag=True, help="Frames and runs also as MF4, in OUT/mf4 ('steer-env[formats]')."),
    click.option("--arm", is_flag=True, help="Without it nothing is sent; asks once more."),
    click.option("--yes", is_flag=True, help="The answer to that question, for virtual motors and scripts."),
)  # fmt: skip
