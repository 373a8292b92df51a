"""Scores of cases, grouped: where a controller gains and where it loses, as heat maps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from scipy.stats import trim_mean

from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.report.style import TEMPLATE, Look

Result = dict[str, Any]
Column = tuple[str, Sequence[Result]]  # label on the axis, the cases behind it
LEAST_JND, MOST_JND = 0.1, 10.0
TICKS_JND = (0.1, 0.2, 0.5, 1, 2, 5, 10)
# One JND is white: what lies on the blue side is less than a driver begins to notice.
JND_COLOURS = ((0.0, "#2166AC"), (0.25, "#92C5DE"), (0.5, "#F7F7F7"), (0.75, "#F4A582"), (1.0, "#B2182B"))
ROW_PX, FRAME_PX, BAR_PX = 21, 62, 44


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
    scores = [case_score(result, Protocol.load()) for result in results]
    unstable = sum(not result["stable"] for result in results)
    return Cell(float(trim_mean(scores, 0.25)), max(scores), len(scores), unstable)


def values_of(results: Iterable[Result], key: Callable[[Result], Any]) -> list[Any]:
    """Distinct values of a key in order of appearance."""
    return list(dict.fromkeys(map(key, results)))


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
        columns_of(results, lambda case: f"{case['plant']}<br>{case['causality']}"),
        columns_of(results, lambda case: case["manoeuvre"].replace("_", "<br>", 1).replace("_", " ")),
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
    rows, across = values_of(panels, lambda key: key[0]), values_of(panels, lambda key: key[1])
    panel_px = ROW_PX * len(names) + BAR_PX
    height = FRAME_PX + len(rows) * panel_px + 60
    figure = make_subplots(
        len(rows), len(across), shared_yaxes=True, horizontal_spacing=0.02,
        vertical_spacing=min(BAR_PX / height, 0.9 / max(len(rows) - 1, 1)),
        column_titles=across if any(across) else None, row_titles=rows if any(rows) else None,
    )  # fmt: skip
    for (row, column), groups in panels.items():
        _score_map(figure, rows.index(row) + 1, across.index(column) + 1, groups, names, looks)
    figure.update_layout(template=TEMPLATE, height=height, margin={"t": 46, "b": 60, "r": 30}, coloraxis=_scale())
    return figure


def _score_map(
    figure: go.Figure, row: int, column: int, groups: Sequence[Sequence[Column]], names: Sequence[str],
    looks: Mapping[str, Look],
) -> None:  # fmt: skip
    spread: list[Column | None] = []
    for group in groups:
        spread += [*([None] if spread else []), *group]
    cells = [[_own(name, entry) for entry in spread] for name in names]
    hover = [
        [_hover(looks[name].label, entry, cell) for entry, cell in zip(spread, line, strict=True)]
        for name, line in zip(names, cells, strict=True)
    ]
    figure.add_trace(
        go.Heatmap(
            z=[[None if cell is None else _place(cell.score) for cell in line] for line in cells],
            text=[["" if cell is None else _words(cell) for cell in line] for line in cells],
            texttemplate="%{text}", textfont={"size": 11}, customdata=hover, hoverongaps=False,
            hovertemplate="%{customdata}<extra></extra>", coloraxis="coloraxis", xgap=1, ygap=1,
        ),
        row=row, col=column,
    )  # fmt: skip
    labels = {k: entry[0] for k, entry in enumerate(spread) if entry is not None}
    figure.update_xaxes(
        tickvals=list(labels), ticktext=list(labels.values()), showgrid=False, tickangle=0, tickfont={"size": 11},
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
    return f"{cell.score:.2g}" + (" ×" if cell.unstable else "")


def _hover(label: str, column: Column | None, cell: Cell | None) -> str:
    if column is None or cell is None:
        return ""
    where = column[0].replace("<br>", " ")
    return (
        f"<b>{label}</b>, {where}<br>{cell.score:.3g} JND (interquartile mean of {cell.cases} cases)<br>"
        f"worst case {cell.worst:.3g} JND, {cell.unstable} unstable"
    )


def _scale() -> dict[str, Any]:
    ticks = [math.log10(tick) for tick in TICKS_JND]
    return {
        "colorscale": JND_COLOURS, "cmin": math.log10(LEAST_JND), "cmax": math.log10(MOST_JND),
        "colorbar": {
            "title": {"text": "JND", "side": "top"}, "tickvals": ticks, "ticktext": [f"{t:g}" for t in TICKS_JND],
            "thickness": 12, "len": 280, "lenmode": "pixels", "y": 1.0, "yanchor": "top", "outlinewidth": 0,
        },
    }  # fmt: skip
