"""Options that the rig's subcommands share: which motor, which bus, the motor's own settings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

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
