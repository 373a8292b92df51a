"""Curves for the report: fitted responses, hysteresis loops, and errors on held-out runs."""

from __future__ import annotations

import numpy as np

from identification.campaign import Campaign, Run
from identification.pinion import OUTPUTS, PinionModel
from identification.refine import Refinement
from identification.result import Loop, SpeedResult, relative_errors
from identification.speed_data import Measured
from identification.stages import Chain, Values
from identification.torque import NEEDS, TorqueMisfit
from identification.vehicle import BODY, TrackModel

PLOT_HZ = np.geomspace(0.2, 5.0, 80)
STEPWISE = frozenset({"inertia", "damping", "rack", "friction"})


def fill_curves(
    result: SpeedResult, speed: Measured, campaign: Campaign, slip: str, chain: Chain, refinement: Refinement | None
) -> None:
    """Put measured and fitted responses, loops and held-out errors into ``result``."""
    vehicle = campaign.vehicle
    if vehicle is None:
        return
    result.responses = {**speed.responses.vehicle.responses, **speed.responses.pinion}
    values = {**chain.values, **{n: v for n, v in result.values.items() if n in chain.values}}
    if "I-a2" in result.skipped:
        return
    track = TrackModel(speed.runs.speed, PLOT_HZ[:, None], vehicle).response(values)[:, 0, :]
    f = PLOT_HZ
    for k, name in enumerate(BODY):
        result.fitted[name] = (f, track[:, k] * _lag(values.get("delay_imu", 0.0)))
    if "n_t" not in values:
        return
    gain = values["C_f"] * values["n_t"] * (vehicle.pinion_ratio / vehicle.steering_ratio) ** 2
    result.fitted["rack"] = (f, gain * track[:, 3] * _lag(values.get("delay_rack", 0.0)))
    for label, found in (("", result.frf), (" refined", result.values)):
        if all(n in found for n in ("J_ref", "b_ref", "k_gain")):
            at = {**values, **{n: found[n] for n in ("J_ref", "b_ref", "k_gain")}}
            H = PinionModel(speed.runs.speed, f[:, None], vehicle, slip).response(at)[:, 0, :]
            for k, name in enumerate(OUTPUTS):
                result.fitted[name + label] = (f, H[:, k] * _lag(-values.get("delay_bar", 0.0)))
    _loops(result, speed, campaign, slip, chain, refinement)


def _lag(delay: float) -> np.ndarray:
    return np.exp(-2j * np.pi * PLOT_HZ * delay)


def _loops(
    result: SpeedResult, speed: Measured, campaign: Campaign, slip: str, chain: Chain, refinement: Refinement | None
) -> None:
    if any(n not in chain.values for n in ("r", "M_fric_C", "J_ref")) or campaign.vehicle is None:
        return

    def predicted(runs: list[Run], values: Values) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        misfit = TorqueMisfit(runs, speed.runs.speed, campaign.vehicle, slip, STEPWISE)  # type: ignore[arg-type]
        return [(p.angle[p.keep], p.M_tb[p.keep], misfit.predict(p, values)[p.keep]) for p in misfit.prepared(values)]

    runs = speed.runs.sines[:1]
    steps = predicted(runs, chain.values)
    refined = predicted(runs, refinement.chain_.values) if refinement else [None] * len(steps)
    for step, better in zip(steps, refined, strict=True):
        result.loops.append(Loop(step[0], step[1], step[2], None if better is None else better[2]))
    held = [run for run in speed.runs.held_out if all(n in run.channels for n in NEEDS)]
    if not held:
        return
    pairs = predicted(held, chain.values)
    result.misfit["steps"] = relative_errors([p[1] for p in pairs], [p[2] for p in pairs])
    if refinement:
        pairs = predicted(held, refinement.chain_.values)
        result.misfit["refined"] = relative_errors([p[1] for p in pairs], [p[2] for p in pairs])

