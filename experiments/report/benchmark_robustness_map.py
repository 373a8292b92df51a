"""Heat map of the linear proof: controllers over speeds, one panel per system."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.benchmark_safety import place_words
from experiments.report.style import TEMPLATE, Look

Record = Mapping[str, Any]
Values = Sequence[Sequence[float | None]]
GOOD_DISK = 0.5
MOST_DISK = 1.0  # colours end here
REFERENCE = "reference itself"
UNSTABLE, OWN = "#7F1D1D", "#C3CAD3"
COLOURS = ((0.0, "#B35806"), (0.25, "#F1A340"), (0.5, "#F7F7F7"), (0.75, "#92C5DE"), (1.0, "#2166AC"))
ROW_PX, FRAME_PX, BAR_PX = 24, 86, 240


def robustness_map(assessments: Sequence[Record], looks: Mapping[str, Look]) -> go.Figure:
    """Colour: worst disk margin where the reference is stable; dark red: unstable there; grey: the reference is."""
    systems = list(dict.fromkeys((a["plant"], a["causality"]) for a in assessments))
    plants, causalities = (list(dict.fromkeys(pair[k] for pair in systems)) for k in (0, 1))
    names = [name for name in looks if any(a["controller"] == name for a in assessments)]
    height = max(FRAME_PX + len(plants) * (ROW_PX * (len(names) + 1) + 46), FRAME_PX + BAR_PX + 30)
    figure = make_subplots(
        len(plants), len(causalities), shared_yaxes=True, horizontal_spacing=0.02,
        vertical_spacing=min(46 / height, 0.5) if len(plants) > 1 else 0.0, column_titles=causalities,
        row_titles=plants,
    )  # fmt: skip
    for plant, causality in systems:
        here = [a for a in assessments if (a["plant"], a["causality"]) == (plant, causality)]
        _panel(figure, plants.index(plant) + 1, causalities.index(causality) + 1, here, names, looks)
    figure.update_xaxes(title_text="speed [km/h]", row=len(plants))
    figure.update_layout(
        template=TEMPLATE, height=height, margin={"t": 62, "b": 50, "r": 30},
        coloraxis={
            "colorscale": COLOURS, "cmin": 0.0, "cmax": MOST_DISK,
            "colorbar": {"title": {"text": "disk<br>margin", "side": "top"}, "thickness": 12, "len": BAR_PX,
                         "lenmode": "pixels", "y": 1.0, "yanchor": "top", "outlinewidth": 0,
                         "tickvals": [0, 0.25, 0.5, 0.75, 1], "ticktext": ["0", "0.25", "0.5", "0.75", "≥ 1"]},
        },
    )  # fmt: skip
    return figure


def _panel(
    figure: go.Figure, row: int, column: int, here: Sequence[Record], names: Sequence[str], looks: Mapping[str, Look]
) -> None:
    speeds = sorted({a["speed_kmh"] for a in here})
    cells = [
        [[a for a in here if a["controller"] == name and a["speed_kmh"] == speed] for speed in speeds] for name in names
    ]
    own = [[a for a in here if a["speed_kmh"] == speed and not a["reference_stable"]] for speed in speeds]
    blank: list[float | None] = [None] * len(speeds)
    margins: Values = [*([_margin(cell) for cell in line] for line in cells), blank]
    unstable: Values = [*([1.0 if _to_blame(cell) else None for cell in line] for line in cells), blank]
    weak: Values = [*(blank for _ in cells), [1.0 if found else None for found in own]]
    labels = [looks[name].label for name in names]
    text = [*([_words(cell) for cell in line] for line in cells), [_growth(found) for found in own]]
    hover = [
        *([_hover(label, cell) for cell in line] for label, line in zip(labels, cells, strict=True)),
        [_own_hover(found) for found in own],
    ]
    for z, colour in ((margins, None), (unstable, UNSTABLE), (weak, OWN)):
        if any(value is not None for line in z for value in line):
            scale: dict[str, Any] = {"coloraxis": "coloraxis"}
            if colour is not None:
                scale = {"colorscale": [[0.0, colour], [1.0, colour]], "zmin": 0.0, "zmax": 1.0, "showscale": False}
            figure.add_trace(
                go.Heatmap(
                    z=z, text=_masked(text, z), texttemplate="%{text}", textfont={"size": 11},
                    customdata=_masked(hover, z), hoverongaps=False,
                    hovertemplate="%{customdata}<extra></extra>", xgap=1, ygap=1, **scale,
                ),
                row=row, col=column,
            )  # fmt: skip
    figure.update_xaxes(
        tickvals=list(range(len(speeds))), ticktext=[f"{speed:g}" for speed in speeds], showgrid=False,
        range=[-0.5, len(speeds) - 0.5], row=row, col=column,
    )  # fmt: skip
    figure.update_yaxes(
        tickvals=list(range(len(names) + 1)), ticktext=[*labels, REFERENCE], showgrid=False,
        range=[len(names) + 0.5, -0.5], row=row, col=column,
    )  # fmt: skip


def _masked(words: Sequence[Sequence[str]], z: Values) -> list[list[str]]:
    """Words where a trace has a value: plotly would write them over another trace's cells too."""
    return [["" if v is None else w for w, v in zip(*lines, strict=True)] for lines in zip(words, z, strict=True)]


def _judged(cell: Iterable[Record]) -> list[Record]:
    return [a for a in cell if a["reference_stable"]]


def _to_blame(cell: Iterable[Record]) -> list[Record]:
    return [a for a in _judged(cell) if not a["stable"]]


def _margin(cell: Sequence[Record]) -> float | None:
    judged = _judged(cell)
    return None if not judged or _to_blame(cell) else min(a["disk_margin"] for a in judged)


def _words(cell: Sequence[Record]) -> str:
    if not cell:
        return ""
    star = "*" * any(not a["reference_stable"] and not a["stable"] for a in cell)
    bad, margin = _to_blame(cell), _margin(cell)
    if bad:
        return f"+{max(a['growth'] for a in bad):.1f}{star}"
    return star if margin is None else f"{margin:.2f}{star}"


def _growth(own: Sequence[Record]) -> str:
    return f"+{max(a['reference_growth'] for a in own):.2f}" if own else ""


def _hover(label: str, cell: Sequence[Record]) -> str:
    judged = _judged(cell)
    if not judged:
        return f"<b>{label}</b><br>the reference itself is unstable here" if cell else ""
    bad = _to_blame(cell)
    worst = max(bad, key=lambda a: a["growth"]) if bad else min(judged, key=lambda a: a["disk_margin"])
    lines = [
        f"<b>{label}</b>, {place_words(worst)}",
        f"growth {worst['growth']:.2f} 1/s at {worst['frequency_Hz']:.1f} Hz",
    ]
    if bad:
        lines.append(f"unstable at {len(bad)} of {len(judged)} places")
    else:
        lines.append(
            f"gain {worst['gain_margin_dB']:.1f} dB, phase {worst['phase_margin_deg']:.0f} deg, "
            f"disk {worst['disk_margin']:.2f}, delay {worst['delay_margin_ms']:.1f} ms"
        )
    return "<br>".join(lines)


def _own_hover(own: Sequence[Record]) -> str:
    if not own:
        return ""
    worst = max(own, key=lambda a: a["reference_growth"])
    return f"the reference itself is unstable<br>{place_words(worst)}<br>growth {worst['reference_growth']:.2f} 1/s"
