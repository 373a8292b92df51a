"""The ranking as a drawing: a dot and its 95 % interval per controller, for all systems and for each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.style import INK, TEMPLATE, Look

LEAST_JND = 0.01  # where a score of zero is drawn on a logarithmic axis
TICKS_JND = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10)
ALL = "together"
ROW_PX = 30


def intervals(
    ranking: Sequence[Mapping[str, Any]], systems: Sequence[Mapping[str, Any]], looks: Mapping[str, Look]
) -> go.Figure:
    """Best on top as ranked over all systems; hollow where a controller is unsafe; a line at one JND."""
    panels = {ALL: ranking} if len(systems) != 1 else {}  # the only system is all there is
    panels |= {f"{s['plant']}<br>{s['causality']}": s["ranking"] for s in systems}
    names = [standing["controller"] for standing in ranking]
    figure = make_subplots(
        1, len(panels), shared_yaxes=True, horizontal_spacing=0.015, column_titles=list(panels),
        column_widths=[1.6, *[1.0] * (len(panels) - 1)],
    )  # fmt: skip
    for column, standings in enumerate(panels.values(), start=1):
        for standing in standings:
            look = looks[standing["controller"]]
            figure.add_trace(_dot(standing, names.index(standing["controller"]), look), row=1, col=column)
    reach = [max(v, LEAST_JND) for s in panels.values() for standing in s for v in standing["score_interval"]]
    low, high = 0.9 * min([*reach, 0.8]), 1.1 * max([*reach, 1.25])
    figure.add_vline(x=1.0, line={"color": INK, "width": 1, "dash": "dash"})
    ticks = [tick for tick in TICKS_JND if low <= tick <= high]
    figure.update_xaxes(type="log", tickvals=ticks, ticktext=[f"{t:g}" for t in ticks], tickangle=0)
    figure.update_xaxes(range=[math.log10(low), math.log10(high)], title_standoff=4)
    figure.update_xaxes(title_text="score [JND]", col=1)
    figure.update_yaxes(
        tickvals=list(range(len(names))), ticktext=[looks[name].label for name in names],
        range=[len(names) - 0.5, -0.5],
    )  # fmt: skip
    height = 140 + ROW_PX * len(names)
    return figure.update_layout(template=TEMPLATE, height=height, showlegend=False, margin={"t": 76})


def _dot(standing: Mapping[str, Any], row: int, look: Look) -> go.Scatter:
    score = max(standing["score"], LEAST_JND)
    low, high = (max(value, LEAST_JND) for value in standing["score_interval"])
    safe = "safe" if standing["safe"] else "unsafe"
    return go.Scatter(
        x=[score], y=[row], mode="markers",
        marker={"color": look.colour, "size": 10, "symbol": "circle" if standing["safe"] else "circle-open",
                "line": {"width": 2, "color": look.colour}},
        error_x={"type": "data", "symmetric": False, "array": [max(high - score, 0.0)],
                 "arrayminus": [max(score - low, 0.0)],
                 "color": look.colour, "thickness": 2, "width": 5},
        hovertemplate=f"<b>{look.label}</b><br>{standing['score']:.3g} JND ({low:.3g} to {high:.3g})<br>"
        f"rank {standing['rank']} ({standing['rank_interval'][0]} to {standing['rank_interval'][1]}), {safe}"
        "<extra></extra>",
    )  # fmt: skip
