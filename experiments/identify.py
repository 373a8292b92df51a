"""steer-env identify: a measurement campaign becomes a haptic reference.

Writes reference.json (docs/formats.md, section 2) and report.html; with both modes also reference_shared.json. A drive
(kind = "drive") gives drive.json and a report instead, because it has no torsion bar, no rack force and no vehicle; a
motor on a bench (kind = "rig") gives rig.json.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import click

from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.report.with_error import with_error
from steer_env import __version__, atomic

SHOWN = ("C_f", "C_r", "n_t", "J_z", "J_ref", "b_ref", "k_gain", "c_pin_on", "c_pin_off", "M_fric_C")


@click.command()
@click.argument("campaign", type=click.Path(path_type=Path))
@click.option(
    "--mode",
    type=click.Choice(["per-speed", "shared", "both"]),
    default="both",
    show_default=True,
    help="Fit the vehicle anew at each speed (as the paper), hold it over speeds, or both.",
)
@click.option(
    "--slip",
    type=click.Choice(["relaxed", "kinematic"]),
    default="relaxed",
    show_default=True,
    help="Form of the rack torque that b_ref belongs to; kinematic as the paper prints Eq. 10.",
)
@click.option("--no-lags", is_flag=True, help="Take all sensors as synchronous instead of finding their lags.")
@common_options
def command(
    campaign: Path,
    mode: str,
    slip: str,
    no_lags: bool,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Turn the measurement CAMPAIGN (a folder or its campaign.toml) into a haptic reference.

    A campaign of kind drive or rig has no vehicle; it gives the parameters of the steering, or of a motor on a bench.
    """
    from identification.campaign import read_campaign

    del seed  # nothing here is random
    read = read_campaign(campaign)
    if read.kind == "drive":
        _drive(read, out, as_json)
    elif read.kind == "rig":
        _rig(read, out, as_json)
    else:
        _vehicle(read, mode, slip, not no_lags, out, jobs, quiet, as_json)


def _drive(campaign: Any, out: Path, as_json: bool) -> None:
    """Stiffness, damping and friction level of a car's log."""
    from experiments.report.drive import write_drive_report
    from identification.drive import DriveModel

    model = DriveModel().fit(campaign)
    document = model.document(campaign)
    _write(out, "drive.json", document, partial(write_drive_report, campaign, model))
    if as_json:
        print_json(document)
        return
    columns = ("parameter", "km/h", "value", "standard error", "95 % from", "to")
    print_table(columns, _drive_rows(document), title=f"drive: {campaign.name}")
    _tell("left-out blocks", document["held_out_rms_Nm"], out, "drive.json")


def _rig(campaign: Any, out: Path, as_json: bool) -> None:
    """Inertia, damping, friction and delay of a motor on a bench."""
    from experiments.report.rig import write_rig_report
    from identification.rig import RigFit

    fit = RigFit().fit(campaign)
    document = fit.document(campaign)
    _write(out, "rig.json", document, partial(write_rig_report, campaign, fit))
    if as_json:
        print_json(document)
        return
    rows = [[name, fit.params_[name], fit.std_[name], *fit.interval_[name]] for name in fit.params_]
    print_table(("parameter", "value", "standard error", "95 % from", "to"), rows, title=f"rig: {campaign.name}")
    _tell("held-out samples", fit.held_out_, out, "rig.json")


def _write(out: Path, name: str, document: Any, write_report: Callable[[Path], Any]) -> None:
    """Both files or none."""
    with atomic.folder(out) as folder:
        atomic.write_text(folder / name, json.dumps(document, indent=1) + "\n")
        write_report(folder / "report.html")


def _tell(judged_on: str, held_out: Mapping[str, float], out: Path, name: str) -> None:
    errors = ", ".join(f"{model} {rms:.3g}" for model, rms in held_out.items())
    click.echo(f"error on {judged_on} in N m: {errors}")
    click.echo(f"{out / name}")
    click.echo(f"{out / 'report.html'}")


def _vehicle(
    campaign: Any, mode: str, slip: str, lags: bool, out: Path, jobs: int, quiet: bool, as_json: bool
) -> None:
    """Steps I to III and the refinement, report and reference."""
    from identification.identify import MODES, Options

    modes = MODES if mode == "both" else (mode,)
    with progress("identify", total=steps_of(campaign, len(modes)), quiet=quiet) as advance:
        result = identify_into(out, campaign, Options(modes, slip, lags), jobs, advance)
    missing = {name: result.missing_keys(name) for name in modes}
    if as_json:
        print_json(_document(result, modes, out))
        return
    print_table(("km/h", *SHOWN), [_row(r) for r in result.modes[modes[0]]], title=f"{campaign.name}, {modes[0]}")
    for line in _remarks(result.modes[modes[0]]):
        click.echo(line)
    for name in modes:
        path = out / _file_name(name, modes)
        if missing[name]:
            click.echo(f"{path.name} not written: no speed identifies {', '.join(missing[name])}")
        else:
            click.echo(f"{path}")
    click.echo(f"{out / 'report.html'}")


