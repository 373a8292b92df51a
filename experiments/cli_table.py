"""A group of commands as a table: each is loaded when it is called, so that help and start stay fast."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from typing import Any, NamedTuple

import click

from steer_env import __version__


class Entry(NamedTuple):
    """Where a command is, and its line in the help (so that the help loads no command)."""

    target: str
    does: str


class TableGroup(click.Group):
    """A group over a table of entries; those whose module this version does not have are left out."""

    table: Mapping[str, Entry] = {}

    def __init__(self, *args: Any, table: Mapping[str, Entry] | None = None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if table is not None:
            self.table = table

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Name the commands of this version, in the order in which one works."""
        return [name for name in self.table if self.is_here(name)]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without loading them."""
        rows = [(name, self.table[name].does) for name in self.list_commands(ctx)]
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Load one command; None where there is no such name."""
        if cmd_name not in self.table:
            return None
        if not self.is_here(cmd_name):
            ctx.fail(f"'{cmd_name}' is not part of version {__version__}.")
        module, attribute = self.table[cmd_name].target.split(":")
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command

    def is_here(self, name: str) -> bool:
        """Whether the command's module is part of this version."""
        return importlib.util.find_spec(self.table[name].target.split(":")[0]) is not None
