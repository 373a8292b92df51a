"""All steps at one speed, as far as its channels allow: lags, pinion, steady state, refinement."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identification import timing
from identification.campaign import Campaign
from identification.curves import fill_curves
from identification.pinion import PinionIdentification
from identification.refine import SWEEP_FRICTION, UNKNOWNS, Refinement
from identification.result import KEYS, SpeedResult
from identification.speed_data import Measured
from identification.stages import Chain
from identification.steady_state import C_FRIC, SIGMA, SteadyStateIdentification, on_centre_stiffness
from identification.vehicle import VehicleIdentification

VEHICLE_KEYS = ("n_t", "sigma_f", "sigma_r", "C_f", "C_r", "J_z")
MODES = ("per-speed", "shared")


class Options(NamedTuple):
    """``modes``: any of MODES; ``slip``: "relaxed" or "kinematic"; ``delays``: whether sensor lags are unknowns."""

    modes: tuple[str, ...] = MODES
    slip: str = "relaxed"
    delays: bool = True


def identify_at(
    speed: Measured, vehicle: VehicleIdentification, campaign: Campaign, options: Options, start: SpeedResult | None
) -> SpeedResult:
    """Steps I to III and refinement at one speed, with whatever the channels allow."""
    result = SpeedResult(speed.runs.speed_kmh, skipped=dict(vehicle.skipped_))
    result.notes += [f"{name}: {why}" for name, why in speed.responses.missing.items()]
    chain = vehicle.chain_.copy()
    _take_vehicle(result, vehicle)
    if "I-a2" not in vehicle.skipped_ and "n_t" in vehicle.params_:
        chain = _lags(speed, chain, campaign, options, result)
        chain = _pinion(speed, chain, campaign, options, result)
        chain, stepwise = _steady_state(speed, chain, campaign, options, result)
        refinement = _refined(speed, chain, campaign, options, result, start)
        fill_curves(result, speed, campaign, options.slip, stepwise, refinement)
    else:
        for step in ("II", "III-a", "III-b", "refine"):
            result.skipped[step] = "needs step I with the steering trail"
        fill_curves(result, speed, campaign, options.slip, chain, None)
    return result


def _take_vehicle(result: SpeedResult, vehicle: VehicleIdentification) -> None:
    stepwise, errors = vehicle.stepwise_, vehicle.stepwise_.std_
    for name in VEHICLE_KEYS:
        if name in vehicle.params_ and (name in vehicle.std_ or name in vehicle.chain_.at_bound):
            result.values[name] = vehicle.params_[name]
            result.frf[name] = stepwise.values[name]
        if name in vehicle.std_:
            result.std[name] = vehicle.std_[name]
        if name in errors:
            result.frf_std[name] = errors[name]
    for name in sorted(vehicle.chain_.at_bound):
        result.notes.append(f"{name} ended at its bound: {vehicle.params_[name]:.4g}")


def _lags(speed: Measured, chain: Chain, campaign: Campaign, options: Options, result: SpeedResult) -> Chain:
    """Torsion-bar and steering-angle lags, where the bar is known and its three channels are there."""
    steering = campaign.steering
    missing = [n for n in timing.NEEDS if n not in speed.responses.vehicle.spectra.lines]
    if steering is None or missing or not options.delays:
        why = "no [steering] table" if steering is None else f"no {missing[0]}" if missing else "switched off"
        result.skipped["lags"] = why
    else:
        c_tb, b_tb = steering.torsion_bar_stiffness, steering.torsion_bar_damping
        chain = timing.identify_timing(speed.responses.vehicle.spectra, c_tb, b_tb, speed.runs.speed, chain)
    errors = chain.std_
    result.delays = {n: (v, errors.get(n, np.nan)) for n, v in chain.values.items() if n.startswith("delay")}
    return chain


def _pinion(speed: Measured, chain: Chain, campaign: Campaign, options: Options, result: SpeedResult) -> Chain:
    pinion = speed.responses.pinion
    if len(pinion) < 2 or campaign.vehicle is None:
        result.skipped["II"] = speed.responses.missing.get("pinion", "too few coherent points")
        return chain
    lines, v = speed.responses.vehicle.lines, speed.runs.speed
    step = PinionIdentification(campaign.vehicle, options.slip).fit(
        pinion["pinion_angle"], pinion["pinion_rate"], lines, v, chain
    )
    result.values.update(step.params_)
    result.std.update(step.std_)
    result.frf.update(step.params_)
    result.frf_std.update(step.std_)
    return step.chain_


def _steady_state(
    speed: Measured, chain: Chain, campaign: Campaign, options: Options, result: SpeedResult
) -> tuple[Chain, Chain]:
    """Step III; returns the chain to refine from and the one of the paper's steps (they are the same)."""
    assert campaign.vehicle is not None
    c_pin_on = on_centre_stiffness(chain.values, speed.runs.speed, campaign.vehicle)
    result.values["c_pin_on"] = c_pin_on
    result.std["c_pin_on"] = chain.error_of(
        lambda v: on_centre_stiffness(v, speed.runs.speed, campaign.vehicle)  # type: ignore[arg-type]
    )
    needs = ("torsion_bar_torque_Nm", "pinion_angle_rad")
    missing = [n for n in needs if any(n not in run.channels for run in speed.runs.sines)]
    if not speed.runs.sines or missing or "II" in result.skipped:
        why = "no steady_state run" if not speed.runs.sines else f"no {missing[0]}" if missing else "needs step II"
        result.skipped["III-a"] = result.skipped["III-b"] = why
        return chain, chain
    step = SteadyStateIdentification(campaign.vehicle, options.slip).fit(speed.runs.sines, speed.runs.speed, chain)
    found = {n: step.params_[n] for n in ("c_pin_off", "M_fric_C", "sigma_assist", "c_fric")}
    result.values.update(found)
    result.frf.update(found)
    for errors in (result.std, result.frf_std):
        errors.update({n: e for n, e in step.std_.items() if n in KEYS})
        if "r" in step.std_:
            errors["c_pin_off"] = step.chain_.error_of(lambda v: v["r"] * c_pin_on)
    return step.chain_, step.chain_


