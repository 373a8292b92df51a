"""Tables 2 and 3 beside ours, as rows and as curves over speed."""

from __future__ import annotations

from collections.abc import Sequence

from experiments.paper_car import OurSpeed
from experiments.paper_results import Results
from experiments.report.figures import Curve
from experiments.report.paper_figures import OURS, PUBLISHED, TRUTH
from experiments.report.style import PALETTE
from experiments.report.with_error import with_error
from steer_env.plants.reference_row import ReferenceRow
from steer_env.units import quantities

PARAMETERS = {
    "As Table 2": ("J_ref", "b_ref", "k_gain", "n_t", "sigma_f", "sigma_r", "C_f", "C_r", "J_z"),
    "As Table 3": ("c_pin_on", "c_pin_off", "M_fric_C"),
}
SOURCES = {"printed": "ours, as printed", "steps": "ours, Eq. 9", "refined": "ours, refined"}
DRAWN = {"printed": PALETTE[1], "refined": OURS}
NINETY_FIVE = 1.96


def parameter_rows(results: Results, names: Sequence[str]) -> tuple[list[str], list[list[object]]]:
    """Columns and rows: per parameter and speed the published value, ours by each form, our car's truth."""
    rows: list[list[object]] = []
    published = {row.speed_kmh: row for row in results.published.file.rows}
    truth = {row["speed_kmh"]: row for row in results.car.true_rows()}
    for name in names:
        for place, ours in enumerate(reversed(results.car.speeds)):
            v = ours.speed_kmh
            rows.append(
                [
                    _label(name) if place == 0 else "",
                    f"{v:g}",
                    _published(results, published[v], name),
                    *(_ours(ours, form, name) for form in SOURCES),
                    _plain(truth[v][name]),
                ]
            )
    return ["", "km/h", "published", *SOURCES.values(), "its truth"], rows


def parameter_curves(results: Results) -> tuple[dict[str, Sequence[Curve]], dict[str, dict[str, Sequence[float]]]]:
    """Curves over km/h by parameter, and 95 % half intervals of ours."""
    curves: dict[str, Sequence[Curve]] = {}
    errors: dict[str, dict[str, Sequence[float]]] = {}
    published, truth = results.published.file.rows, results.car.true_rows()
    for name in (n for names in PARAMETERS.values() for n in names):
        drawn = [
            Curve(
                "published", [r.speed_kmh for r in published], [getattr(r, name) for r in published], PUBLISHED, "dash"
            )
        ]
        speeds = [s.speed_kmh for s in results.car.speeds]
        drawn.append(Curve("our car's truth", speeds, [row[name] for row in truth], TRUTH, "dot"))
        for form, colour in DRAWN.items():
            values = [s.values[form].get(name, float("nan")) for s in results.car.speeds]
            drawn.append(Curve(SOURCES[form], speeds, values, colour))
            band = [NINETY_FIVE * s.std[form].get(name, 0.0) for s in results.car.speeds]
            errors.setdefault(_label(name), {})[SOURCES[form]] = band
        curves[_label(name)] = drawn
    return curves, errors


def _published(results: Results, row: ReferenceRow, name: str) -> str:
    index = list(results.published.file.rows).index(row)
    mark = " (extrapolated)" if name in results.published.file.extrapolated[index] else ""
    return f"{_plain(getattr(row, name))}{mark}"


def _ours(ours: OurSpeed, form: str, name: str) -> str | None:
    value = ours.values[form].get(name)
    if value is None:
        return None
    error = ours.std[form].get(name)
    return _plain(value) if error is None else with_error(value, error)


def _plain(value: float) -> str:
    """Four significant digits or all before the point; a bound at zero is zero."""
    return f"{value:.0f}" if abs(value) >= 1e4 else "0" if abs(value) < 1e-9 else f"{value:.4g}"


def _label(name: str) -> str:
    unit = quantities(ReferenceRow)[name].unit
    return name if unit == "-" else f"{name} [{unit}]"
