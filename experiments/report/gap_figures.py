"""Figures of the gap report."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from scipy.signal import csd, welch

from experiments.report.figures import MOST_POINTS
from experiments.report.style import DATA, LINE_WIDTH, PALETTE, TEMPLATE
from identification.gap.result import GapResult
from identification.gap.symptoms import Trace

BEFORE, AFTER, NOISE = PALETTE[1], PALETTE[0], PALETTE[6]
LONGEST_S = 20.0
BINS = 24


def channels_by_gain(result: GapResult) -> list[str]:
    """Channels, those first in which the error fell most, or is largest where nothing was found."""
    def size(name: str) -> float:
        gap = result.channels[name]
        return gap.before - gap.after if result.effects else gap.before

    return sorted(result.channels, key=size, reverse=True)


def channel_gaps(result: GapResult) -> go.Figure:
    """Bars per channel: before, after, noise."""
    names = list(result.channels)
    figure = go.Figure(layout={"template": TEMPLATE, "barmode": "group", "height": 380})
    for label, key, colour in (("before", "before", BEFORE), ("after", "after", AFTER), ("noise", "noise", NOISE)):
        values = [getattr(result.channels[name], key) for name in names]
        figure.add_bar(name=label, x=names, y=[v if np.isfinite(v) else None for v in values], marker_color=colour)
    figure.update_yaxes(type="log", title="error over signal")
    return figure


def _shown(result: GapResult, channel: str) -> list[tuple[Trace, Trace]]:
    """Held-out records in which a channel improved most, at most three of different manoeuvres or speeds."""
    pairs = [(b, a) for b, a in zip(result.before, result.after, strict=True) if channel in b.measured]

    def error(trace: Trace) -> float:
        return float(np.mean((trace.measured[channel] - trace.simulated[channel])[trace.keep] ** 2))

    return sorted(pairs, key=lambda pair: error(pair[0]) - error(pair[1]), reverse=True)[:3]


def time_traces(result: GapResult, channel: str) -> go.Figure:
    """Measured, before and after over time, residuals below, for up to three held-out records."""
    pairs = _shown(result, channel)
    figure = make_subplots(
        rows=2, cols=len(pairs), shared_xaxes=True, vertical_spacing=0.06, row_heights=[0.62, 0.38],
        subplot_titles=[_title(b) for b, _ in pairs],
    )  # fmt: skip
    for column, (before, after) in enumerate(pairs, start=1):
        here = slice(before.keep.start, min(before.keep.stop, before.keep.start + round(LONGEST_S / before.dt)))
        step = max(1, (here.stop - here.start) // MOST_POINTS)
        t = before.dt * np.arange(here.start, here.stop)[::step]
        measured = before.measured[channel][here][::step]
        first = column == 1
        curves = [("before", before, BEFORE), ("after", after, AFTER)]
        _line(figure, "measured", t, measured, DATA, 1, column, first, 3.0 * LINE_WIDTH)
        for label, trace, colour in curves:
            simulated = trace.simulated[channel][here][::step]
            _line(figure, label, t, simulated, colour, 1, column, first)
            _line(figure, label, t, measured - simulated, colour, 2, column, False)
        figure.update_xaxes(title="time (s)", row=2, col=column)
    figure.update_yaxes(title=channel, row=1, col=1)
    figure.update_yaxes(title="residual", row=2, col=1)
    figure.update_layout(template=TEMPLATE, height=520)
    return figure


def loops(result: GapResult, channel: str) -> go.Figure:
    """The channel over the first state (an angle) for slow held-out records."""
    slow = [
        (b, a) for b, a in zip(result.before, result.after, strict=True)
        if channel in b.measured and b.manoeuvre != "frequency_response"
    ] or _shown(result, channel)  # fmt: skip
    slow = slow[:4]
    figure = make_subplots(rows=1, cols=len(slow), subplot_titles=[_title(b) for b, _ in slow])
    for column, (before, after) in enumerate(slow, start=1):
        state, x = next(iter(before.states.items()))
        step = max(1, (before.keep.stop - before.keep.start) // MOST_POINTS)
        angle = x[before.keep][::step]
        measured = before.measured[channel][before.keep][::step]
        _line(figure, "measured", angle, measured, DATA, 1, column, column == 1, 3.0 * LINE_WIDTH)
        for label, trace, colour in (("before", before, BEFORE), ("after", after, AFTER)):
            _line(figure, label, angle, trace.simulated[channel][before.keep][::step], colour, 1, column, column == 1)
        figure.update_xaxes(title=f"{state} (rad)" if "angle" in state else state, row=1, col=column)
    figure.update_yaxes(title=channel, row=1, col=1)
    figure.update_layout(template=TEMPLATE, height=400)
    return figure


def spectra(result: GapResult, channels: list[str]) -> go.Figure:
    """Amplitude density of residuals before and after, and of the measured signal."""
    figure = make_subplots(rows=1, cols=len(channels), subplot_titles=channels)
    for column, channel in enumerate(channels, start=1):
        for label, traces, colour in (("before", result.before, BEFORE), ("after", result.after, AFTER)):
            f, density = _density(traces, channel, residual=True)
            _line(figure, label, f, density, colour, 1, column, column == 1)
        f, density = _density(result.before, channel, residual=False)
        _line(figure, "measured", f, density, DATA, 1, column, column == 1)
        figure.update_xaxes(type="log", title="frequency (Hz)", row=1, col=column)
        figure.update_yaxes(type="log", row=1, col=column)
    figure.update_yaxes(title="amplitude density (unit/√Hz)", row=1, col=1)
    figure.update_layout(template=TEMPLATE, height=400)
    return figure


def _density(traces: tuple[Trace, ...], channel: str, residual: bool) -> tuple[np.ndarray, np.ndarray]:
    found = []
    for trace in traces:
        if channel in trace.measured:
            signal = trace.measured[channel] - (trace.simulated[channel] if residual else 0.0)
            size = min(round(8.0 / trace.dt), trace.keep.stop - trace.keep.start)
            f, power = welch(signal[trace.keep], 1.0 / trace.dt, nperseg=size)
            found.append((f[1:], power[1:]))
    shortest = min(f.size for f, _ in found)
    return found[0][0][:shortest], np.sqrt(np.mean([p[:shortest] for _, p in found], axis=0))


def responses(result: GapResult, channel: str) -> go.Figure | None:
    """Frequency response of a channel to the steering angle in held-out sweeps: measured, before, after."""
    sweeps = [
        (b, a) for b, a in zip(result.before, result.after, strict=True)
        if b.manoeuvre == "frequency_response" and channel in b.measured and "steering angle" in b.states
    ][:3]  # fmt: skip
    if not sweeps:
        return None
    titles = [_title(b) for b, _ in sweeps]
    figure = make_subplots(rows=2, cols=len(sweeps), shared_xaxes=True, vertical_spacing=0.07, subplot_titles=titles)
    for column, (before, after) in enumerate(sweeps, start=1):
        lead = before.states["steering angle"][before.keep]
        curves = (
            ("measured", before.measured[channel], DATA, 3.0 * LINE_WIDTH),
            ("before", before.simulated[channel], BEFORE, LINE_WIDTH),
            ("after", after.simulated[channel], AFTER, LINE_WIDTH),
        )
        for label, signal, colour, width in curves:
            f, H = _response(lead, signal[before.keep], before.dt)
            magnitude, phase = 20.0 * np.log10(np.abs(H)), np.degrees(np.unwrap(np.angle(H)))
            _line(figure, label, f, magnitude, colour, 1, column, column == 1, width)
            _line(figure, label, f, phase, colour, 2, column, False, width)
        figure.update_xaxes(type="log", row=1, col=column)
        figure.update_xaxes(type="log", title="frequency (Hz)", row=2, col=column)
    figure.update_yaxes(title="magnitude (dB)", row=1, col=1)
    figure.update_yaxes(title="phase (deg)", row=2, col=1)
    figure.update_layout(template=TEMPLATE, height=480)
    return figure


def _response(lead: np.ndarray, signal: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequency response over the band that is driven, averaged over windows of 5 s."""
    size = min(round(5.0 / dt), lead.size)
    f, cross = csd(lead, signal, 1.0 / dt, nperseg=size)
    _, own = welch(lead, 1.0 / dt, nperseg=size)
    inside = (f >= 0.2) & (f <= 5.0)
    return f[inside], cross[inside] / own[inside]


