"""A made-up benchmark with known numbers, for tests of its report."""

from dataclasses import asdict
from itertools import product

import numpy as np

from experiments import bench_scores
from experiments.assessment import Assessment
from experiments.bench_cases import Case
from experiments.stability_gate import safe

SYSTEMS = tuple(product(("EPAS", "SbW"), ("impedance", "admittance")))
MANOEUVRES = ("frequency_response", "steady_state", "release")
SPEEDS_KMH, DRAWS = (30.0, 75.0), 2
HZ = np.geomspace(0.2, 5.0, 6)


def plot_of(manoeuvre, size):
    """What bench_plots keeps, with ``size`` dB or N m in it."""
    if manoeuvre == "frequency_response":
        return {"frequency_Hz": HZ.tolist(), "ratio_dB": [size] * 6, "ratio_deg": [-2.0] * 6}
    if manoeuvre == "steady_state":
        angle, torque = [-1.0, 0.0, 1.0, 0.0], [-size, 0.5, size, -0.5]
        return {"achieved_angle_deg": angle, "achieved_torque_Nm": torque,
                "reference_angle_deg": angle, "reference_torque_Nm": torque}  # fmt: skip
    time = [0.0, 0.5, 1.0, 1.5]
    return {"time_s": time, "unit": "N m", "achieved": [0.0, size, size, 0.0], "reference": [0.0, 1.0, 1.0, 0.0],
            "error": [0.0, size - 1.0, size - 1.0, 0.0]}  # fmt: skip


def scored(jnd, unstable=(), causality_factor=1.0):
    """Test cases of the controllers in ``jnd`` (name: JND in every metric); ``unstable``: (name, speed) pairs.

    In admittance every metric is ``causality_factor`` times as large.
    """
    found = []
    for name, (plant, causality), speed, manoeuvre, draw in product(jnd, SYSTEMS, SPEEDS_KMH, MANOEUVRES, range(DRAWS)):
        case = Case(plant, causality, name, speed, manoeuvre, "relaxed", split="test", draw=draw)
        value = jnd[name] * (1.0 + 0.01 * draw) * (causality_factor if causality == "admittance" else 1.0)
        metrics = ["tracking_jnd", "felt_torque_jnd"] + ["frf_jnd"] * (manoeuvre == MANOEUVRES[0])
        scores = {**dict.fromkeys(metrics, value), "ripple": None}
        if manoeuvre == "steady_state":
            scores |= {"feel_jnd": value, "torque_hysteresis": 1.25, "torque_hysteresis_reference": 1.5}
        plot = plot_of(manoeuvre, value) if draw == 0 else {}
        result = {"case": asdict(case), "stable": True, "scores": scores, "plot": plot}
        if (name, speed) in unstable:
            result |= {"stable": False, "scores": {}, "plot": {}, "stopped_after_s": 1.25}
        found.append(result)
    return found


def exhibits(names):
    """Linear and complete chirps and the sine of every controller at 75 km/h."""
    ones = np.ones(len(HZ))
    response = {"frequency_Hz": HZ, "coherence": ones, "achieved_real": 1.1 * ones, "achieved_imag": -0.1 * ones,
                "reference_real": ones, "reference_imag": 0.0 * ones}  # fmt: skip
    exact = {"exact_Hz": HZ, "exact_real": ones, "exact_imag": 0.0 * ones}
    found = []
    for name, (plant, causality) in product(names, SYSTEMS):
        for manoeuvre, linear in ((MANOEUVRES[0], True), (MANOEUVRES[0], False), (MANOEUVRES[1], False)):
            plot = plot_of(manoeuvre, 4.0)
            if manoeuvre == MANOEUVRES[0]:
                plot = {key: values.tolist() for key, values in (response | (exact if linear else {})).items()}
            scores = {"tracking_relative": 0.1, "worst_magnitude": 0.8, "worst_phase": 5.0}
            case = asdict(Case(plant, causality, name, 75.0, manoeuvre, "relaxed", linear))
            found.append({"case": case, "stable": True, "scores": scores, "plot": plot})
    return found


def assessment(plant, causality, speed, growth=-1.0, reference_growth=-2.0, disk=0.6, arm="relaxed"):
    """One place of the proof; margins vanish where it is unstable."""
    stable = growth < 0.0
    margins = (8.0, 40.0, disk, 4.0, 4.0, 4.0) if stable else (0.0, 0.0, 0.0, 0.0, 0.0, 4.0)
    return Assessment(
        plant, causality, speed, "centre_stuck", arm, growth, 7.5, reference_growth, stable, reference_growth < 0.0,
        *margins, -1.0, -0.5,
    )  # fmt: skip


def proof(places):
    """Limits, gates, confirmations and assessments from {controller: assessments}, as scores.json has them."""
    gates, confirmations, assessments = [], [], []
    for name, own in places.items():
        for plant, causality in dict.fromkeys((a.plant, a.causality) for a in own):
            here = [a for a in own if (a.plant, a.causality) == (plant, causality)]
            worst = max(here, key=lambda a: a.growth)
            gates.append({"controller": name, "plant": plant, "causality": causality, **safe(here)._asdict()})
            confirmations.append(
                {"controller": name, **dict(zip(Assessment._fields[:6], worst[:6], strict=True)),
                 "simulated_growth": 1.1 * worst.growth, "agrees": True, "left_Nm": 0.01, "thrown": False}
            )  # fmt: skip
        assessments += [{"controller": name, **a._asdict()} for a in own]
    limits = {"gain_margin_dB": 40.0, "delay_margin_ms": 6.0, "arm_radius": 4.0, "slowest_mode_per_s": 0.5}
    return {"limits": limits, "gates": gates, "confirmations": confirmations, "assessments": assessments}


def summary_of(results, proven=None):
    """What scores.json would hold, gates from the proof and the episodes."""
    proven = proven or {}
    names = dict.fromkeys(r["case"]["controller"] for r in results)
    gates = {
        name: [
            *(reason for g in proven.get("gates", ()) if g["controller"] == name for reason in g["failures"]),
            *(f"{c['plant']} {c['causality']}, {c['speed_kmh']:g} km/h, {c['manoeuvre']}, {c['arm']}: unstable in "
              f"simulation (draw {c['draw']})" for r in results for c in [r["case"]]
              if c["controller"] == name and not r["stable"]),
        ]
        for name in names
    }  # fmt: skip
    return bench_scores.write_scores(None, results, "published", 0, gates, proven)
