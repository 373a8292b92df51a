"""python -m experiments.published_gap: the gap method on the paper's Tables 2 and 3."""

from __future__ import annotations

import click

from experiments.cli_options import print_table
from identification.gap.published_tables import published_gap
from steer_env.plants.reference_file import published


@click.command()
def command() -> None:
    """One trail for all speeds, with and without one pinion stiffness, against the published c_pin,on."""
    found = published_gap()
    rows = [
        [row.speed_kmh, measured, predicted, 100.0 * (predicted / measured - 1.0)]
        for row, measured, predicted in zip(published().rows, found.measured, found.predicted, strict=True)
    ]
    print_table(("km/h", "c_pin,on (N m/rad)", "one trail + stiffness", "error (%)"), rows)
    click.echo(f"relative error: {found.error_before:.3f} with one trail, {found.error_after:.3f} with the stiffness")
    click.echo(f"l_f = {found.l_f:.3f} m, i_s = {found.i_s:.2f}")
    click.echo(found.verdict)


if __name__ == "__main__":
    command()
