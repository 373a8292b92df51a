"""steer-env gap: find where a campaign and its nominal model disagree, name what is missing, add it."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from experiments.cli_options import common_options, print_json, print_table, progress
from steer_env import __version__, atomic

STEPS = 20  # as often as a search usually advances


@click.command()
@click.argument("campaign", type=click.Path(path_type=Path))
@common_options
def command(campaign: Path, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool) -> None:
    """Find what a plain model of the measurement CAMPAIGN (a folder or its campaign.toml) misses.

    Writes gap.json (verdict, evidence), model.json (the model with what was found, for
    gymnasium.make(..., model="model.json")) and report.html.
    """
    from identification.campaign import read_campaign
    from identification.gap.workflow import find_gap

    del seed  # nothing here is random
    read = read_campaign(campaign)
    with progress("gap", total=STEPS, quiet=quiet) as advance:
        result = find_gap(read, jobs, advance)
        document = write_gap(out, read, result)
    if as_json:
        print_json(document)
        return
    _print(document)
    for name in sorted(path.name for path in out.iterdir() if path.suffix in (".json", ".html")):
        click.echo(f"{out / name}")


def write_gap(out: Path, campaign: Any, result: Any) -> dict[str, Any]:
    """Write gap.json, report.html and, of a vehicle, model.json; returns the content of gap.json."""
    from experiments.report.gap import write_gap_report

    document: dict[str, Any] = result.document()
    provenance = {
        "campaign": campaign.name,
        "files": dict(campaign.hashes),
        "software": f"steer-env {__version__}",
        "date": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }
    with atomic.folder(out) as folder:
        if campaign.kind == "vehicle":
            from identification.gap.extended_model import vehicle_reference
            from steer_env.plants.model_file import ExtendedModel, write_model

            reference = vehicle_reference(campaign.vehicle, result.search.best.solution, provenance)
            write_model(folder / "model.json", ExtendedModel(reference, result.present, provenance))
        atomic.write_text(folder / "gap.json", json.dumps(document, indent=1, allow_nan=False) + "\n")
        write_gap_report(campaign, result, folder / "report.html")
    return document


def _print(document: dict[str, Any]) -> None:
    """The verdict, its parameters and the ranking in a screenful."""
    gap = document["gap"]
    click.echo(f"verdict: {document['verdict']}")
    click.echo(document["reason"])
    before, after, noise = gap["before"], gap["after"], gap["noise_floor"]
    click.echo(f"held-out error over signal: {before:.3g} before, {after:.3g} after, noise {noise:.3g}")
    rows = [
        [e["name"], f"{e['probability']:.2f}", name, p["value"], *p["ci95"]]
        for e in document["effects"]
        for name, p in e["parameters"].items()
    ]
    if rows:
        print_table(("effect", "probability", "parameter", "value", "95 % from", "to"), rows)
    columns = ("candidate", "delta BIC", "held-out z", "puts right", "plausible")
    shown = [
        [r["name"], r["delta_bic"], r["held_out_z"], r["put_right"], "yes" if r["plausible"] else "no"]
        for r in document["ranking"][:6]
    ]
    print_table(columns, shown, title="candidates")
    if document["ambiguous_with"]:
        click.echo(f"not told apart from: {', '.join(document['ambiguous_with'])}")
    if document["next_measurement"]:
        advice = document["next_measurement"]
        click.echo(f"drive next: {advice['manoeuvre']} at {advice['speed_kmh']:g} km/h; {advice['why']}")
