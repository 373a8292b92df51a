"""Drawings in the layout of the paper: several responses side by side, loops side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.figures import Curve, thin
from experiments.report.style import DATA, LINE_WIDTH, PALETTE, REFERENCE, TEMPLATE

TICKS_Hz = (0.2, 0.5, 1.0, 2.0, 5.0)
PUBLISHED, OURS, TRUTH = REFERENCE, PALETTE[0], PALETTE[2]
THOUSANDS = 1e4  # from here ticks read 100k
ZERO_LINE = {"zeroline": True, "zerolinecolor": "#9AA5B1", "zerolinewidth": 1}


@dataclass(frozen=True)
class Panel:
    """One column: dots measured, lines computed, coherence; a Curve's y is complex in a Bode panel."""

    title: str
    dots: Sequence[Curve] = ()
    lines: Sequence[Curve] = ()
    coherence: Sequence[Curve] = ()


def bode_columns(panels: Sequence[Panel], unit: str = "") -> go.Figure:
    """Magnitude, phase and (where there is one) coherence, one column per panel, over log frequency."""
    rows = 3 if any(p.coherence for p in panels) else 2
    heights = [0.45, 0.33, 0.22][:rows]
    figure = make_subplots(
        rows,
        len(panels),
        shared_xaxes=True,
        subplot_titles=[p.title for p in panels],
        vertical_spacing=0.04,
        horizontal_spacing=0.075,
        row_heights=heights,
    )
    named: set[str] = set()
    for column, panel in enumerate(panels, start=1):
        branch = None
        for curve, style in [*((c, _dots(c)) for c in panel.dots), *((c, _line(c)) for c in panel.lines)]:
            H = np.asarray(curve.y)
            phase = np.degrees(np.unwrap(np.angle(H)))
            middle = np.interp(1.0, curve.x, phase)
            branch = _principal(middle) if branch is None else branch
            phase += 360.0 * np.round((branch - middle) / 360.0)
            _add(figure, (1, column), curve, 20.0 * np.log10(np.abs(H)), style, named)
            _add(figure, (2, column), curve, phase, style, named)
        for curve in panel.coherence:
            _add(figure, (3, column), curve, curve.y, {**_line(curve), "showlegend": False}, named)
    labels = [f"{tick:g}" for tick in TICKS_Hz]
    figure.update_xaxes(type="log", tickvals=TICKS_Hz, ticktext=labels, range=[np.log10(0.18), np.log10(5.6)])
    figure.update_xaxes(title_text="frequency [Hz]", row=rows)
    figure.update_yaxes(title_text=f"magnitude [dB{f' re {unit}' if unit else ''}]", row=1, col=1)
    figure.update_yaxes(title_text="phase [deg]", row=2, col=1)
    figure.update_yaxes(dtick=45.0, row=2)
    if rows == 3:
        figure.update_yaxes(title_text="coherence", row=3, col=1)
        figure.update_yaxes(range=[0.5, 1.03], dtick=0.25, row=3)
    return _finished(figure, 640 if rows == 3 else 520)


def loop_columns(panels: Sequence[Panel]) -> go.Figure:
    """Torsion-bar torque in N m over pinion angle in deg, one column per panel."""
    figure = make_subplots(1, len(panels), subplot_titles=[p.title for p in panels], horizontal_spacing=0.075)
    named: set[str] = set()
    for column, panel in enumerate(panels, start=1):
        for curve in panel.lines:
            _add(figure, (1, column), curve, curve.y, _line(curve), named)
        for curve in panel.dots:
            _add(figure, (1, column), curve, curve.y, _dots(curve, 3.0), named)
    figure.update_xaxes(title_text="pinion angle [deg]", **ZERO_LINE)
    figure.update_yaxes(**ZERO_LINE)
    figure.update_yaxes(title_text="torsion-bar torque [N m]", col=1)
    return _finished(figure, 440)


def gain_columns(panels: Sequence[Panel]) -> go.Figure:
    """K_assist over torsion-bar torque in N m, one column per panel, log scale."""
    figure = make_subplots(
        1, len(panels), subplot_titles=[p.title for p in panels], horizontal_spacing=0.05, shared_yaxes=True
    )
    named: set[str] = set()
    for column, panel in enumerate(panels, start=1):
        for curve in panel.lines:
            _add(figure, (1, column), curve, curve.y, _line(curve), named)
    figure.update_xaxes(title_text="torsion-bar torque [N m]")
    ticks = [1, 2, 5, 10, 20, 40]
    figure.update_yaxes(type="log", tickvals=ticks, ticktext=[str(t) for t in ticks], range=[-0.05, 1.65])
    figure.update_yaxes(title_text="K_assist [-]", col=1)
    return _finished(figure, 430)


def over_speed(panels: dict[str, Sequence[Curve]], errors: dict[str, dict[str, Sequence[float]]]) -> go.Figure:
    """A small panel per parameter over km/h; ``errors``: 95 % half intervals by panel and curve."""
    columns = 3
    rows = (len(panels) + columns - 1) // columns
    figure = make_subplots(
        rows, columns, subplot_titles=list(panels), horizontal_spacing=0.07, vertical_spacing=0.3 / rows
    )
    named: set[str] = set()
    for place, (title, curves) in enumerate(panels.items()):
        here = (place // columns + 1, place % columns + 1)
        if max(np.nanmax(curve.y) for curve in curves) > THOUSANDS:
            figure.update_yaxes(tickformat="~s", row=here[0], col=here[1])
        for curve in curves:
            style = _line(curve) | {"mode": "lines+markers", "marker": {"size": 6, "color": curve.colour}}
            band = errors.get(title, {}).get(curve.name)
            if band is not None:
                style["error_y"] = {"array": list(band), "thickness": 1.2, "width": 3}
            _add(figure, here, curve, curve.y, style, named)
    figure.update_yaxes(rangemode="tozero")
    for column in range(1, columns + 1):
        figure.update_xaxes(title_text="speed [km/h]", row=rows, col=column)
    return _finished(figure, 90 + 220 * rows)


def _principal(degrees: float) -> float:
    """The angle within half a turn of zero, nearest to -360 ... 0 where it lies on the seam."""
    return float((degrees + 270.0) % 360.0 - 270.0)


def _dots(curve: Curve, size: float = 5.0) -> dict[str, object]:
    return {"mode": "markers", "marker": {"color": curve.colour or DATA, "size": size, "opacity": 0.6}}


def _line(curve: Curve) -> dict[str, object]:
    return {"mode": "lines", "line": {"color": curve.colour or DATA, "width": LINE_WIDTH, "dash": curve.dash}}


def _add(
    figure: go.Figure, place: tuple[int, int], curve: Curve, y: object, style: dict[str, object], named: set[str]
) -> None:
    """Add a curve; a name appears in the legend once."""
    x, y = thin(curve.x, y)
    fresh = curve.name not in named and style.get("showlegend") is not False
    if fresh:
        named.add(curve.name)
    entry = {**style, "name": curve.name, "legendgroup": curve.name, "showlegend": fresh}
    figure.add_trace(go.Scatter(x=x, y=y, **entry), row=place[0], col=place[1])


def _finished(figure: go.Figure, height: int) -> go.Figure:
    """House style; the legend in a line of its own below the buttons."""
    legend = {"orientation": "h", "x": 0, "y": 1.0 - 30.0 / height, "yanchor": "top", "yref": "container"}
    figure.update_layout(template=TEMPLATE, height=height, legend=legend, margin={"t": 88})
    figure.update_annotations(font_size=13.5)
    return figure
