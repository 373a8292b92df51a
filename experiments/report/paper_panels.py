"""What stands in each of the paper's figures, ours beside the published rows: panels of curves, not yet drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from experiments.measures import Array
from experiments.paper_car import Response, complex_of
from experiments.paper_closed_loops import ClosedLoop
from experiments.paper_generators import SINE_HZ
from experiments.paper_peaks import PAPER_SPEEDS_KMH
from experiments.paper_published import LINE_HZ, eq_10, vehicle_lines
from experiments.paper_results import Results
from experiments.report.figures import Curve
from experiments.report.paper_figures import PUBLISHED, Panel
from experiments.report.style import DATA, PALETTE, ordered_colours
from steer_env.envs.layout import PERIOD
from steer_env.physics.assist import softening
from steer_env.plants.reference_row import ReferenceRow

GENERATOR_KMH = 75.0
CYCLE = 500  # samples of the campaign's 0.2 Hz sine at 100 Hz
FIT, REFINED = PALETTE[1], PALETTE[0]
LOOP_COLOURS = {"EPAS": (PALETTE[0], PALETTE[1]), "SbW": (PALETTE[2], PALETTE[3])}
BODY_TITLES = {"yaw_rate": "yaw rate", "lateral_acceleration": "lateral acceleration", "sideslip_angle": "sideslip"}
Panels = list[Panel]


def figure_5(results: Results, speed_kmh: float) -> Panels:
    """Body motion per tyre angle at one speed, a column per output."""
    published = vehicle_lines(results.published, speed_kmh, 1.0)
    responses = results.car.at(speed_kmh).responses
    return [_measured(responses[name], title, published[name]) for name, title in BODY_TITLES.items()]


def figure_6(results: Results) -> Panels:
    """Rack force per rack travel, a column per speed."""
    i_rp = results.published.file.vehicle.pinion_ratio
    return [
        _measured(results.car.at(v).responses["rack"], f"{v:g} km/h", vehicle_lines(results.published, v, i_rp)["rack"])
        for v in PAPER_SPEEDS_KMH
    ]


def figure_7(results: Results, speed_kmh: float) -> Panels:
    """Pinion angle and rate per torsion-bar torque at one speed."""
    lines = eq_10(results.published, speed_kmh)
    responses = results.car.at(speed_kmh).responses
    titles = {"pinion_angle": "angle / torque", "pinion_rate": "rate / torque"}
    return [
        _measured(responses[name], f"{title}, {speed_kmh:g} km/h", lines[:, k], "printed")
        for k, (name, title) in enumerate(titles.items())
    ]


def figure_8a(results: Results) -> Panels:
    """K_assist at all speeds: published, ours by the paper's steps, ours refined."""
    rows = {
        "published": results.published.file.rows,
        "our car, the paper's steps": results.car.reference("printed").file.rows,
        "our car, refined": results.car.reference("refined").file.rows,
    }
    return [Panel(title, lines=_gain_curves(of)) for title, of in rows.items()]


def figure_8bc(results: Results) -> Panels:
    """Hysteresis at 0.2 Hz, a column per speed: ours measured and fitted, the published row executed."""
    panels = []
    for v in PAPER_SPEEDS_KMH:
        loop = results.car.at(v).loop
        angle = np.degrees(loop["angle"])
        once = slice(-CYCLE, None)
        published_angle, published_torque = _last_cycle(results.at(v).loop)
        lines = [
            Curve("our car, the paper's steps", angle[once], loop["steps"][once], FIT, "dot"),
            Curve("our car, refined", angle[once], loop["refined"][once], REFINED),
            Curve("published row, executed", np.degrees(published_angle), published_torque, PUBLISHED, "dash"),
        ]
        panels.append(Panel(f"{v:g} km/h", [Curve("our car, measured", angle, loop["measured"], DATA)], lines))
    return panels


def figure_9(results: Results) -> Panels:
    """Without friction and assist: Eq. 10, both generators on their own, EPAS with PID."""
    executed = results.at(GENERATOR_KMH)
    lines = eq_10(results.published, GENERATOR_KMH)
    panels = []
    for k, title in enumerate(("angle / torque", "rate / torque")):
        dots = [
            Curve(f"{name} generator", found[k].frequency, found[k].value, colour)
            for name, found, colour in zip(
                ("impedance", "admittance"), executed.linear, (PALETTE[4], PALETTE[3]), strict=True
            )
        ]
        loops = _closed(results.loops, k, lambda c: c.linear)
        panels.append(Panel(title, dots, [Curve("Eq. 10", LINE_HZ, lines[:, k], PUBLISHED, "dash"), *loops]))
    return panels