def steps_of(campaign: Any, modes: int) -> int:
    """How often ``identify_into`` advances."""
    return len({run.speed_kmh for run in campaign.runs}) * modes + 1


def identify_into(out: Path, campaign: Any, options: Any, jobs: int, advance: Callable[..., None]) -> Any:
    """Identify a vehicle campaign and write its references and report to ``out``; return the Identification."""
    from experiments.report.identify import write_identify_report
    from identification.identify import Interrupted, identify
    from steer_env.plants.reference_file import write_reference

    try:
        result = identify(campaign, options, jobs, advance)
    except Interrupted as stop:
        _keep_partial(stop.result, out)
        raise
    result.provenance.update(
        software=f"steer-env {__version__}", date=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    )
    with atomic.folder(out) as folder:
        for name in options.modes:
            reference = result.reference(name)
            if reference is not None:
                write_reference(folder / _file_name(name, options.modes), reference)
        write_identify_report(campaign, result, folder / "report.html")
    advance(note="report")
    return result


def _keep_partial(result: Any, out: Path) -> None:
    """Write the speeds that were done before an interruption, under a name that no one takes for the whole."""
    from steer_env.plants.reference_file import write_reference

    for mode, found in result.modes.items():
        reference = result.reference(mode) if found else None
        if reference is not None:
            path = out / f"partial_{mode}.json"
            write_reference(path, reference)
            click.echo(f"{len(found)} speeds kept in {path}", err=True)


def _file_name(mode: str, modes: tuple[str, ...]) -> str:
    return "reference_shared.json" if mode == "shared" and len(modes) > 1 else "reference.json"


def _row(result: Any) -> list[object]:
    """One line of the table: value, with its standard error in the same digits; a dash where not identified."""
    unknown = set(result.unidentified())
    cells: list[object] = [f"{result.speed_kmh:g}"]
    for name in SHOWN:
        value, error = result.values.get(name), result.std.get(name)
        cells.append("–" if value is None or name in unknown else with_error(value, error))
    return cells


def _remarks(results: list[Any]) -> list[str]:
    """What was skipped, missing or flagged, one line each, equal ones of several speeds together."""
    found: dict[str, list[str]] = {}
    for result in results:
        for step, why in result.skipped.items():
            found.setdefault(f"step {step} skipped: {why}", []).append(f"{result.speed_kmh:g}")
        missing = [n for n in result.unidentified() if n in result.values]
        if missing:
            text = f"not identified, extrapolated from the other speeds: {', '.join(missing)}"
            found.setdefault(text, []).append(f"{result.speed_kmh:g}")
    everywhere = len(results)
    return [
        text if len(speeds) == everywhere else f"{', '.join(speeds)} km/h: {text}" for text, speeds in found.items()
    ]


def _document(result: Any, modes: tuple[str, ...], out: Path) -> dict[str, Any]:
    """The result as JSON: values and errors by mode and speed, with what was skipped."""
    from steer_env.plants.reference_file import ROW_KEYS

    def finite(table: dict[str, float]) -> dict[str, float]:
        return {ROW_KEYS[n]: v for n, v in table.items() if n in ROW_KEYS and math.isfinite(v)}

    return {
        "references": [str(out / _file_name(m, modes)) for m in modes if not result.missing_keys(m)],
        "report": str(out / "report.html"),
        "modes": {
            m: [
                {
                    "speed_kmh": r.speed_kmh,
                    "values": finite(r.values),
                    "std": finite(r.std),
                    "frf": finite(r.frf),
                    "delays_s": {n: v[0] for n, v in r.delays.items()},
                    "skipped": r.skipped,
                    "not_identified": [ROW_KEYS[n] for n in r.unidentified()],
                    "notes": r.notes,
                }
                for r in result.modes[m]
            ]
            for m in modes
        },
    }


def _drive_rows(document: dict[str, Any]) -> list[list[object]]:
    """One line per parameter of a drive, and per speed where it depends on speed."""
    rows: list[list[object]] = []
    for name, entry in document["parameters"].items():
        if isinstance(entry["value"], list):
            for k, speed in enumerate(document["speed_kmh"]):
                rows.append([name, f"{speed:.0f}", entry["value"][k], entry["std"][k], *entry["ci95"][k]])
        else:
            rows.append([name, "", entry["value"], entry["std"], *entry["ci95"]])
    return rows
