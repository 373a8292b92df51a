"""Drawings of the identification report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.figures import Curve, bode
from experiments.report.style import DATA, DOT_SIZE, LINE_WIDTH, PALETTE, TEMPLATE, ordered_colours
from identification.result import SpeedResult
from steer_env.physics.assist import softening
from steer_env.units import to_deg

STEPS, REFINED = PALETTE[1], PALETTE[0]
MOST_LOOPS = 4


def response(speeds: Sequence[SpeedResult], name: str, unit: str) -> go.Figure | None:
    """Bode plot of one response at all speeds with its fit and coherence, or None where none was measured."""
    measured = [r for r in speeds if name in r.responses]
    if not measured:
        return None
    dots, fits, coherence = [], [], []
    for r in measured:
        label, H = f"{r.speed_kmh:g} km/h", r.responses[name]
        dots.append(Curve(label, H.frequency, H.value))
        if name in r.fitted:
            fits.append(Curve(label, *r.fitted[name]))
        coherence.append(Curve(label, H.all_frequency, H.all_coherence))
    return bode(dots, fits, coherence, unit=unit, ordered=True)


def assist_curves(speeds: Sequence[SpeedResult]) -> go.Figure | None:
    """K_assist over torsion-bar torque to the largest torque that was driven at each speed."""
    known = [r for r in speeds if all(n in r.values for n in ("c_pin_off", "sigma_assist"))]
    if not known:
        return None
    figure = go.Figure()
    for r, colour in zip(known, ordered_colours(len(known)), strict=True):
        reach = max((float(np.abs(loop.measured).max()) for loop in r.loops), default=6.0)
        M = np.linspace(-reach, reach, 161)
        ratio = r.values["c_pin_off"] / r.values["c_pin_on"]
        gain = [1.0 / softening(float(m), ratio, r.values["sigma_assist"]) for m in M]
        line = {"color": colour, "width": LINE_WIDTH}
        figure.add_trace(go.Scatter(x=M, y=gain, mode="lines", name=f"{r.speed_kmh:g} km/h", line=line))
    figure.update_xaxes(title_text="torsion-bar torque [N m]")
    figure.update_yaxes(title_text="K_assist [-]", rangemode="tozero")
    figure.update_layout(template=TEMPLATE, height=420, legend={"orientation": "v", "x": 1.01, "y": 1})
    return figure


def loops(speeds: Sequence[SpeedResult]) -> go.Figure | None:
    """Measured, stepwise and refined hysteresis side by side, at up to four speeds from the slowest to the fastest."""
    known = [r for r in speeds if r.loops]
    if not known:
        return None
    chosen = sorted({round(k) for k in np.linspace(0, len(known) - 1, min(MOST_LOOPS, len(known)))})
    titles = [f"{known[k].speed_kmh:g} km/h" for k in chosen]
    rows = (len(chosen) + 1) // 2
    figure = make_subplots(
        rows, min(2, len(chosen)), subplot_titles=titles, horizontal_spacing=0.09, vertical_spacing=0.16
    )
    for place, k in enumerate(chosen):
        loop, row, column = known[k].loops[0], place // 2 + 1, place % 2 + 1
        angle = np.array([to_deg(float(a)) for a in loop.angle])
        marker = {"color": DATA, "size": DOT_SIZE, "opacity": 0.5}
        drawn: list[tuple[str, Any, dict[str, Any]]] = [
            ("measured", loop.measured, {"mode": "markers", "marker": marker})
        ]
        if loop.stepwise is not None:
            drawn.append(("steps I to III", loop.stepwise, _line(STEPS, "dot")))
        if loop.refined is not None:
            drawn.append(("refined", loop.refined, _line(REFINED)))
        for name, torque, style in drawn:
            trace = go.Scatter(x=angle, y=torque, name=name, legendgroup=name, showlegend=place == 0, **style)
            figure.add_trace(trace, row=row, col=column)
    figure.update_xaxes(zeroline=True, zerolinecolor="#9AA5B1")
    figure.update_yaxes(zeroline=True, zerolinecolor="#9AA5B1")
    for column in range(1, min(2, len(chosen)) + 1):
        figure.update_xaxes(title_text="pinion angle [deg]", row=rows, col=column)
    for row in range(1, rows + 1):
        figure.update_yaxes(title_text="torsion-bar torque [N m]", row=row, col=1)
    legend = {"orientation": "h", "x": 0, "y": 1.06, "yanchor": "bottom"}
    figure.update_layout(template=TEMPLATE, height=90 + 330 * rows, legend=legend, margin={"t": 80})
    return figure


def over_speed(
    own: Sequence[SpeedResult], shared: Sequence[SpeedResult], names: Sequence[str], label: Callable[[str], str]
) -> go.Figure:
    """Small panels of parameters over speed: dots per speed with 95 % intervals, line and band shared."""
    columns = 3
    rows = (len(names) + columns - 1) // columns
    figure = make_subplots(rows, columns, horizontal_spacing=0.1, vertical_spacing=0.16)
    for place, name in enumerate(names):
        row, column = place // columns + 1, place % columns + 1
        title = label(name)
        scale = 1e-3 if "[N/rad]" in title else 1.0
        for results, colour, text, dash in ((shared, STEPS, "shared", "solid"), (own, REFINED, "per speed", "dot")):
            known = [r for r in results if name in r.values and (name in r.std or text == "shared")]
            band = [1.96 * r.std.get(name, 0.0) for r in known]
            trace = go.Scatter(
                x=[r.speed_kmh for r in known],
                y=[r.values[name] * scale for r in known],
                error_y={"array": [b * scale for b in band], "thickness": 1.3, "width": 3},
                mode="lines+markers",
                marker={"color": colour, "size": 6},
                line={"color": colour, "width": 1.4, "dash": dash},
                name=text,
                legendgroup=text,
                showlegend=place == 0,
            )
            figure.add_trace(trace, row=row, col=column)
        figure.update_yaxes(title_text=title.replace("[N/rad]", "[kN/rad]"), row=row, col=column)
    for column in range(1, columns + 1):
        figure.update_xaxes(title_text="speed [km/h]", row=rows, col=column)
    legend = {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"}
    figure.update_layout(template=TEMPLATE, height=110 + 230 * rows, legend=legend)
    return figure


def _line(colour: str, dash: str = "solid") -> dict[str, Any]:
    return {"mode": "lines", "line": {"color": colour, "width": 1.4, "dash": dash}}
