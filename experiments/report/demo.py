"""The page of the demo: what was measured, what was found in it, and how a wheel was made to feel so."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.bench_scores import Result, short_table
from experiments.bench_verdict import LIMIT_DB, LIMIT_DEG, REQUIRED_BAND_HZ, Verdict, verdicts
from experiments.report import benchmark_figures, identify_figures
from experiments.report.page import Report
from identification.result import Identification

USE = """
The reference is now a file, and every environment takes it:

```python
import gymnasium
import steer_env
import controllers

env = gymnasium.make("steer_env/SbW-Impedance-v0", reference="identified/reference.json", speed_kmh=75)
controller = controllers.make("pid", env.unwrapped.plant, env.unwrapped.reference, "impedance")
observation, info = env.reset(seed=0)
controller.reset(1e-3)
for _ in range(10_000):
    action = env.unwrapped.action_for(controller(info["observation"]))
    observation, reward, terminated, truncated, info = env.step(action)
```
"""


def write_demo_report(
    out: Path,
    found: Identification,
    judged: Sequence[dict[str, Any]],
    results: Sequence[Result],
    seed: int,
) -> Path:
    """Write OUT/report.html and return its path."""
    report = Report(
        "From a measured car to a wheel that feels like it",
        "A virtual test vehicle is measured, its haptic reference identified, and controllers scored",
        {"seed": seed},
    )
    found_verdicts = verdicts(results)
    report.key_numbers(_key_numbers(judged, found_verdicts))
    _identified(report, found, judged)
    _tracked(report, results, found_verdicts)
    report.section("Use it").text(USE)
    report.text(
        "Details: [identification](identified/report.html), [benchmark](benchmark/report.html), "
        "[the campaign's description](campaign/campaign.toml)."
    )
    return report.write(out / "report.html")


def _key_numbers(judged: Sequence[dict[str, Any]], told: Sequence[Verdict]) -> list[tuple[str, str]]:
    within = sum(abs(r["value"] - r["true"]) <= 1.96 * r["std"] for r in judged)
    numbers = [(f"{within} of {len(judged)}", "true parameters inside their 95 % intervals")]
    best = [v for v in told if v.controller == "pid" and v.error is not None]
    if best:
        worst = max(best, key=lambda v: v.error or 0.0)
        numbers.append(
            (
                f"{100.0 * (worst.error or 0.0):.1f} %",
                f"largest pid error ({worst.plant} {worst.causality})",
            )
        )
        factors = [v.factor for v in best if v.factor is not None]
        if factors:
            numbers.append((f"{min(factors):.1f} x", "at least so much better than the open-loop map"))
    return numbers


def _identified(report: Report, found: Identification, judged: Sequence[dict[str, Any]]) -> None:
    speeds = next(iter(found.modes.values()))
    report.section("What was found in the measurement").text(
        "The steering robot drove sweeps and sines; the log has noise, resolution and latencies. The car "
        "is richer than the model: two tracks, load transfer, roll, saturating tyres, an assist table. "
        "Its true linear parameters are known, so the identification can be judged. Where a true value "
        "lies outside an interval, the model's honest error is larger than its statistical one."
    )
    rows = [
        [
            f"{r['speed_kmh']:g}",
            r["name"],
            r["true"],
            r["value"],
            1.96 * r["std"],
            f"{100.0 * (r['value'] / r['true'] - 1.0):+.1f} %",
        ]
        for r in judged
    ]
    report.table(
        ["km/h", "parameter", "true", "identified", "± 95 %", "off by"],
        rows,
        "SI units: N/rad, m, kg m², N m s/rad, -, N m/rad, N m.",
    )
    pinion = identify_figures.response(speeds, "pinion_angle", "rad/(N m)")
    if pinion is not None:
        report.figure(
            pinion,
            "Pinion angle per torsion-bar torque. Lines: Eq. 10 with linearised assist and without "
            "friction; what differs below 1 Hz is the assist curve and friction, found from the loops below.",
        )
    loops = identify_figures.loops(speeds)
    if loops is not None:
        report.figure(loops, "Torque over angle at 0.2 Hz: what the driver feels in a slow corner.")


def _tracked(report: Report, results: Sequence[Result], told: Sequence[Verdict]) -> None:
    report.section("A wheel that has to feel like it").text(
        "The identified reference at 75 km/h, tracked with measured signals only (resolution, noise, "
        "latency, dead time, motor lag) under a relaxed arm. Impedance: angle in, torque tracked. "
        "Admittance: torque in, angle tracked."
    )
    columns, rows = short_table(told)
    report.table(columns, rows, "Error: rms over the rms of the reference. Map error: the map's, relative.")
    for plant in dict.fromkeys(v.plant for v in told):
        here = [r for r in results if r["case"]["plant"] == plant]
        full = [r for r in here if not r["case"]["linear"]]
        linear = [r for r in here if r["case"]["linear"] and not r["case"]["prompt"]]
        sines = [r for r in full if r["case"]["manoeuvre"] == "steady_state"]
        report.figure(
            benchmark_figures.loops(sines),
            f"{plant}: torque over angle at 0.2 Hz, dashed the reference.",
        )
        curves = [curve for curve in map(benchmark_figures.deviation_of, linear) if curve is not None]
        report.figure(
            benchmark_figures.deviations(curves, LIMIT_DB, LIMIT_DEG, REQUIRED_BAND_HZ),
            f"{plant}: deviation from the linear reference; the band is {LIMIT_DB} dB and {LIMIT_DEG:g} deg.",
        )
    for verdict in told:
        if verdict.controller == "pid":
            report.text(f"**{verdict.plant}, {verdict.causality}:** {verdict.text}")
