"""Every scored case for the page's browser: scores of all draws and the plot of the first, kept small."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.measures import JND_DB, JND_DEG
from experiments.metrics import METRICS
from experiments.report.benchmark_plants import SHOWN_ARM, SHOWN_SPEED_KMH
from experiments.report.page import Report
from experiments.report.style import Look

Result = dict[str, Any]
FIELDS = ("controller", "system", "speed", "manoeuvre", "arm")
# What the table of a case shows, where the case has it; scores.csv has every metric.
SHOWN = (
    "tracking_error", "tracking_jnd", "tracking_p95", "felt_torque_error", "felt_torque_jnd", "frf_jnd",
    "frf_worst_jnd", "worst_magnitude", "worst_phase", "transparency_bandwidth", "feel_jnd", "torque_hysteresis",
    "on_centre_stiffness", "returnability", "overshoot", "settling_time", "residual_angle", "passivity_gap_energy",
    "ripple", "hand_ripple", "effort", "saturation",
)  # fmt: skip
PLOT_STEPS = 400  # of a curve's range at least: what a screen shows
DIGITS = 3  # of a score


def cases(report: Report, scored: Sequence[Result], looks: Mapping[str, Look]) -> None:
    """The section with the browser; nothing where nothing was scored."""
    if not scored:
        return
    report.section("Every case")
    report.text(
        "Choose a case; the same case of a second controller lies over it. Plots are those of the first draw, the "
        "table has all draws, a metric of the reference in brackets."
    )
    report.case_browser(browser_data(scored, looks))


def browser_data(scored: Sequence[Result], looks: Mapping[str, Look]) -> dict[str, Any]:
    """What the browser reads: choices of each field (controllers as in ``looks``), metrics per manoeuvre, the cases.

    A case's key holds the index of its choice in each of FIELDS, with dots between. Its ``draws`` hold
    ``values`` in the order of the manoeuvre's metrics ([achieved, of the reference] where there is one)
    or, unstable, ``stopped_s``; ``plot`` is that of draw 0. ``first`` is the key shown first.
    """
    driven = {result["case"]["controller"] for result in scored}
    names = [name for name in looks if name in driven]
    choices: dict[str, list[Any]] = {
        "controller": names, **{field: list(dict.fromkeys(_field(r, field) for r in scored)) for field in FIELDS[1:]}
    }  # fmt: skip
    choices["speed"].sort()
    metrics = {m: _metrics([r for r in scored if r["case"]["manoeuvre"] == m]) for m in choices["manoeuvre"]}
    at = {field: {value: k for k, value in enumerate(values)} for field, values in choices.items()}
    found: dict[str, dict[str, Any]] = {}
    for result in sorted(scored, key=lambda r: r["case"]["draw"]):
        key = ".".join(str(at[field][_field(result, field)]) for field in FIELDS)
        case = found.setdefault(key, {"draws": []})
        case["draws"].append(_draw(result, metrics[result["case"]["manoeuvre"]]))
        if result["case"]["draw"] == 0 and result["plot"]:
            case["plot"] = _small(result["plot"])
    return {
        "fields": FIELDS,
        "choices": choices,
        "labels": {"controller": [looks[n].label for n in names], "speed": [f"{v:g} km/h" for v in choices["speed"]]},
        "colours": [looks[name].colour for name in names],
        "metrics": {
            m: [{"name": "score", "unit": "JND", "meaning": "what the ranking counts"}]
            + [{"name": name, "unit": METRICS[name].unit, "meaning": METRICS[name].meaning} for name in shown]
            for m, shown in metrics.items()
        },
        "first": _first(found, choices),
        "jnd": {"dB": JND_DB, "deg": JND_DEG},
        "cases": found,
    }


def _first(found: Mapping[str, Any], choices: Mapping[str, Sequence[Any]]) -> str:
    """The key that is shown first: of the best controller, drawn, if possible at the paper's speed and arm."""
    drawn = [key for key, case in found.items() if "plot" in case] or list(found)

    def strange(key: str) -> tuple[bool, bool, bool]:
        controller, _, speed, _, arm = map(int, key.split("."))
        return controller != 0, choices["speed"][speed] != SHOWN_SPEED_KMH, choices["arm"][arm] != SHOWN_ARM

    return min(drawn, key=strange)


def _field(result: Result, field: str) -> Any:
    case = result["case"]
    if field == "system":
        return f"{case['plant']} {case['causality']}"
    return case["speed_kmh" if field == "speed" else field]


def _metrics(results: Sequence[Result]) -> list[str]:
    """Those of SHOWN that at least one case has."""
    return [name for name in SHOWN if any(r["scores"].get(name) is not None for r in results)]


def _draw(result: Result, metrics: Sequence[str]) -> dict[str, Any]:
    if not result["stable"]:
        return {"stopped_s": _round(result.get("stopped_after_s"))}
    scores = result["scores"]
    values: list[Any] = [_round(case_score(result, Protocol.load()))]
    for name in metrics:
        value, reference = _round(scores.get(name)), _round(scores.get(f"{name}_reference"))
        values.append(value if f"{name}_reference" not in scores else [value, reference])
    return {"values": values}


def _round(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{DIGITS}g}")


def _small(plot: Mapping[str, Any]) -> dict[str, Any]:
    """The same curves in fewer characters; of evenly spaced times only first and last are kept."""
    small: dict[str, Any] = {}
    for name, values in plot.items():
        if name == "time_s":
            small[name] = [values[0], values[-1]]
        elif name == "frequency_Hz":
            small[name] = [_round(value) for value in values]
        else:
            small[name] = values if isinstance(values, str) else _coarse(values)
    return small


def _coarse(values: Sequence[float]) -> list[float]:
    """Rounded to the decimals that the range of values needs; whole numbers without a point."""
    span = max(values, default=0.0) - min(values, default=0.0)
    decimals = max(math.ceil(math.log10(PLOT_STEPS / span)), 0) if span > 0.0 else DIGITS
    rounded = (round(value, decimals) for value in values)
    return [int(value) if value.is_integer() else value for value in rounded]
