"""The drawings that several reports share: data as dots, fits as lines, the reference dashed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.style import DATA, DOT_SIZE, LINE_WIDTH, TEMPLATE, colour_of

MOST_POINTS = 3000  # per curve: what a screen can show, and what keeps a report small
MOST_ABOVE = 5  # legend entries that fit in one line above a figure
_FREQUENCY_TICKS = [digit * 10.0**decade for decade in range(-3, 4) for digit in (1, 2, 5)]
_FREQUENCY_LABELS = [f"{tick:g}" for tick in _FREQUENCY_TICKS]


@dataclass(frozen=True)
class Curve:
    """One named curve; curves of the same name share their colour.

    Args:
        name: shown in the legend.
        x: [n] frequency in Hz, time in s, angle ...
        y: [n] values; complex for a frequency response.
        colour: None: the next of the palette.
        dash: "solid", "dash", "dot" (lines only).
    """

    name: str
    x: Any
    y: Any
    colour: str | None = None
    dash: str = "solid"


def bode(
    measurements: Sequence[Curve] = (),
    fits: Sequence[Curve] = (),
    coherence: Sequence[Curve] = (),
    *,
    unit: str = "",
    ordered: bool = False,
    height: int | None = None,
) -> go.Figure:
    """Magnitude in dB, phase in degrees and coherence, one above the other, over log frequency.

    Args:
        measurements: complex responses over Hz, drawn as dots.
        fits: complex responses over Hz, drawn as lines. A fit's phase is laid on the branch of the
            measurement of the same name.
        coherence: real values in [0, 1] over Hz; without any, the panel is left out.
        unit: of the response, for the axis ("rad/(N m)").
        ordered: colours by rank (speeds ascending) instead of by kind.
        height: px.
    """
    rows = 3 if coherence else 2
    figure = make_subplots(
        rows,
        1,
        shared_xaxes=True,
        vertical_spacing=0.035,
        row_heights=[0.42, 0.36, 0.22][:rows],
    )
    paint = _Paint(measurements, fits, coherence, ordered=ordered)
    phases = {curve.name: (curve.x, _phase_deg(curve.y)) for curve in measurements}
    for curve in measurements:
        _add(figure, 1, curve, _decibel(curve.y), paint.dots(curve))
        _add(figure, 2, curve, phases[curve.name][1], paint.dots(curve, legend=False))
    for curve in fits:
        phase = _same_branch(curve, phases.get(curve.name))
        _add(figure, 1, curve, _decibel(curve.y), paint.line(curve))
        _add(figure, 2, curve, phase, paint.line(curve, legend=False))
    for curve in coherence:
        _add(figure, 3, curve, curve.y, paint.line(curve, legend=False, width=1.4))
    figure.update_xaxes(type="log", tickvals=_FREQUENCY_TICKS, ticktext=_FREQUENCY_LABELS)
    figure.update_xaxes(title_text="frequency [Hz]", row=rows)
    figure.update_yaxes(title_text=f"magnitude [dB{f' re {unit}' if unit else ''}]", row=1)
    figure.update_yaxes(title_text="phase [deg]", tick0=0, dtick=_phase_tick(figure), row=2)
    if coherence:
        figure.update_yaxes(title_text="coherence", range=[0, 1.05], dtick=0.5, row=3)
    return _finish(figure, height or (620 if coherence else 500))


def hysteresis(
    measured: Sequence[Curve],
    modelled: Sequence[Curve] = (),
    *,
    x: str = "steering angle [deg]",
    y: str = "steering torque [N m]",
    ordered: bool = False,
    height: int | None = None,
) -> go.Figure:
    """Loops of torque over angle, axes through the origin: dots measured, lines modelled."""
    figure = make_subplots(1, 1)
    paint = _Paint(measured, modelled, ordered=ordered)
    for curve in measured:
        _add(figure, 1, curve, curve.y, paint.dots(curve))
    for curve in modelled:
        _add(figure, 1, curve, curve.y, paint.line(curve))
    figure.update_xaxes(title_text=x, zeroline=True, zerolinecolor="#9AA5B1", zerolinewidth=1)
    figure.update_yaxes(title_text=y, zeroline=True, zerolinecolor="#9AA5B1", zerolinewidth=1)
    return _finish(figure, height or 460)


def traces(
    panels: Mapping[str, Sequence[Curve]],
    *,
    x: str = "time [s]",
    height: int | None = None,
) -> go.Figure:
    """Curves over time, one panel per key; the key is the panel's axis title, with its unit."""
    figure = make_subplots(len(panels), 1, shared_xaxes=True, vertical_spacing=0.03)
    paint = _Paint((), *panels.values())
    named: set[str] = set()
    for row, (title, curves) in enumerate(panels.items(), start=1):
        for curve in curves:
            style = paint.line(curve, legend=curve.name not in named, width=1.6)
            _add(figure, row, curve, curve.y, style)
            named.add(curve.name)
        figure.update_yaxes(title_text=title, row=row)
    figure.update_xaxes(title_text=x, row=len(panels))
    return _finish(figure, height or 110 + 170 * len(panels))


