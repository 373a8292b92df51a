"""Drawings of the benchmark: responses and loops of every controller beside their reference."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.style import DOT_SIZE, GRID, LINE_WIDTH, REFERENCE, TEMPLATE, colour_of

Result = dict[str, Any]
CAUSALITIES = ("impedance", "admittance")
TICKS_HZ = (0.2, 0.5, 1, 2, 3, 4, 5)
DEG = 180.0 / np.pi


def controllers_of(results: Iterable[Result]) -> list[str]:
    """Names in order of appearance; the order gives the colours in every figure."""
    return list(dict.fromkeys(r["case"]["controller"] for r in results))


def responses(results: Sequence[Result]) -> go.Figure:
    """Angle and rate over torque: impedance on the left, admittance on the right.

    Dots are achieved. The line is the reference: Eq. 10 where it is linear, otherwise the ideal
    response in the same run, in the controller's colour, because it depends on the amplitude.
    """
    figure = make_subplots(
        3,
        2,
        shared_xaxes=True,
        shared_yaxes=True,
        vertical_spacing=0.04,
        horizontal_spacing=0.03,
        column_titles=list(CAUSALITIES),
    )
    colours = colour_of(controllers_of(results))
    for column, causality in enumerate(CAUSALITIES, start=1):
        here = [r for r in results if r["case"]["causality"] == causality and r["plot"]]
        if here and "exact_Hz" in here[0]["plot"]:
            f, H = _complex(here[0]["plot"], "exact", "exact_Hz")
            _response(figure, column, f, H, _line(REFERENCE, "dash"), "linear reference")
        for result in here:
            name = result["case"]["controller"]
            if not result["case"]["linear"]:
                f, H = _complex(result["plot"], "reference")
                _response(figure, column, f, H, _line(colours[name]), f"{name}: reference")
            f, H = _complex(result["plot"], "achieved")
            _response(figure, column, f, H, _dots(colours[name]), name)
    figure.update_xaxes(type="log", tickvals=TICKS_HZ, ticktext=[f"{t:g}" for t in TICKS_HZ])
    figure.update_xaxes(title_text="frequency [Hz]", row=3)
    figure.update_yaxes(title_text="angle/torque [dB re deg/(N m)]", row=1, col=1)
    figure.update_yaxes(title_text="phase [deg]", dtick=45, row=2, col=1)
    figure.update_yaxes(title_text="rate/torque [dB re deg/s/(N m)]", row=3, col=1)
    return _finish(figure, 760)


def deviations(results: Sequence[Result], limit_dB: float, limit_deg: float) -> go.Figure:
    """Deviation from the linear reference; the band is what is asked for."""
    figure = make_subplots(
        2,
        2,
        shared_xaxes=True,
        shared_yaxes=True,
        vertical_spacing=0.05,
        horizontal_spacing=0.03,
        column_titles=list(CAUSALITIES),
    )
    colours = colour_of(controllers_of(results))
    dashes = dict(
        zip(dict.fromkeys(r["case"]["arm"] for r in results), ("solid", "dot"), strict=False)
    )
    for column, causality in enumerate(CAUSALITIES, start=1):
        for row, limit in ((1, limit_dB), (2, limit_deg)):
            figure.add_shape(
                type="rect", x0=0.2, x1=4.0, y0=-limit, y1=limit,
                fillcolor=GRID, opacity=0.6, line_width=0, layer="below", row=row, col=column,
            )  # fmt: skip
        for result in results:
            case = result["case"]
            if case["causality"] != causality or not result["plot"]:
                continue
            f, H = _complex(result["plot"], "achieved")
            ratio = H / _complex(result["plot"], "reference")[1]
            style = _line(colours[case["controller"]], dashes[case["arm"]])
            name = f"{case['controller']}, {case['arm']} arm"
            _add(figure, 1, column, f, 20.0 * np.log10(np.abs(ratio)), style, name, column == 1)
            _add(figure, 2, column, f, np.degrees(np.angle(ratio)), style, name, False)
    figure.update_xaxes(type="log", tickvals=TICKS_HZ, ticktext=[f"{t:g}" for t in TICKS_HZ])
    figure.update_xaxes(title_text="frequency [Hz]", row=2)
    figure.update_yaxes(title_text="magnitude error [dB]", row=1, col=1)
    figure.update_yaxes(title_text="phase error [deg]", row=2, col=1)
    return _finish(figure, 520)


def loops(results: Sequence[Result]) -> go.Figure:
    """Torque over angle at 0.2 Hz: lines achieved, dashed the reference in the same run."""
    figure = make_subplots(
        1, 2, shared_yaxes=True, horizontal_spacing=0.03, column_titles=list(CAUSALITIES)
    )
    colours = colour_of(controllers_of(results))
    for result in results:
        case, plot = result["case"], result["plot"]
        if not plot:
            continue
        column = 1 + CAUSALITIES.index(case["causality"])
        name = case["controller"]
        for kind, dash in (("reference", "dash"), ("achieved", "solid")):
            style = _line(
                REFERENCE if kind == "reference" and name == "pid" else colours[name], dash
            )
            label = name if kind == "achieved" else f"{name}: reference"
            x, y = plot[f"{kind}_angle_deg"], plot[f"{kind}_torque_Nm"]
            _add(figure, 1, column, x, y, style, label, column == 1)
    reach = 1.06 * max((abs(x) for trace in figure.data for x in trace.x), default=1.0)
    figure.update_xaxes(range=[-reach, reach])
    figure.update_xaxes(title_text="pinion angle [deg]", zeroline=True, zerolinecolor="#9AA5B1")
    figure.update_yaxes(zeroline=True, zerolinecolor="#9AA5B1")
    figure.update_yaxes(title_text="torsion-bar torque [N m]", col=1)
    return _finish(figure, 440)


def errors(results: Sequence[Result]) -> go.Figure:
    """Tracking error of every case with the complete reference, one row per system."""
    figure = go.Figure()
    names = controllers_of(results)
    colours = colour_of(names)
    symbols = {"frequency_response": "circle-open", "steady_state": "diamond"}
    for name in names:
        for manoeuvre, symbol in symbols.items():
            here = [
                r
                for r in results
                if r["case"]["controller"] == name and r["case"]["manoeuvre"] == manoeuvre
                and r["scores"].get("tracking_relative") and not r["case"]["linear"]
            ]  # fmt: skip
            x = [100.0 * r["scores"]["tracking_relative"] for r in here]
            y = [f"{r['case']['plant']} {r['case']['causality']}" for r in here]
            where = [f"{r['case']['speed_kmh']:.0f} km/h, {r['case']['arm']}" for r in here]
            marker = {"color": colours[name], "size": 9, "symbol": symbol, "opacity": 0.8}
            label = f"{name}, {'chirp' if manoeuvre == 'frequency_response' else '0.2 Hz sine'}"
            figure.add_scatter(x=x, y=y, text=where, mode="markers", marker=marker, name=label)
    figure.update_xaxes(type="log", title_text="error / reference, rms [%]", dtick=1)
    figure.update_yaxes(autorange="reversed")
    beside = {"orientation": "v", "x": 1.01, "y": 1.0, "yanchor": "top"}  # many controllers, many entries
    return _finish(figure, 400).update_layout(legend=beside)


def _complex(plot: dict[str, Any], name: str, at: str = "frequency_Hz") -> tuple[Any, Any]:
    value = np.array(plot[f"{name}_real"]) + 1j * np.array(plot[f"{name}_imag"])
    return np.array(plot[at]), value


def _response(
    figure: go.Figure, column: int, f: Any, H: Any, style: dict[str, Any], name: str
) -> None:
    phase = np.degrees(np.unwrap(np.angle(H)))
    _add(figure, 1, column, f, 20.0 * np.log10(DEG * np.abs(H)), style, name, column == 1)
    _add(figure, 2, column, f, phase, style, name, False)
    rate = 2.0 * np.pi * f * DEG * np.abs(H)
    _add(figure, 3, column, f, 20.0 * np.log10(rate), style, name, False)


def _add(
    figure: go.Figure, row: int, column: int, x: Any, y: Any, style: Any, name: str, legend: bool
) -> None:
    trace = go.Scatter(x=x, y=y, name=name, legendgroup=name, showlegend=legend, **style)
    figure.add_trace(trace, row=row, col=column)


def _dots(colour: str) -> dict[str, Any]:
    return {"mode": "markers", "marker": {"color": colour, "size": DOT_SIZE + 1.5, "opacity": 0.8}}


def _line(colour: str, dash: str = "solid") -> dict[str, Any]:
    return {"mode": "lines", "line": {"color": colour, "width": LINE_WIDTH, "dash": dash}}


def _finish(figure: go.Figure, height: int) -> go.Figure:
    legend = {"orientation": "h", "x": 0, "y": -0.16 * 440 / height, "yanchor": "top"}
    figure.update_layout(template=TEMPLATE, height=height, legend=legend)
    return figure
