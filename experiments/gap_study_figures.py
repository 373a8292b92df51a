"""The report of a blind study of the gap workflow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from experiments.gap_study_summary import BINS
from experiments.report.page import Report
from experiments.report.style import PALETTE, TEMPLATE


def write_study_report(entries: Sequence[dict[str, Any]], document: dict[str, Any], path: Path) -> Path:
    """Write the study as one HTML file."""
    report = Report("Gap workflow: blind study", f"{document['cases']} campaigns of other virtual cars")
    report.section("Figures").table(
        ("figure", "rate", "count", "of"),
        [[k, v["value"], v["count"], v["of"]] for k, v in document["figures"].items()],
    )
    report.section("Detection").figure(
        _curve(document), "Singles named exactly over where the amplitude lies in its range."
    )
    report.figure(_reliability(document), "Claimed probability against how often the name was right.")
    for title, key in (("effect", "by_effect"), ("campaign", "by_campaign")):
        rows = [[name, v["value"], v["count"], v["of"]] for name, v in document[key].items()]
        report.table((title, "named exactly", "count", "of"), rows)
    report.section("Confusion").table(
        ("hidden -> verdict", "cases"), [[k, v] for k, v in sorted(document["confusion"].items())], dense=True
    )
    report.section("Cases").table(
        ("seed", "kind", "campaign", "hidden", "verdict", "named", "before", "after", "noise"),
        [
            [
                e["seed"], e["kind"], e["campaign"], "+".join(e["hidden"]) or e["outside"], e["verdict"],
                "+".join(x["name"] for x in e["effects"]),
                *(e["gap"][k] for k in ("before", "after", "noise_floor")),
            ]
            for e in entries
        ],
        dense=True,
    )  # fmt: skip
    return report.write(path)


def _curve(document: dict[str, Any]) -> go.Figure:
    figure = go.Figure(layout={"template": TEMPLATE, "height": 340})
    rows = [row for row in document["detection_curve"] if row["of"]]
    figure.add_bar(
        x=[f"{row['from']:.2f} to {row['to']:.2f}" for row in rows], y=[row["value"] for row in rows],
        text=[f"{row['count']} of {row['of']}" for row in rows], marker_color=PALETTE[0],
    )  # fmt: skip
    figure.update_yaxes(title="named exactly", range=[0, 1.05])
    figure.update_xaxes(title=f"amplitude in its plausible range, {BINS} parts")
    return figure


def _reliability(document: dict[str, Any]) -> go.Figure:
    figure = go.Figure(layout={"template": TEMPLATE, "height": 340})
    rows = document["reliability"]
    figure.add_scatter(x=[0, 1], y=[0, 1], mode="lines", line={"dash": "dash", "color": "#1F2933"}, name="calibrated")
    figure.add_scatter(
        x=[row["claimed"] for row in rows], y=[row["right"] for row in rows],
        text=[f"{row['of']} names" for row in rows],
        mode="markers+text", textposition="bottom center", marker={"size": 12, "color": PALETTE[1]}, name="study",
    )  # fmt: skip
    figure.update_xaxes(title="claimed probability", range=[0, 1.05])
    figure.update_yaxes(title="share right", range=[0, 1.05])
    return figure
