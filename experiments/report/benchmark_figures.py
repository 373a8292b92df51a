"""Drawings of the benchmark's signals: responses and loops of every controller beside their reference."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.style import DOT_SIZE, GRID, LINE_WIDTH, MUTED, REFERENCE, TEMPLATE, Look, looks_of

Result = dict[str, Any]
Looks = Mapping[str, Look]
CAUSALITIES = ("impedance", "admittance")
TICKS_HZ = (0.2, 0.5, 1, 2, 3, 4, 5, 7, 10, 15, 20, 30)
DEG = 180.0 / np.pi
SHOWN_BANDS = 5.0  # half heights of the band at which a deviation leaves the frame
ACROSS, TITLE_PX = 5, 30  # loops beside each other; between two rows of them
SYMBOLS_PER_LINE = 9
DASHES = ("solid", "dot", "dashdot")  # arms
ZERO = "#9AA5B1"


class Deviation(NamedTuple):
    """Achieved over reference of one case: frequencies in Hz [n], dB [n], deg [n]."""

    controller: str
    causality: str
    arm: str
    frequency_Hz: Any
    dB: Any
    deg: Any


def controllers_of(results: Iterable[Result]) -> list[str]:
    """Names in order of appearance; the order gives the colours in every figure."""
    return list(dict.fromkeys(r["case"]["controller"] for r in results))


def deviation_of(result: Result) -> Deviation | None:
    """From the plot of a chirp, an exhibit's or a scored case's; None where it has none."""
    case, plot = result["case"], result["plot"]
    if not plot:
        return None
    if "ratio_dB" in plot:
        values = plot["frequency_Hz"], plot["ratio_dB"], plot["ratio_deg"]
    else:
        f, H = _complex(plot, "achieved")
        ratio = H / _complex(plot, "reference")[1]
        values = f, 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
    return Deviation(case["controller"], case["causality"], case["arm"], *values)


def responses(results: Sequence[Result], looks: Looks | None = None) -> go.Figure:
    """Angle and rate over torque: impedance on the left, admittance on the right.

    Dots are achieved. The line is the reference: Eq. 10 where it is linear, otherwise the ideal
    response in the same run, in the controller's colour, because it depends on the amplitude.
    """
    figure = make_subplots(
        3, 2, shared_xaxes=True, shared_yaxes=True, vertical_spacing=0.04, horizontal_spacing=0.03,
        column_titles=list(CAUSALITIES),
    )  # fmt: skip
    looks = looks or looks_of(controllers_of(results))
    entries = _Legend()
    for column, causality in enumerate(CAUSALITIES, start=1):
        here = [r for r in _ordered(results, looks) if r["case"]["causality"] == causality and r["plot"]]
        if here and "exact_Hz" in here[0]["plot"]:
            f, H = _complex(here[0]["plot"], "exact", "exact_Hz")
            style = _line(REFERENCE, "dash") | entries.of("linear reference")
            _response(figure, column, f, H, style)
        for result in here:
            look = looks[result["case"]["controller"]]
            if not result["case"]["linear"]:
                f, H = _complex(result["plot"], "reference")
                style = _line(look.colour, width=1.2) | entries.of(f"{look.label}: reference", look.label, shown=False)
                _response(figure, column, f, H, style)
            f, H = _complex(result["plot"], "achieved")
            _response(figure, column, f, H, _dots(look) | entries.of(look.label))
    _frequency_axes(figure, 3)
    figure.update_yaxes(title_text="angle/torque<br>[dB re deg/(N m)]", row=1, col=1)
    figure.update_yaxes(title_text="phase [deg]", row=2, col=1)
    figure.update_yaxes(dtick=45, row=2)
    figure.update_yaxes(title_text="rate/torque<br>[dB re deg/s/(N m)]", row=3, col=1)
    return _finish(figure, 760)


def deviations(
    curves: Sequence[Deviation], band_dB: float, band_deg: float, within_Hz: tuple[float, float],
    looks: Looks | None = None,
) -> go.Figure:  # fmt: skip
    """Deviation from the reference over frequency, with the band of ``band_dB`` and ``band_deg`` within_Hz.

    The frame ends at some half heights of the band, so that one bad controller does not flatten the rest.
    """
    figure = make_subplots(
        2, 2, shared_xaxes=True, shared_yaxes=True, vertical_spacing=0.05, horizontal_spacing=0.03,
        column_titles=list(CAUSALITIES),
    )  # fmt: skip
    looks = looks or looks_of([curve.controller for curve in curves])
    arms = list(dict.fromkeys(curve.arm for curve in curves))
    entries = _Legend()
    for column in (1, 2):
        for row, limit in ((1, band_dB), (2, band_deg)):
            figure.add_shape(
                type="rect", x0=within_Hz[0], x1=within_Hz[1], y0=-limit, y1=limit, fillcolor=GRID, opacity=0.7,
                line_width=0, layer="below", row=row, col=column,
            )  # fmt: skip
    for curve in sorted(curves, key=lambda curve: list(looks).index(curve.controller)):
        look, column = looks[curve.controller], 1 + CAUSALITIES.index(curve.causality)
        style = _line(look.colour, DASHES[arms.index(curve.arm) % len(DASHES)], 1.6)
        style |= {"mode": "lines+markers", "marker": {"color": look.colour, "symbol": look.symbol, "size": 6,
                                                      "maxdisplayed": SYMBOLS_PER_LINE}}  # fmt: skip
        for row, y in ((1, curve.dB), (2, curve.deg)):
            trace = go.Scatter(x=curve.frequency_Hz, y=y, **style, **entries.of(look.label))
            figure.add_trace(trace, row=row, col=column)
    for arm, dash in zip(arms if len(arms) > 1 else (), DASHES, strict=False):
        style = _line(MUTED, dash, 1.6) | entries.of(f"{arm.replace('_', ' ')} arm")
        figure.add_trace(go.Scatter(x=[None], y=[None], **style), row=1, col=1)
    for row, band, values in ((1, band_dB, [c.dB for c in curves]), (2, band_deg, [c.deg for c in curves])):
        reach = 1.06 * max((float(np.max(np.abs(v))) for v in values if len(v)), default=band)
        reach = min(max(reach, 1.3 * band), SHOWN_BANDS * band)
        figure.update_yaxes(range=[-reach, reach], zeroline=True, zerolinecolor=ZERO, row=row)
    _frequency_axes(figure, 2)
    figure.update_yaxes(title_text="magnitude error [dB]", row=1, col=1)
    figure.update_yaxes(title_text="phase error [deg]", row=2, col=1)
    return _finish(figure, 560)


def loops(results: Sequence[Result], looks: Looks | None = None) -> go.Figure:
    """Torque over angle at 0.2 Hz, one small panel per controller; dashed the reference in the same run."""
    looks = looks or looks_of(controllers_of(results))
    names = [name for name in looks if name in controllers_of(results)]
    across = min(len(names), ACROSS) or 1
    lines = -(-len(names) // across) or 1  # per causality
    titles = ["" for _ in range(2 * lines * across)]
    for k, name in enumerate(names):
        for half in (0, 1):
            titles[half * lines * across + k] = looks[name].label
    panel_px = 300 if across < 4 else 150
    height = 150 + 2 * lines * panel_px + (2 * lines - 1) * TITLE_PX
    figure = make_subplots(
        2 * lines, across, shared_xaxes="all", shared_yaxes="all", horizontal_spacing=0.012 if across > 3 else 0.03,
        vertical_spacing=TITLE_PX / (height - 150), subplot_titles=titles,
    )  # fmt: skip
    entries = _Legend()
    for result in results:
        case, plot = result["case"], result["plot"]
        look, k = looks[case["controller"]], names.index(case["controller"])
        row, column = 1 + CAUSALITIES.index(case["causality"]) * lines + k // across, 1 + k % across
        if not plot:
            figure.add_annotation(text="unstable", showarrow=False, x=0, y=0, row=row, col=column)
            continue
        for kind, style in (
            ("achieved", _line(look.colour) | entries.of(look.label, shown=False)),
            ("reference", _line(REFERENCE, "dash", 1.3) | entries.of("reference in the same run")),
        ):
            x, y = _single(plot[f"{kind}_angle_deg"]), _single(plot[f"{kind}_torque_Nm"])
            figure.add_trace(go.Scatter(x=x, y=y, **style), row=row, col=column)
    for axes, of, standoff in ((figure.update_xaxes, "x", 4), (figure.update_yaxes, "y", 8)):
        reach = 1.06 * max((float(np.abs(trace[of]).max()) for trace in figure.data), default=1.0)
        axes(range=[-reach, reach], zeroline=True, zerolinecolor=ZERO, title_standoff=standoff)
    figure.update_xaxes(title_text="pinion angle [deg]", row=2 * lines)
    for row in range(1, 2 * lines + 1):
        figure.update_yaxes(title_text=f"{CAUSALITIES[(row - 1) // lines]}<br>torque [N m]", row=row, col=1)
    figure.update_annotations(font={"size": 12.5})
    return _finish(figure, height)


class _Legend:
    """Names traces so that each has one entry, and a click on it hides all of that name."""

    def __init__(self) -> None:
        self._named: set[str] = set()

    def of(self, name: str, group: str = "", shown: bool = True) -> dict[str, Any]:
        shown = shown and name not in self._named
        if shown:
            self._named.add(name)
        return {"name": name, "legendgroup": group or name, "showlegend": shown}


def _ordered(results: Sequence[Result], looks: Looks) -> list[Result]:
    """In the order of the looks, which the legend follows."""
    return sorted(results, key=lambda r: list(looks).index(r["case"]["controller"]))


def _complex(plot: Mapping[str, Any], name: str, at: str = "frequency_Hz") -> tuple[Any, Any]:
    value = np.array(plot[f"{name}_real"]) + 1j * np.array(plot[f"{name}_imag"])
    return np.array(plot[at]), value


def _response(figure: go.Figure, column: int, f: Any, H: Any, style: dict[str, Any]) -> None:
    phase = np.degrees(np.unwrap(np.angle(H)))
    rate = 20.0 * np.log10(2.0 * np.pi * f * DEG * np.abs(H))
    for row, y in ((1, 20.0 * np.log10(DEG * np.abs(H))), (2, phase), (3, rate)):
        own = style if row == 1 else style | {"showlegend": False}
        figure.add_trace(go.Scatter(x=_single(f), y=_single(y), **own), row=row, col=column)


def _single(values: Any) -> Any:
    """In single precision, which halves a page's bytes."""
    return np.asarray(values, np.float32)


def _frequency_axes(figure: go.Figure, last: int) -> None:
    figure.update_xaxes(type="log", tickvals=TICKS_HZ, ticktext=[f"{t:g}" for t in TICKS_HZ])
    figure.update_xaxes(title_text="frequency [Hz]", row=last)


def _dots(look: Look) -> dict[str, Any]:
    marker = {"color": look.colour, "symbol": look.symbol, "size": DOT_SIZE + 1.0, "opacity": 0.75}
    return {"mode": "markers", "marker": marker}


def _line(colour: str, dash: str = "solid", width: float = LINE_WIDTH) -> dict[str, Any]:
    return {"mode": "lines", "line": {"color": colour, "width": width, "dash": dash}}


def _finish(figure: go.Figure, height: int) -> go.Figure:
    """Legend below the panels, where it may take as many lines as it needs."""
    legend = {"orientation": "h", "x": 0, "y": -58.0 / (height - 100), "yanchor": "top"}
    return figure.update_layout(template=TEMPLATE, height=height, legend=legend)
