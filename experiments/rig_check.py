"""steer-env rig check: from a bus that is up to limits that limit, step by step, with a verdict and a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from experiments.cli_options import common_options, print_json, print_table
from experiments.rig_options import bus_options

if TYPE_CHECKING:
    from experiments.report.page import Report
    from experiments.rig_checks import Bench, Finding

VERDICTS = {True: "pass", False: "FAIL", None: "look"}
CONFIRM = "The motor will turn the wheel with up to 0.5 N m. Hands clear and the rig fixed? Type ARM"


@click.command()
@bus_options
@click.option("--arm", is_flag=True, help="Also the checks that turn the wheel; asks once more.")
@click.option("--yes", is_flag=True, help="The answer to that question, for virtual motors and scripts.")
@click.option("--seconds", default=5.0, show_default=True, help="How long timing is measured.")
@common_options
@click.pass_context
def command(
    ctx: click.Context,
    motor: str,
    settings: dict[str, Any],
    interface: str,
    channel: str,
    bitrate: int | None,
    port: int,
    arm: bool,
    yes: bool,
    seconds: float,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Check a rig before it is trusted. Exit status 1 if a check fails."""
    from experiments.rig_checks import Bench, all_checks
    from steer_env.rig import motors
    from steer_env.rig.bus import open_bus
    from steer_env.rig.connection import OWN_PROCESS_ONLY
    from steer_env.rig.watchdog import Watchdog

    armed = arm and (yes or click.prompt(CONFIRM, default="", show_default=False, err=True) == "ARM")
    codec = motors.make(motor, **settings)
    bus: dict[str, Any] = {"interface": interface, "channel": channel, "port": port}
    bus |= {"bitrate": bitrate or codec.bitrate, "data_bitrate": codec.data_bitrate}
    alone = interface in OWN_PROCESS_ONLY
    findings = []
    with open_bus(**bus) as link:
        bench = Bench(link, codec, lambda: None if alone else Watchdog(motor, settings, bus))
        for finding in all_checks(bench, armed, seconds):
            findings.append(finding)
            if not quiet:
                click.echo(f"{VERDICTS[finding.passed]:5} {finding.check}: {finding.found}", err=True)
    out.mkdir(parents=True, exist_ok=True)
    path = page(findings, bench, f"{motor} on {interface} {channel}").write(out / "report.html")
    failed = [finding.check for finding in findings if finding.passed is False]
    if as_json:
        rows = [finding._asdict() for finding in findings]
        print_json({"findings": rows, "failed": failed, "report": str(path)})
    else:
        print_table(("check", "verdict", "found"), [(f.check, VERDICTS[f.passed], f.found) for f in findings])
        click.echo(f"{len(failed)} failed; {path}")
    if failed:
        ctx.exit(1)


def page(findings: list[Finding], bench: Bench, rig: str) -> Report:
    """The report: verdicts, and how round trips and lateness are spread."""
    import plotly.graph_objects as go

    from experiments.report.page import Report

    report = Report("Check of a rig", rig)
    report.table(("check", "verdict", "found"), [(f.check, VERDICTS[f.passed], f.found) for f in findings])
    for name, seconds in (("Round trip", bench.round_trips), ("Cycle begins late", bench.late)):
        if seconds:
            bars = go.Histogram(x=[1e3 * value for value in seconds], nbinsx=100, name=name)
            figure = go.Figure(bars).update_xaxes(title=f"{name} / ms").update_yaxes(title="cycles", type="log")
            report.figure(figure, f"{name}, {len(seconds)} cycles of zero torque")
    return report