def residual_map(result: GapResult, channel: str) -> go.Figure:
    """Mean residual in bins of the first two states, before and after, on one colour scale."""
    maps, edges = [], None
    labels: list[str] = []
    for traces in (result.before, result.after):
        here = [t for t in traces if channel in t.measured and len(t.states) > 1]
        labels = list(here[0].states)[:2]
        x, y = (np.concatenate([t.states[label][t.keep] for t in here]) for label in labels)
        r = np.concatenate([(t.measured[channel] - t.simulated[channel])[t.keep] for t in here])
        if edges is None:
            edges = [
                np.linspace(float(np.quantile(v, 0.005)), float(np.quantile(v, 0.995)), BINS + 1) for v in (x, y)
            ]
        total, _, _ = np.histogram2d(x, y, edges, weights=r)
        count, _, _ = np.histogram2d(x, y, edges)
        maps.append(np.where(count > 2, total / np.maximum(count, 1), np.nan))
    assert edges is not None
    largest = float(np.nanquantile(np.abs(maps[0]), 0.98)) if np.isfinite(maps[0]).any() else 1.0
    figure = make_subplots(rows=1, cols=2, subplot_titles=("before", "after"), shared_yaxes=True)
    centres = [0.5 * (e[1:] + e[:-1]) for e in edges]
    for column, values in enumerate(maps, start=1):
        figure.add_heatmap(
            x=centres[0], y=centres[1], z=values.T, coloraxis="coloraxis", row=1, col=column, hoverongaps=False
        )
        figure.update_xaxes(title=labels[0], row=1, col=column)
    figure.update_yaxes(title=labels[1], row=1, col=1)
    scale = {"colorscale": "RdBu", "cmin": -largest, "cmax": largest, "colorbar": {"title": "residual"}}
    figure.update_layout(template=TEMPLATE, height=420, coloraxis=scale)
    return figure