def _refined(
    speed: Measured, chain: Chain, campaign: Campaign, options: Options, result: SpeedResult, start: SpeedResult | None
) -> Refinement | None:
    assert campaign.vehicle is not None
    if "II" in result.skipped:
        result.skipped["refine"] = "needs step II"
        return None
    values = {"r": 0.3, "sigma_assist": SIGMA, "M_fric_C": 1.0, "c_fric": C_FRIC, **chain.values}
    values["c_pin_on"] = result.values["c_pin_on"]
    weights = None
    if start is not None and start.refined:
        values.update(start.refined)
        weights = start.weights
    chain = replace(chain.copy(), values=values)
    steering = campaign.steering
    bar = None if steering is None else (steering.torsion_bar_stiffness, steering.torsion_bar_damping)
    refinement = Refinement(campaign.vehicle, options.slip, bar, weights=weights)
    refinement.fit(speed.runs.sweeps, speed.runs.sines, speed.runs.speed, chain)
    if "c_fric" in refinement.chain_.at_bound or refinement.std_.get("c_fric", 0.0) > refinement.params_["c_fric"]:
        result.notes.append(f"c_fric cannot be told from these data and is kept at {C_FRIC:g} N m/rad")
        chain.values["c_fric"] = C_FRIC
        refinement = replace(refinement, fit_c_fric=False).fit(
            speed.runs.sweeps, speed.runs.sines, speed.runs.speed, chain
        )
        result.std.pop("c_fric", None)
    _take_refined(result, refinement, speed, campaign)
    return refinement


def _take_refined(result: SpeedResult, refinement: Refinement, speed: Measured, campaign: Campaign) -> None:
    """Refined values and errors in place of the steps'; a value at a bound has no error."""
    result.weights = refinement.weights_
    solution = refinement.chain_.values
    result.refined = {n: solution[n] for n in (*UNKNOWNS, SWEEP_FRICTION) if n in solution}
    for name in ("J_ref", "b_ref", "k_gain", "c_pin_off", "sigma_assist", "M_fric_C", "c_fric"):
        result.values[name] = refinement.params_[name]
        result.std.pop(name, None)
        if name in refinement.std_:
            result.std[name] = refinement.std_[name]
    swept, slow = refinement.params_[SWEEP_FRICTION], refinement.params_["M_fric_C"]
    error = refinement.std_.get(SWEEP_FRICTION, np.nan)
    if abs(swept - slow) > 3.0 * np.hypot(error, refinement.std_.get("M_fric_C", np.nan)):
        result.notes.append(f"friction depends on rate: {slow:.3g} N m at 0.2 Hz, {swept:.3g} N m in the sweep")
    vehicle, v = campaign.vehicle, speed.runs.speed
    if "r" in refinement.std_ and vehicle is not None:
        result.std["c_pin_off"] = refinement.chain_.error_of(
            lambda values: values["r"] * on_centre_stiffness(values, v, vehicle)
        )
    for name in sorted(refinement.chain_.at_bound & {"r", "sigma_assist", "M_fric_C", "J_ref", "b_ref"}):
        label = "c_pin_off" if name == "r" else name
        result.notes.append(f"{label} ended at its bound and is not identified here")
    if "M_fric_C" in refinement.chain_.at_bound:
        result.std.pop("c_fric", None)  # the stiffness of no friction is nothing
