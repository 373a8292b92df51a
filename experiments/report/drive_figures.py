"""The drawings of a drive: loops by speed, stiffness over speed, traces."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.report.figures import Curve, thin, traces
from experiments.report.style import DATA, LINE_WIDTH, PALETTE, TEMPLATE
from identification.channels import FloatArray
from identification.drive import DriveModel
from steer_env.units import to_deg, to_kmh

Parts = dict[str, FloatArray]
LONGEST_TRACE = 200.0  # s shown of a run; the fit uses all of it


def loops(parts: Sequence[Parts], speeds: FloatArray) -> go.Figure:
    """Torque minus bias over angle in a panel per speed knot: measured grey, fitted in colour."""
    edges = np.concatenate([[0.0], (speeds[1:] + speeds[:-1]) / 2.0, [np.inf]])
    titles = [_band(low, high) for low, high in pairwise(edges)]
    figure = make_subplots(
        1, len(speeds), subplot_titles=titles, shared_yaxes=True, horizontal_spacing=0.02
    )
    for column, (low, high) in enumerate(pairwise(edges), start=1):
        for name, colour in (("measured", DATA), ("model", PALETTE[1])):
            x, y = _in_band(parts, name, low, high)
            figure.add_trace(
                go.Scatter(
                    x=x,
                    y=y,
                    mode="lines",
                    name=name,
                    line={"color": colour, "width": 1.0},
                    legendgroup=name,
                    showlegend=column == 1,
                ),
                row=1,
                col=column,
            )
    figure.update_xaxes(title_text="angle [deg]")
    figure.update_yaxes(title_text="torque without bias [N m]", col=1)
    legend = {"orientation": "h", "x": 0, "y": 1.08, "yanchor": "bottom"}
    figure.update_layout(template=TEMPLATE, height=430, legend=legend, margin_t=70)
    return figure


def stiffness_over_speed(model: DriveModel) -> go.Figure:
    """c(v) over speed in km/h with 95 % intervals."""
    low, high = model.interval_["stiffness_Nm_per_rad"]
    value = model.params_["stiffness_Nm_per_rad"]
    figure = go.Figure(
        go.Scatter(
            x=[to_kmh(float(speed)) for speed in model.speeds_],
            y=value,
            error_y={"array": high - value, "arrayminus": value - low, "thickness": 1.5},
            mode="lines+markers",
            line={"width": LINE_WIDTH, "color": PALETTE[0]},
        )
    )
    figure.update_xaxes(title_text="speed [km/h]", rangemode="tozero")
    figure.update_yaxes(title_text="stiffness c(v) [N m/rad]", rangemode="tozero")
    figure.update_layout(template=TEMPLATE, height=340, showlegend=False)
    return figure


def drive_traces(part: Parts) -> go.Figure:
    """Torque with model and bias, residual, angle and speed over time."""
    shown = part["time"] <= LONGEST_TRACE
    t = part["time"][shown]
    torque = [Curve(n, t, part[n][shown]) for n in ("measured", "model", "bias")]
    residual = np.where(part["sliding"], part["measured"] - part["model"], np.nan)[shown]
    panels = {
        "torque [N m]": torque,
        "residual, sliding [N m]": [Curve("residual", t, residual)],
        "angle [deg]": [Curve("angle", t, np.degrees(part["angle"][shown]))],
        "speed [km/h]": [Curve("speed", t, part["speed"][shown] * 3.6)],
    }
    return traces(panels, height=720)


def _in_band(
    parts: Sequence[Parts], name: str, low: float, high: float
) -> tuple[FloatArray, FloatArray]:
    """Angle in degrees and torque without bias within a speed band, with breaks between visits."""
    angles, torques = [], []
    for part in parts:
        inside = (part["speed"] >= low) & (part["speed"] < high)
        angles.append(np.where(inside, to_deg(1.0) * part["angle"], np.nan))
        torques.append(np.where(inside, part[name] - part["bias"], np.nan))
    return thin(np.concatenate(angles), np.concatenate(torques), most=6000)


def _band(low: float, high: float) -> str:
    if not np.isfinite(high):
        return f"above {to_kmh(low):.0f} km/h"
    return f"{to_kmh(low):.0f} to {to_kmh(high):.0f} km/h"
