"""The paper's steps at one speed with Eq. 10 as it is printed: rack torque from kinematic slip.

Table 2 was found with this form. It lets the front tyres' force act without their relaxation, and
on tyres that do relax the lag has to go somewhere: b_ref.
"""

from __future__ import annotations

from typing import NamedTuple

from identification import timing
from identification.axles import Axles, can_balance, fit_lags
from identification.campaign import Campaign
from identification.curves import PLOT_HZ
from identification.frf import Complexes, Floats
from identification.pinion import PinionIdentification, PinionModel
from identification.speed_data import SpeedResponses, SpeedRuns, responses, runs_by_speed
from identification.stages import Chain
from identification.steady_state import SteadyStateIdentification
from identification.vehicle import VehicleIdentification
from steer_env.plants.reference_row import KnownVehicle

SLIP = "kinematic"
VEHICLE_KEYS = ("n_t", "sigma_f", "sigma_r", "C_f", "C_r", "J_z")


class Steps(NamedTuple):
    """Values and standard errors by names of ReferenceRow, and the fit at PLOT_HZ [n, 2]."""

    values: dict[str, float]
    std: dict[str, float]
    fitted: tuple[Floats, Complexes]


def printed_steps(campaign: Campaign) -> dict[float, Steps]:
    """Steps I to III at every speed in km/h of a campaign that has all channels."""
    vehicle = campaign.vehicle
    assert vehicle is not None  # our own campaign states it
    driven = runs_by_speed(campaign)
    found = [responses(runs.sweeps, runs.speed, vehicle) for runs in driven]
    axles = [Axles(r.vehicle.spectra, runs.speed, vehicle) for runs, r in zip(driven, found, strict=True)]
    lags = fit_lags([a for a in axles if can_balance(a.data)])
    return {runs.speed_kmh: _at_speed(runs, r, vehicle, campaign, lags) for runs, r in zip(driven, found, strict=True)}


def _at_speed(runs: SpeedRuns, found: SpeedResponses, vehicle: KnownVehicle, campaign: Campaign, lags: Chain) -> Steps:
    first = VehicleIdentification(vehicle).fit([found.vehicle], lags)
    chain = first.chain_.copy()
    bar = campaign.steering
    if bar is not None:
        chain = timing.identify_timing(
            found.vehicle.spectra,
            bar.torsion_bar_stiffness,
            bar.torsion_bar_damping,
            runs.speed,
            chain,
        )
    second = PinionIdentification(vehicle, SLIP).fit(
        found.pinion["pinion_angle"],
        found.pinion["pinion_rate"],
        found.vehicle.lines,
        runs.speed,
        chain,
    )
    third = SteadyStateIdentification(vehicle, SLIP).fit(runs.sines, runs.speed, second.chain_)
    steady = {n: v for n, v in third.params_.items() if n != "r"}
    H = PinionModel(runs.speed, PLOT_HZ[:, None], vehicle, SLIP).response(second.chain_.values)
    std = {**first.stepwise_.std_, **second.std_, **third.std_}
    std["c_pin_off"] = third.chain_.error_of(lambda v: v["r"] * steady["c_pin_on"])
    vehicle_values = {n: first.stepwise_.values[n] for n in VEHICLE_KEYS}
    return Steps({**vehicle_values, **second.params_, **steady}, std, (PLOT_HZ, H[:, 0, :]))
