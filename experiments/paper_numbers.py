"""figures.json: every number and curve of the report, for whoever wants to draw or judge them anew."""

from __future__ import annotations

import math
from typing import Any

from experiments import paper_peaks as peaks
from experiments.paper_results import SUBJECTS, Results
from experiments.report import paper_panels as panels


def summary(results: Results) -> dict[str, Any]:
    """Statements, peaks, generator and controller errors; without curves."""
    return {
        "statements": [
            {
                "says": row["says"],
                "section": row["where"],
                "findings": {SUBJECTS[n]: f._asdict() for n, f in row["findings"].items()},
            }
            for row in results.statements()
        ],
        "peaks_Hz": {
            label: {
                f"{v:g} km/h": {"first": _finite(p.first), "second": _finite(p.second)}
                for v, p in zip(peaks.PAPER_SPEEDS_KMH, found, strict=True)
            }
            for label, found in results.peaks()
        },
        "generators_against_eq_10": {
            f"{x.speed_kmh:g} km/h": {
                name: d._asdict() for name, d in zip(("impedance", "admittance"), x.difference, strict=True)
            }
            for x in results.executed
        },
        "closed_loops": [
            {
                "plant": c.plant,
                "causality": c.causality,
                "linear": c.linear,
                "stable": c.stable,
                "worst_dB": c.worst[0],
                "worst_deg": c.worst[1],
                "half_width_deg": _finite(c.half_widths()[0]),
                "reference_half_width_deg": _finite(c.half_widths()[1]),
            }
            for c in results.loops
        ],
    }


def document(results: Results) -> dict[str, Any]:
    """All of it: the summary, the tables and the curves of each figure (complex as [real, imaginary])."""
    return {
        **summary(results),
        "tables": {
            "published": [row._asdict() for row in results.published.file.rows],
            "our_car": [
                {"speed_kmh": s.speed_kmh, "values": s.values, "standard_errors": s.std} for s in results.car.speeds
            ],
            "our_car_truth": results.car.true_rows(),
        },
        "figures": {
            **{
                f"{number}, {v:g} km/h": panels.as_numbers(make(results, v))
                for number, make in (("5", panels.figure_5), ("7", panels.figure_7))
                for v in peaks.PAPER_SPEEDS_KMH
            },
            "6": panels.as_numbers(panels.figure_6(results)),
            "8a": panels.as_numbers(panels.figure_8a(results)),
            "8bc": panels.as_numbers(panels.figure_8bc(results)),
            "9": panels.as_numbers(panels.figure_9(results)),
            "10": panels.as_numbers(panels.figure_10(results)),
            "11": panels.as_numbers(panels.figure_11(results)),
        },
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
