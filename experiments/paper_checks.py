"""Statements of the paper that need runs, not only rows: generators, friction, assist, controllers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.paper_car import OurCar, complex_of
from experiments.paper_closed_loops import ClosedLoop
from experiments.paper_peaks import PAPER_SPEEDS_KMH
from experiments.paper_published import Executed, eq_10_at
from experiments.paper_statements import Finding, verdict
from identification.frf import Complexes, Floats
from steer_env.plants import Reference

SAME_dB, SAME_DEG = 0.1, 1.0  # generators in closed form and as executed
NEAR_dB, NEAR_DEG = 1.5, 10.0  # what is asked of a controller over 0.2 to 4 Hz
HARMLESS_dB = 0.5  # mean change of magnitude that "does not affect" an estimate
LOW_HZ, HIGH_HZ = 1.0, 2.0


def generators(executed: Sequence[Executed]) -> Finding:
    """Figure 9: the linear generators do what Eq. 10 says, at every speed."""
    worst_dB = max(d.magnitude_dB for x in executed for d in x.difference)
    worst_deg = max(d.phase_deg for x in executed for d in x.difference)
    good = worst_dB < SAME_dB and worst_deg < SAME_DEG
    text = f"at most {worst_dB:.4f} dB and {worst_deg:.3f}° off Eq. 10, 0.2-5 Hz, all speeds"
    return Finding(verdict(good), text)


def generators_agree(executed: Sequence[Executed]) -> Finding:
    """Both complete generators, one driven by the other's output, show the same response."""
    ratio = np.concatenate([x.complete[1].angle / x.complete[0].angle for x in executed if x.speed_kmh >= 45.0])
    worst = float(np.abs(20.0 * np.log10(np.abs(ratio))).max())
    return Finding(verdict(worst < SAME_dB), f"at most {worst:.4f} dB apart at 45 km/h and above")


def friction(executed: Sequence[Executed], reference: Reference) -> Finding:
    """Section 3.4: at large amplitude friction does not affect the response."""
    found = {}
    for x in _at_paper_speeds(executed):
        H = x.frictional
        found[x.speed_kmh] = _mean_dB(H.angle, eq_10_at(reference, x.speed_kmh, H.frequency)[:, 0])
    return Finding(
        verdict(all(d < HARMLESS_dB for d in found.values())), _by_speed(found, "dB mean change of magnitude")
    )


def friction_on_ours(car: OurCar) -> Finding:
    """The same, as error of step II against our car's truth (tyres as they are, Eq. 9)."""
    rows = {row["speed_kmh"]: row for row in car.true_rows()}
    parts, good = [], []
    for v in PAPER_SPEEDS_KMH:
        shares = [car.at(v).values["steps"][n] / rows[v][n] - 1.0 for n in ("J_ref", "b_ref", "k_gain")]
        good.append(max(map(abs, shares)) < 0.05)
        parts.append(
            f"{v:g} km/h: J_ref {100 * shares[0]:+.0f}, b_ref {100 * shares[1]:+.0f}, k_gain {100 * shares[2]:+.0f} %"
        )
    return Finding(verdict(all(good), any(good)), "; ".join(parts) + " off the truth (friction and assist)")


def low_frequency(executed: Sequence[Executed], reference: Reference) -> Finding:
    """Section 4.1: the linear fit leaves the response at low frequencies because of the assist."""
    found = {}
    for x in _at_paper_speeds(executed):
        H = x.complete[0]
        found[x.speed_kmh] = _below_above(H.frequency, H.angle, eq_10_at(reference, x.speed_kmh, H.frequency)[:, 0])
    return _low_against_high(found)


def low_frequency_of_ours(car: OurCar) -> Finding:
    """The same, measured against the fit of step II."""
    found = {}
    for v in PAPER_SPEEDS_KMH:
        response = car.at(v).responses["pinion_angle"]
        f, H = complex_of(response.measured)
        line_f, line = complex_of(response.fitted["printed"])
        magnitude = np.exp(np.interp(np.log(f), np.log(line_f), np.log(np.abs(line))))
        found[v] = _below_above(f, H, magnitude)
    return _low_against_high(found)


def controllers(loops: Sequence[ClosedLoop]) -> Finding:
    """Figures 9 and 10: plant and PID against the reference, 0.2 to 4 Hz."""
    near = [c.stable and c.worst[0] <= NEAR_dB and c.worst[1] <= NEAR_DEG for c in loops]
    worst = max(c.worst[0] for c in loops), max(c.worst[1] for c in loops)
    count = f"{sum(near)} of {len(near)} loops within {NEAR_dB:g} dB and {NEAR_DEG:g}°"
    text = f"{count}; worst {worst[0]:.2f} dB, {worst[1]:.1f}°"
    return Finding(verdict(all(near), any(near)), text)


def _at_paper_speeds(executed: Sequence[Executed]) -> list[Executed]:
    by_speed = {x.speed_kmh: x for x in executed}
    return [by_speed[v] for v in PAPER_SPEEDS_KMH if v in by_speed]


def _mean_dB(H: Complexes, line: Complexes) -> float:
    return float(np.abs(20.0 * np.log10(np.abs(H / line))).mean())


def _below_above(f: Floats, H: Complexes, line: Complexes | Floats) -> tuple[float, float]:
    error = np.abs(20.0 * np.log10(np.abs(H) / np.abs(line)))
    return float(error[f < LOW_HZ].mean()), float(error[f > HIGH_HZ].mean())


def _low_against_high(found: dict[float, tuple[float, float]]) -> Finding:
    more = [low > high for low, high in found.values()]
    text = "; ".join(
        f"{low:.1f} dB below 1 Hz, {high:.1f} above 2 Hz at {v:g} km/h" for v, (low, high) in found.items()
    )
    return Finding(verdict(all(more), any(more)), text)


def _by_speed(found: dict[float, float], what: str) -> str:
    return (
        " and ".join(f"{d:.1f}" for d in found.values())
        + f" {what} at "
        + " and ".join(f"{v:g}" for v in found)
        + " km/h"
    )