def figure_10(results: Results) -> Panels:
    """Complete reference: both plants with PID in both causalities, Eq. 10 for comparison."""
    executed = results.at(GENERATOR_KMH).complete[0]
    linear = eq_10(results.published, GENERATOR_KMH)
    panels = []
    for plant in ("EPAS", "SbW"):
        for k, title in enumerate(("angle / torque", "rate / torque")):
            lines = [
                Curve("complete reference", executed.frequency, executed[k + 1], PUBLISHED),
                Curve("Eq. 10 (linear)", LINE_HZ, linear[:, k], DATA, "dot"),
                *_closed(results.loops, k, lambda c, plant=plant: not c.linear and c.plant == plant),  # type: ignore[misc]
            ]
            panels.append(Panel(f"{plant}: {title}", lines=lines))
    return panels


def figure_11(results: Results) -> Panels:
    """Hysteresis of both plants with PID at 75 km/h; the reference is the published row executed."""
    angle, torque = _last_cycle(results.at(GENERATOR_KMH).loop)
    panels = []
    for plant in ("EPAS", "SbW"):
        lines = [Curve("complete reference", np.degrees(angle), torque, PUBLISHED, "dash")]
        for loop, colour in zip(_of(results.loops, plant), LOOP_COLOURS[plant], strict=True):
            if loop.loop is not None:
                achieved = _last_cycle(loop.loop)
                lines.append(Curve(f"{loop.name}, PID", np.degrees(achieved[0]), achieved[1], colour))
        panels.append(Panel(plant, lines=lines))
    return panels


def as_numbers(panels: Sequence[Panel]) -> list[dict[str, Any]]:
    """Panels as JSON: complex values as [real, imaginary]."""
    return [
        {
            "title": panel.title,
            **{kind: [_numbers(c) for c in getattr(panel, kind)] for kind in ("dots", "lines", "coherence")},
        }
        for panel in panels
    ]


def _numbers(curve: Curve) -> dict[str, Any]:
    y = np.asarray(curve.y)
    values = np.column_stack([y.real, y.imag]).tolist() if np.iscomplexobj(y) else y.tolist()
    return {"name": curve.name, "x": np.asarray(curve.x).tolist(), "y": values}


def _measured(found: Response, title: str, published: Any, form: str = "steps") -> Panel:
    """Our dots, fits and coherence, with the published rows' line."""
    lines = [
        Curve("our car, the paper's steps", *complex_of(found.fitted[form]), FIT, "solid"),
        Curve("published row, computed", LINE_HZ, published, PUBLISHED, "dash"),
    ]
    if "refined" in found.fitted:
        lines.insert(1, Curve("our car, refined (linear part)", *complex_of(found.fitted["refined"]), REFINED, "dot"))
    f, gamma = np.array(found.coherence).T
    return Panel(
        title,
        [Curve("our car, measured", *complex_of(found.measured), DATA)],
        lines,
        [Curve("coherence", f, gamma, DATA)],
    )


def _last_cycle(loop: tuple[Array, Array]) -> tuple[Array, Array]:
    n = round(1.0 / (SINE_HZ * PERIOD))
    return loop[0][-n:], loop[1][-n:]


def _gain_curves(rows: Sequence[ReferenceRow]) -> list[Curve]:
    M = np.linspace(-6.0, 6.0, 121)
    curves = []
    for row, colour in zip(rows, ordered_colours(len(rows)), strict=True):
        r = row.c_pin_off / row.c_pin_on
        gain = [1.0 / softening(float(m), r, row.sigma_assist) for m in M]
        curves.append(Curve(f"{row.speed_kmh:g} km/h", M, gain, colour))
    return curves


def _closed(loops: Sequence[ClosedLoop], k: int, chosen: Callable[[ClosedLoop], bool]) -> list[Curve]:
    curves = []
    for loop in filter(chosen, loops):
        H = (loop.angle, loop.rate)[k]
        colour = LOOP_COLOURS[loop.plant][loop.causality == "admittance"]
        curves.append(Curve(f"{loop.name}, PID", H.frequency, H.value, colour))
    return curves


def _of(loops: Sequence[ClosedLoop], plant: str) -> list[ClosedLoop]:
    return [c for c in loops if not c.linear and c.plant == plant]
