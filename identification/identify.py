"""A campaign in, a haptic reference out: steps I to III at every speed, then the joint refinement (theory.md section 4).

Modes: "per-speed" as the paper (everything fitted anew at each speed), "shared" (n_t, C_f, C_r, J_z, sigma_f, sigma_r
the same at all speeds, because a car's tyres do not know its speedometer; the rest per speed).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identification import speed_data, timing
from identification.axles import Axles, can_balance, fit_lags
from identification.campaign import Campaign
from identification.curves import fill_curves
from identification.pinion import PinionIdentification
from identification.refine import SWEEP_FRICTION, UNKNOWNS, Refinement
from identification.result import KEYS, Identification, SpeedResult
from identification.speed_data import SpeedResponses, SpeedRuns
from identification.stages import Chain
from identification.steady_state import (
    C_FRIC,
    SIGMA,
    SteadyStateIdentification,
    on_centre_stiffness,
)
from identification.vehicle import VehicleIdentification
from steer_env.errors import InputError

MODES = ("per-speed", "shared")
VEHICLE_KEYS = ("n_t", "sigma_f", "sigma_r", "C_f", "C_r", "J_z")
Advance = Callable[..., None]


class Options(NamedTuple):
    """``modes``: any of MODES; ``slip``: "relaxed" or "kinematic"; ``delays``: whether sensor lags are unknowns."""

    modes: tuple[str, ...] = MODES
    slip: str = "relaxed"
    delays: bool = True


class Measured(NamedTuple):
    """One speed's runs with the responses made from them."""

    runs: SpeedRuns
    responses: SpeedResponses


class Interrupted(KeyboardInterrupt):
    """The user stopped an identification; ``result`` holds the speeds that were done."""

    def __init__(self, result: Identification) -> None:
        super().__init__()
        self.result = result


def identify(
    campaign: Campaign, options: Options = Options(), jobs: int = 1, advance: Advance = lambda **_: None
) -> Identification:
    """Identify a vehicle campaign; ``advance(note=...)`` is called once per speed and mode."""
    if campaign.kind != "vehicle" or campaign.vehicle is None:
        raise InputError(f"{campaign.folder}: kind", f"'{campaign.kind}' is not 'vehicle'", "give a vehicle campaign")
    speeds = [
        Measured(runs, speed_data.responses(runs.sweeps, runs.speed, campaign.vehicle))
        for runs in speed_data.runs_by_speed(campaign)
    ]
    if not speeds:
        raise InputError(
            f"{campaign.folder}: runs",
            "there is no run of manoeuvre frequency_response or steady_state to identify from",
            "name at least one such run in campaign.toml",
        )
    axles = [Axles(s.responses.vehicle.spectra, s.runs.speed, campaign.vehicle) for s in speeds]
    axles = [a for a in axles if can_balance(a.data)]
    lags = fit_lags(axles) if axles and options.delays else None
    provenance = {"campaign": campaign.name, "files": dict(campaign.hashes), "modes": list(options.modes)}
    result = Identification(campaign.vehicle, options.slip, {}, provenance)
    for mode in options.modes:
        together = _vehicle(speeds, campaign, options, lags) if mode == "shared" else None
        start = {r.speed_kmh: r for r in result.modes.get("per-speed", [])}

        def one(speed: Measured, together: VehicleIdentification | None = together, mode: str = mode) -> SpeedResult:
            vehicle = together or _vehicle([speed], campaign, options, lags)
            found = _at_speed(speed, vehicle, campaign, options, start.get(speed.runs.speed_kmh))  # noqa: B023
            advance(note=f"{speed.runs.speed_kmh:g} km/h, {mode}")
            return found

        result.modes[mode] = []
        with ThreadPoolExecutor(max_workers=jobs) as pool:
            waiting = [pool.submit(one, speed) for speed in speeds]
            try:
                for future in waiting:
                    result.modes[mode].append(future.result())
            except KeyboardInterrupt as stop:
                pool.shutdown(wait=False, cancel_futures=True)
                raise Interrupted(result) from stop
    return result


def _vehicle(
    speeds: Sequence[Measured], campaign: Campaign, options: Options, lags: Chain | None
) -> VehicleIdentification:
    """Step I over one or all speeds; speeds without responses take no part in a shared fit."""
    assert campaign.vehicle is not None
    usable = [s.responses.vehicle for s in speeds if s.responses.vehicle.responses]
    everywhere = [n for n in (usable[0].responses if usable else ()) if all(n in d.responses for d in usable)]
    data = [replace(d, responses={n: d.responses[n] for n in everywhere}) for d in usable]
    return VehicleIdentification(campaign.vehicle, options.delays).fit(data, lags)


def _at_speed(
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
    if start is not None and "refine" not in start.skipped:
        values.update({n: start.values[n] for n in UNKNOWNS if n in start.values})
        values["r"] = start.values["c_pin_off"] / start.values["c_pin_on"]
    chain = replace(chain.copy(), values=values)
    steering = campaign.steering
    bar = None if steering is None else (steering.torsion_bar_stiffness, steering.torsion_bar_damping)
    refinement = Refinement(campaign.vehicle, options.slip, bar)
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
