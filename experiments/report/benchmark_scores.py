"""Scores of cases, grouped: where a controller gains and where it loses, as heat maps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.report.style import TEMPLATE, Look

Result = dict[str, Any]
Column = tuple[str, Sequence[Result]]  # label on the axis, the cases behind it
LEAST_JND, MOST_JND = 0.1, 10.0
TICKS_JND = (0.1, 0.2, 0.5, 1, 2, 5, 10)
# One JND is white: what lies on the blue side is less than a driver begins to notice.
JND_COLOURS = ((0.0, "#2166AC"), (0.25, "#92C5DE"), (0.5, "#F7F7F7"), (0.75, "#F4A582"), (1.0, "#B2182B"))
HOVER = (
    "<b>%{y}</b>, %{x}<br>%{customdata[0]} JND (interquartile mean of %{customdata[2]} cases)<br>"
    "worst case %{customdata[1]} JND, %{customdata[3]} unstable<extra></extra>"
)
BAR_PX, TITLE_PX = 280, 125  # of the colours; of a row's title on its side
ROW_PX, BETWEEN_PX, FRAME_PX, LABELS_PX = 21, 14, 62, 96


class Cell(NamedTuple):
    """Cases of one controller that belong together; ``score`` is their interquartile mean in JND."""

    score: float
    worst: float
    cases: int
    unstable: int


def cell_of(results: Sequence[Result]) -> Cell | None:
    """Summary of scored cases, None where there are none."""
    if not results:
        return None
    protocol = Protocol.load()
    scores = sorted(case_score(result, protocol) for result in results)
    cut = len(scores) // 4
    unstable = sum(not result["stable"] for result in results)
    return Cell(float(np.mean(scores[cut : len(scores) - cut])), scores[-1], len(scores), unstable)


def columns_of(results: Sequence[Result], key: Callable[[dict[str, Any]], str]) -> list[Column]:
    """One column per value of a field of the case."""
    found: dict[str, list[Result]] = {}
    for result in results:
        found.setdefault(key(result["case"]), []).append(result)
    return list(found.items())


def by_speed_and_arm(results: Sequence[Result]) -> list[list[Column]]:
    """Groups of columns: every speed, then every arm where there are several."""
    rising = sorted(results, key=lambda result: result["case"]["speed_kmh"])
    groups = [columns_of(rising, lambda case: f"{case['speed_kmh']:g} km/h"), columns_of(results, arm_words)]
    return [groups[0], *(group for group in groups[1:] if len(group) > 1)]


def by_everything(results: Sequence[Result]) -> list[list[Column]]:
    """Groups of columns: systems, manoeuvres, arms, speeds; a group of one says nothing and is left out."""
    groups = [
        columns_of(results, lambda case: f"{case['plant']} {case['causality']}"),
        columns_of(results, lambda case: case["manoeuvre"].replace("_", " ")),
        *by_speed_and_arm(results)[::-1],
    ]
    return [group for group in groups if len(group) > 1]


def arm_words(case: Mapping[str, Any]) -> str:
    """The arm's name as words."""
    return str(case["arm"]).replace("_", " ")


def score_maps(
    panels: Mapping[tuple[str, str], Sequence[Sequence[Column]]], names: Sequence[str], looks: Mapping[str, Look]
) -> go.Figure:
    """One heat map per panel (row title, column title), controller over columns; groups stand apart."""
    rows, across = (list(dict.fromkeys(key[k] for key in panels)) for k in (0, 1))
    panel_px = max(ROW_PX * len(names), TITLE_PX if any(rows) else 0)
    height = FRAME_PX + LABELS_PX + len(rows) * panel_px + (len(rows) - 1) * BETWEEN_PX
    height = max(height, FRAME_PX + BAR_PX + 30)
    figure = make_subplots(
        len(rows), len(across), shared_yaxes=True, horizontal_spacing=0.02,
        vertical_spacing=BETWEEN_PX / (height - FRAME_PX - LABELS_PX), shared_xaxes=True,
        column_titles=across if any(across) else None, row_titles=rows if any(rows) else None,
    )  # fmt: skip
    for (row, column), groups in panels.items():
        _score_map(figure, rows.index(row) + 1, across.index(column) + 1, groups, names, looks)
    figure.update_xaxes(ticks="", showticklabels=False)
    figure.update_xaxes(ticks="outside", showticklabels=True, row=len(rows))
    margin = {"t": FRAME_PX, "b": LABELS_PX, "r": 30}
    return figure.update_layout(template=TEMPLATE, height=height, margin=margin, coloraxis=_scale())


def _score_map(
    figure: go.Figure, row: int, column: int, groups: Sequence[Sequence[Column]], names: Sequence[str],
    looks: Mapping[str, Look],
) -> None:  # fmt: skip
    spread: list[Column | None] = []
    for group in groups:
        spread += [*([None] if spread else []), *group]
    cells = [[_own(name, entry) for entry in spread] for name in names]
    figure.add_trace(
        go.Heatmap(
            z=[[None if cell is None else _place(cell.score) for cell in line] for line in cells],
            text=[["" if cell is None else _words(cell) for cell in line] for line in cells],
            texttemplate="%{text}", textfont={"size": 10.5}, hoverongaps=False, coloraxis="coloraxis", xgap=1, ygap=1,
            customdata=[[None if c is None else [f"{c.score:.3g}", f"{c.worst:.3g}", *c[2:]] for c in line]
                        for line in cells],
            hovertemplate=HOVER,
        ),
        row=row, col=column,
    )  # fmt: skip
    labels = {k: entry[0] for k, entry in enumerate(spread) if entry is not None}
    figure.update_xaxes(
        tickvals=list(labels), ticktext=list(labels.values()), showgrid=False, tickangle=-45, tickfont={"size": 11},
        range=[-0.5, len(spread) - 0.5], row=row, col=column,
    )  # fmt: skip
    figure.update_yaxes(
        tickvals=list(range(len(names))), ticktext=[looks[name].label for name in names], showgrid=False,
        range=[len(names) - 0.5, -0.5], row=row, col=column,
    )  # fmt: skip


def _own(name: str, column: Column | None) -> Cell | None:
    return None if column is None else cell_of([r for r in column[1] if r["case"]["controller"] == name])


def _place(score: float) -> float:
    """On the colour scale, which is logarithmic."""
    return math.log10(float(np.clip(score, LEAST_JND, MOST_JND)))


def _words(cell: Cell) -> str:
    digits = 2 if cell.score < 0.995 else 1 if cell.score < 9.95 else 0
    return f"{cell.score:.{digits}f}" + ("×" if cell.unstable else "")


def _scale() -> dict[str, Any]:
    ticks = [math.log10(tick) for tick in TICKS_JND]
    return {
        "colorscale": JND_COLOURS, "cmin": math.log10(LEAST_JND), "cmax": math.log10(MOST_JND),
        "colorbar": {
            "title": {"text": "JND", "side": "top"}, "tickvals": ticks, "ticktext": [f"{t:g}" for t in TICKS_JND],
            "thickness": 12, "len": BAR_PX, "lenmode": "pixels", "y": 1.0, "yanchor": "top", "outlinewidth": 0,
        },
    }  # fmt: skip
