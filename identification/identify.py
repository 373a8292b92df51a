"""A campaign in, a haptic reference out: steps I to III of the paper at every speed, then the joint refinement.

Modes: "per-speed" as the paper (everything fitted anew at each speed), "shared" (n_t, C_f, C_r, J_z, sigma_f, sigma_r
the same at all speeds, because a car's tyres do not know its speedometer; the rest per speed).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from identification import speed_data
from identification.at_speed import MODES, Options, identify_at
from identification.axles import Axles, can_balance, fit_lags
from identification.campaign import Campaign
from identification.result import Identification, SpeedResult
from identification.speed_data import Measured
from identification.stages import Chain
from identification.vehicle import VehicleIdentification
from steer_env.errors import InputError

__all__ = ["MODES", "Interrupted", "Options", "identify"]

Advance = Callable[..., None]
ALL = Options()


class Interrupted(KeyboardInterrupt):
    """The user stopped an identification; ``result`` holds the speeds that were done."""

    def __init__(self, result: Identification) -> None:
        super().__init__()
        self.result = result


def identify(
    campaign: Campaign, options: Options = ALL, jobs: int = 1, advance: Advance = lambda **_: None
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
    provenance: dict[str, object] = {"campaign": campaign.name, "files": dict(campaign.hashes)}
    result = Identification(campaign.vehicle, options.slip, {}, provenance)
    for mode in options.modes:
        together = _vehicle(speeds, campaign, options, lags) if mode == "shared" else None
        start = {r.speed_kmh: r for r in result.modes.get("per-speed", [])}

        def one(speed: Measured, together: VehicleIdentification | None = together, mode: str = mode) -> SpeedResult:
            vehicle = together or _vehicle([speed], campaign, options, lags)
            found = identify_at(speed, vehicle, campaign, options, start.get(speed.runs.speed_kmh))  # noqa: B023
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
