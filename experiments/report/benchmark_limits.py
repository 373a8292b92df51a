"""How near controllers come to what any controller could reach, and what a step of them costs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.benchmark_scope import systems_in
from experiments.report.page import Report
from experiments.report.style import REFERENCE, TEMPLATE, Look
from steer_env.envs.layout import PERIOD

Record = Mapping[str, Any]
Looks = Mapping[str, Look]
TICKS_JND = [digit * 10.0**decade for decade in range(-4, 3) for digit in (1, 2, 5)]


def limit(report: Report, summary: Record, looks: Looks) -> None:
    """Distance to the limit, from ``limit``: records of a place, its limit and what each controller reached."""
    records: Sequence[Record] = summary.get("limit") or ()
    if not records:
        return
    report.section("Distance to the limit")
    report.text(" ".join(_sentences(records, looks)))
    if summary.get("policies"):
        report.text(
            "Policies are left out: the limit is that of a linear loop, and what a policy's loop does about one point "
            "says little of its error elsewhere."
        )
    report.figure(
        limits(records, looks),
        "Tracking error in JND of the linear loop: the limit (black) and what controllers reach, median over arms. The "
        "limit is what delay, noise, the motor and a hand that nobody can foresee leave to any controller.",
    )
    systems = _systems(records)
    report.table(
        ["controller", *systems],
        [[look.label, *(_cell(here, name) for here in systems.values())] for name, look in looks.items()],
        "Tracking error over the limit's at the same speed and arm, 1 is the limit: median (nearest to farthest).",
    )


def limits(records: Sequence[Record], looks: Looks) -> go.Figure:
    """JND over speed, one panel per system; the limit is the black line."""
    systems = _systems(records)
    figure = make_subplots(
        1, len(systems), shared_yaxes=True, horizontal_spacing=0.015,
        column_titles=[system.replace(" ", "<br>") for system in systems],
    )  # fmt: skip
    named: set[str] = set()
    for column, here in enumerate(systems.values(), start=1):
        speeds = sorted({r["speed_kmh"] for r in here})
        lines = {"limit": (REFERENCE, "line-ew", [_median(_at(here, v), None) for v in speeds])}
        for name, look in looks.items():
            if any(r["reached"].get(name) is not None for r in here):
                lines[look.label] = look.colour, look.symbol, [_median(_at(here, v), name) for v in speeds]
        for label, (colour, symbol, values) in lines.items():
            of_limit, shown = label == "limit", label not in named
            named.add(label)
            figure.add_trace(
                go.Scatter(
                    x=speeds, y=values, name=label, legendgroup=label, showlegend=shown,
                    mode="lines" if of_limit and len(speeds) > 1 else "markers",
                    line={"color": colour, "width": 2.5},
                    marker={"color": colour, "symbol": symbol, "size": 14 if of_limit else 8,
                            "line": {"width": 3 if of_limit else 0, "color": colour}},
                ),
                row=1, col=column,
            )  # fmt: skip
    figure.add_hline(y=1.0, line={"color": "#9AA5B1", "width": 1, "dash": "dash"})
    figure.update_yaxes(type="log", tickvals=TICKS_JND, ticktext=[f"{t:g}" for t in TICKS_JND])
    figure.update_yaxes(title_text="tracking error [JND]", col=1)
    speeds = sorted({r["speed_kmh"] for r in records})
    margin = 0.08 * (speeds[-1] - speeds[0]) or 5.0
    figure.update_xaxes(title_text="speed [km/h]", tickvals=speeds, range=[speeds[0] - margin, speeds[-1] + margin])
    legend = {"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top"}
    return figure.update_layout(template=TEMPLATE, height=450, legend=legend, margin={"t": 76})


def step_cost(report: Report, summary: Record, looks: Looks) -> None:
    """What one step costs, from ``step_cost``: microseconds by controller."""
    costs: Mapping[str, Record] = summary.get("step_cost") or {}
    if not costs:
        return
    period_us = 1e6 * PERIOD
    report.section("What a step costs")
    report.table(
        ["controller", "median [µs]", "99.9 % [µs]", "99.9 % of the period [%]"],
        [
            [looks[name].label if name in looks else name, f"{cost['p50_us']:.2f}", f"{cost['p999_us']:.2f}",
             f"{100.0 * cost['p999_us'] / period_us:.2f}"]
            for name, cost in sorted(costs.items(), key=lambda item: item[1]["p50_us"])
        ],
        f"Time of one call of the compiled law in a loop with {systems_in(summary)[0][0]}, in the slower of the "
        "causalities, the least of three passes over the same observations, on the machine of this run; the control "
        f"period is {period_us:.0f} µs.",
    )  # fmt: skip


def _systems(records: Sequence[Record]) -> dict[str, list[Record]]:
    found: dict[str, list[Record]] = {}
    for record in records:
        found.setdefault(f"{record['plant']} {record['causality']}", []).append(record)
    return found


def _at(records: Sequence[Record], speed: float) -> list[Record]:
    return [r for r in records if r["speed_kmh"] == speed]


def _median(records: Sequence[Record], name: str | None) -> float | None:
    values = [r["limit_jnd"] if name is None else r["reached"].get(name) for r in records]
    known = [value for value in values if value is not None]
    return median(known) if known else None


def _ratios(records: Sequence[Record], name: str) -> list[float]:
    return [
        r["reached"][name] / r["limit_jnd"]
        for r in records
        if r["reached"].get(name) is not None and r["limit_jnd"] > 0.0
    ]


def _cell(records: Sequence[Record], name: str) -> str | None:
    """Median (nearest to farthest) of a controller, and where its linear loop is unstable."""
    asked = [r for r in records if name in r["reached"]]
    ratios, lost = _ratios(records, name), sum(r["reached"][name] is None for r in asked)
    spread = f" ({min(ratios):.2f}–{max(ratios):.2f})" if len(ratios) > 1 else ""
    words = f"{median(ratios):.2f}{spread}" if ratios else ""
    unstable = f"unstable at {lost} of {len(asked)}" if lost else ""
    return ", ".join(filter(None, (words, unstable))) or None


def _middle(records: Sequence[Record], name: str) -> float:
    """Median over the limit's error; an unstable loop is infinitely far."""
    asked = [r for r in records if name in r["reached"] and r["limit_jnd"] > 0.0]
    reached = [math.inf if r["reached"][name] is None else r["reached"][name] / r["limit_jnd"] for r in asked]
    return median(reached) if reached else math.inf


def _sentences(records: Sequence[Record], looks: Looks) -> list[str]:
    above = sum(r["limit_jnd"] > 1.0 for r in records)
    sentences = [f"No controller could come nearer than 1 JND at {above} of {len(records)} places."] if above else []
    middle = {name: _middle(records, name) for name in looks if any(name in r["reached"] for r in records)}
    best = min(middle, key=lambda name: middle[name], default="")
    if middle and math.isfinite(middle[best]):
        sentences.append(
            f"**{looks[best].label}** is nearest to the limit: {middle[best]:.2f} times its error in the median."
        )
    return sentences
