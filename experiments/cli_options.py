"""What every command shares: its options, its progress bar, its result on stdout.

@click.command()
@click.argument("campaign", type=click.Path(path_type=Path))
@common_options
def command(campaign, out, seed, jobs, quiet, as_json):
    with progress("identify", total=7, quiet=quiet) as advance:
        ...
        advance(note="60 km/h")
    print_json(result) if as_json else print_table(columns, rows)
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

OUTPUTS = Path("outputs")


def common_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --out, --seed, --jobs, --quiet, --json, --debug.

    The command receives out (Path), seed (int), jobs (int), quiet (bool), as_json (bool).
    """
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


@contextmanager
def progress(description: str, total: int, quiet: bool = False) -> Iterator[Callable[..., None]]:
    """Show a progress bar on stderr and hand out advance(steps=1, note="").

    Args:
        description: what is being done, a few words.
        total: number of steps.
        quiet: show nothing; advance() is then free.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("[dim]{task.fields[note]}", table_column=None),
    )
    with Progress(*columns, console=Console(stderr=True), disable=quiet) as bar:
        task = bar.add_task(description, total=total, note="")

        def advance(steps: int = 1, note: str = "") -> None:
            bar.update(task, advance=steps, note=note)

        yield advance


def print_table(columns: Sequence[str], rows: Sequence[Sequence[object]], title: str = "") -> None:
    """Print a short result table to stdout; columns of numbers (float or str) to the right."""
    table = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for position, name in enumerate(columns):
        numeric = all(_is_number(row[position]) for row in rows)
        table.add_column(name, justify="right" if numeric else "left")
    for row in rows:
        table.add_row(*(_cell(value) for value in row))
    # Piped output has no width: do not fold what another program reads.
    console = Console(markup=False, highlight=False)
    if not console.is_terminal:
        console.width = 200
    console.print(table)


def print_json(content: Mapping[str, Any]) -> None:
    """Print the result as JSON to stdout; NaN is refused because JSON has none."""
    click.echo(json.dumps(content, indent=2, allow_nan=False))


def _default_out() -> Path:
    name = click.get_current_context().info_name or "steer-env"
    return OUTPUTS / name.rpartition(".")[2]  # "python -m experiments.gap_study" writes to outputs/gap_study


def _set_debug(ctx: click.Context, _parameter: click.Parameter, value: bool) -> None:
    ctx.find_root().meta["debug"] = value or ctx.find_root().meta.get("debug", False)


def _is_number(value: object) -> bool:
    try:
        float(str(value))
    except ValueError:
        return str(value) in ("", "-", "–")
    return True


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


debug_option = click.option(
    "--debug",
    is_flag=True,
    expose_value=False,
    callback=_set_debug,
    help="Show the traceback when something goes wrong.",
)

_OPTIONS = (
    click.option(
        "--out",
        type=click.Path(file_okay=False, path_type=Path),
        default=_default_out,
        metavar="DIR",
        help="Folder to write to; made if missing. [default: outputs/COMMAND]",
    ),
    click.option(
        "--seed",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        metavar="N",
        help="Seed of everything random; the same seed gives the same bits.",
    ),
    click.option(
        "--jobs",
        type=click.IntRange(min=1),
        default=lambda: os.cpu_count() or 1,
        metavar="N",
        help="Processes to work with. [default: the number of cores]",
    ),
    click.option("--quiet", is_flag=True, help="No progress on stderr."),
    click.option("--json", "as_json", is_flag=True, help="Print the result as JSON."),
    debug_option,
)