def thin(x: Any, y: Any, most: int = MOST_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Keep about `most` points: the lowest and the highest of each stretch, so that peaks stay."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if len(x) <= most:
        return x, y
    edges = np.linspace(0, len(x), most // 2 + 1).astype(int)
    keep: set[int] = {0, len(x) - 1}
    for start, end in pairwise(edges):
        part = np.where(np.isfinite(y[start:end]), y[start:end], 0.0)
        keep.update((start + int(part.argmin()), start + int(part.argmax())))
    index = sorted(keep)
    return x[index], y[index]


class _Paint:
    """The look of each curve of one figure: a colour per name, one legend entry per name.

    A click on the entry hides the name in every panel.

    Where all curves share one name there is no name to tell apart, so the data are grey, the fit
    has the colour, and the legend tells data from fit.
    """

    def __init__(self, data: Sequence[Curve], *others: Sequence[Curve], ordered: bool = False):
        names = [curve.name for curves in (data, *others) for curve in curves]
        self._colours = colour_of(names, ordered)
        self._has_data = {curve.name for curve in data}
        self._alone = len(self._colours) == 1

    def dots(self, curve: Curve, legend: bool = True) -> dict[str, Any]:
        colour = curve.colour or (DATA if self._alone else self._colours[curve.name])
        return {
            "mode": "markers",
            "marker": {"color": colour, "size": DOT_SIZE, "opacity": 0.65},
            "name": curve.name,
            "legendgroup": curve.name,
            "showlegend": legend,
        }

    def line(self, curve: Curve, legend: bool = True, width: float = LINE_WIDTH) -> dict[str, Any]:
        over_data = curve.name in self._has_data
        name = f"{curve.name}, fit" if over_data and self._alone else curve.name
        colour = curve.colour or self._colours[curve.name]
        return {
            "mode": "lines",
            "line": {"color": colour, "width": width, "dash": curve.dash},
            "name": name,
            "legendgroup": name,
            "showlegend": legend and (self._alone or not over_data),
        }


def _add(figure: go.Figure, row: int, curve: Curve, y: Any, style: dict[str, Any]) -> None:
    """Add one curve to a panel."""
    x, y = thin(curve.x, y)
    figure.add_trace(go.Scatter(x=x, y=y, **style), row=row, col=1)


def _finish(figure: go.Figure, height: int) -> go.Figure:
    """House style; the legend goes above the panels while it fits there, else beside them."""
    shown = sum(trace.showlegend is not False for trace in figure.data)
    legend = {"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom"}
    if shown > MOST_ABOVE:
        legend = {"orientation": "v", "x": 1.01, "y": 1}
    figure.update_layout(template=TEMPLATE, height=height, legend=legend, showlegend=shown > 1)
    return figure


def _phase_tick(figure: go.Figure) -> float:
    """Every 45 degrees, or so that there are at most about eight ticks."""
    phases = [trace.y for trace in figure.data if trace.yaxis == "y2"]
    flat = np.concatenate([np.asarray(y, float) for y in phases]) if phases else np.zeros(1)
    span = np.nanmax(flat) - np.nanmin(flat) if np.isfinite(flat).any() else 0.0
    return next((tick for tick in (10.0, 45.0, 90.0) if span <= 8 * tick), 180.0)


def _decibel(response: Any) -> np.ndarray:
    """20 log10 of the magnitude; NaN, so no dot, where the response is zero."""
    magnitude = np.abs(np.asarray(response))
    return 20.0 * np.log10(np.where(magnitude > 0.0, magnitude, np.nan))


def _phase_deg(response: Any) -> np.ndarray:
    """Continuous phase in degrees, its middle within one half turn of zero."""
    phase = np.degrees(np.unwrap(np.angle(np.asarray(response))))
    middle = np.nanmedian(phase) if len(phase) else 0.0
    return phase - 360.0 * np.round(middle / 360.0)


def _same_branch(curve: Curve, measured: tuple[Any, np.ndarray] | None) -> np.ndarray:
    """The fit's phase, moved by whole turns to where the measured phase of the same name lies."""
    phase = _phase_deg(curve.y)
    if measured is None or not len(measured[1]):
        return phase
    there = np.interp(np.asarray(measured[0], float), np.asarray(curve.x, float), phase)
    return phase + 360.0 * np.round(np.nanmedian(measured[1] - there) / 360.0)