def ranking(result: GapResult) -> go.Figure:
    """Share put right over held-out z, one dot per candidate."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 420})
    named = {e.name for e in result.effects}
    kinds = (("alone", result.search.singles, "circle"), ("beside the first", result.search.pairs, "diamond"))
    for label, tried, symbol in kinds:
        if tried:
            figure.add_scatter(
                name=label, mode="markers+text", x=[j.z for j in tried], y=[max(j.fidelity, -0.5) for j in tried],
                text=[j.name for j in tried], textposition="top center",
                marker={"size": 11, "symbol": symbol, "color": [AFTER if j.name in named else DATA for j in tried]},
            )  # fmt: skip
    figure.update_xaxes(title="held-out z")
    figure.update_yaxes(title="share put right", range=[-0.6, 1.15])
    return figure


def _line(
    figure: go.Figure, name: str, x: object, y: object, colour: str, row: int, col: int, legend: bool,
    width: float = LINE_WIDTH,
) -> None:  # fmt: skip
    """A line; what is measured lies broad under what is simulated."""
    figure.add_scatter(
        x=x, y=y, name=name, mode="lines", line={"color": colour, "width": width}, legendgroup=name,
        showlegend=legend, row=row, col=col,
    )  # fmt: skip


def _title(trace: Trace) -> str:
    what = trace.name.split("/")[-1] if trace.group == 0.0 else f"{trace.group:g} km/h"
    return f"{trace.manoeuvre.split('/')[-1].replace('_', ' ')}<br>{what}"
