"""The torsion-bar torque that the reference asks for at a measured pinion motion (Eq. 16), and its misfit.

    M_tb = K_assist^-1 ( J_ref d'' + b_ref d' + M_rack + M_fric(d) )

Motion and torques are band-limited first (``motion``), so that the differenced angle carries little noise, and the
misfit is compared after the same band limit. Friction follows the exact Dahl update between five points per sample.
The rack torque is the measured one where there is a rack force, else step I's vehicle driven by the measured angle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.campaign import Run
from identification.frf import Floats
from identification.motion import BandLimited, band_filter, band_limited
from identification.stages import Scores, Values
from identification.vehicle import single_track
from steer_env.physics._jit import compiled
from steer_env.physics.assist import inverse_assist
from steer_env.physics.friction import dahl_step
from steer_env.physics.linear import VEHICLE_OUTPUTS, frequency_response, single_track_matrices
from steer_env.plants.reference_row import KnownVehicle

SETTLE_S = 1.0  # left out at the start (unknown friction state) and the end of a record
UPSAMPLING = 5  # steps per sample for friction, whose turning points fall between samples
THIN = 2  # 50 Hz hold all of an error that is limited to 25 Hz
BLOCK_S = 2.5  # errors are taken as independent between blocks of this length, not within
HALF_PERIOD_S, SINE_BLOCKS = 2.5, 5  # of the steady-state sine at 0.2 Hz, and its blocks
NEEDS = ("pinion_angle_rad", "torsion_bar_torque_Nm")
VEHICLE_PARAMETERS = ("C_f", "C_r", "n_t", "sigma_f", "sigma_r", "J_z", "delay_imu")


@compiled
def predicted_torque(
    M_dyn: Floats, fine_angle: Floats, upsampling: int, M_C: float, c_fric: float, r: float, sigma: float
) -> Floats:
    """Torsion-bar torque [n] in N m for M_dyn [n] in N m and pinion angle [(n - 1) upsampling + 1] in rad."""
    out = np.zeros(M_dyn.size)
    friction = 0.0
    out[0] = inverse_assist(M_dyn[0], r, sigma)
    for k in range(1, M_dyn.size):
        for j in range((k - 1) * upsampling, k * upsampling):
            friction = dahl_step(friction, fine_angle[j + 1] - fine_angle[j], M_C, c_fric)
        out[k] = inverse_assist(M_dyn[k] + friction, r, sigma)
    return out


@dataclass(frozen=True)
class Prepared:
    """One run ready for Eq. 16; arrays [n] at the run's sampling, ``fine_angle`` at UPSAMPLING times it; SI."""

    M_tb: Floats
    angle: Floats
    rate: Floats
    acceleration: Floats
    rack: Floats
    fine_angle: Floats
    keep: slice


@dataclass
class TorqueMisfit:
    """Misfit in torsion-bar torque of the runs of one speed; a ``stages.Problem``.

    ``terms`` names what enters the prediction besides K_assist: any of "inertia", "damping", "rack" (measured or
    modelled load), "stiffness" (c_pin_on times the angle in its place) and "friction". The mean error of each run is
    taken out: sensor offsets carry no information. ``weights`` multiply the errors of a manoeuvre.
    """

    runs: Sequence[Run]
    speed: float
    vehicle: KnownVehicle
    slip: str
    terms: frozenset[str]
    weights: dict[str, float] = field(default_factory=dict)
    _signals: list[dict[str, BandLimited]] = field(init=False, repr=False)
    _prepared: tuple[tuple[float, ...], list[Prepared]] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        names = (*NEEDS, "rack_force_N")
        self._signals = [
            {n: band_limited(run.channels[n], run.dt) for n in names if n in run.channels} for run in self.runs
        ]
        self._filters = [band_filter(run.channels[NEEDS[0]].size, run.dt) for run in self.runs]

    def uses(self, name: str) -> bool:
        """A measured rack force leaves the vehicle's parameters out of it."""
        modelled = any("rack_force_N" not in signals for signals in self._signals) or self.slip == "kinematic"
        return name not in VEHICLE_PARAMETERS or modelled

    def residual(self, values: Values) -> Floats:
        """[sum of kept samples] in N m: measured minus predicted, every THIN-th sample of the band-limited error."""
        parts = []
        for run, prepared, kernel in zip(self.runs, self.prepared(values), self._filters, strict=True):
            predicted = self.predict(prepared, friction_of(run, values))
            error = kernel(prepared.M_tb - predicted)[prepared.keep][::THIN]
            parts.append((error - error.mean()) * self.weights.get(run.manoeuvre, 1.0))
        return np.concatenate(parts)

    def predict(self, run: Prepared, values: Values) -> Floats:
        """Eq. 16 [n] in N m."""
        M_dyn = np.zeros(run.M_tb.size)
        if "inertia" in self.terms:
            M_dyn += values["J_ref"] * run.acceleration
        if "damping" in self.terms:
            M_dyn += values["b_ref"] * run.rate
        if "stiffness" in self.terms:
            M_dyn += values["c_pin_on"] * run.angle
        if "rack" in self.terms:
            M_dyn += run.rack
        M_C = values["M_fric_C"] if "friction" in self.terms else 0.0
        torque: Floats = predicted_torque(
            M_dyn, run.fine_angle, UPSAMPLING, M_C, values["c_fric"], values["r"], values["sigma_assist"]
        )
        return torque

    def scores(self, jacobian: Floats, values: Values) -> Scores:
        """One cluster per block of a run."""
        return block_scores(self.residual(values), jacobian, self.sizes(values), self.runs, self.speed)

    def sizes(self, values: Values) -> list[int]:
        """Kept samples of each run."""
        return [p.M_tb[p.keep][::THIN].size for p in self.prepared(values)]

    def prepared(self, values: Values) -> list[Prepared]:
        """The runs shifted by the lags in ``values`` and with their rack torque; kept until those change."""
        keys = ("delay_bar", "delay_rack", "C_f", "C_r", "n_t", "sigma_f", "sigma_r", "J_z")
        now = tuple(values.get(k, 0.0) for k in keys)
        if self._prepared is None or self._prepared[0] != now:
            made = [self._prepare(r, s, values) for r, s in zip(self.runs, self._signals, strict=True)]
            self._prepared = (now, made)
        return self._prepared[1]

    def _prepare(self, run: Run, signals: dict[str, BandLimited], values: Values) -> Prepared:
        angle = signals["pinion_angle_rad"]
        margin = round(SETTLE_S / run.dt)
        loaded = "rack" in self.terms
        return Prepared(
            M_tb=signals["torsion_bar_torque_Nm"].shifted(values.get("delay_bar", 0.0)).signal(),
            angle=angle.signal(),
            rate=angle.rate().signal(),
            acceleration=angle.rate().rate().signal(),
            rack=rack_torque(signals, values, self.vehicle, self.slip, self.speed).signal()
            if loaded
            else np.zeros(angle.n),
            fine_angle=angle.fine(UPSAMPLING),
            keep=slice(margin, angle.n - margin),
        )


def friction_of(run: Run, values: Values) -> Values:
    """The values with the friction level that belongs to a run: a sweep may have its own (``refine``)."""
    if run.manoeuvre == "frequency_response" and "M_fric_C_sweep" in values:
        return {**values, "M_fric_C": values["M_fric_C_sweep"]}
    return values


def rack_torque(
    signals: Mapping[str, BandLimited], values: Values, vehicle: KnownVehicle, slip: str, speed: float
) -> BandLimited:
    """M_rack in N m at the pinion: measured, or step I's vehicle led by the measured pinion angle.

    With kinematic slip the lag sigma_f / v of the front tyre is taken out, as row 2 of Eq. 10 has it.
    """
    source = signals.get("rack_force_N", signals["pinion_angle_rad"])
    frequency = np.maximum(source.frequency, 1e-6)
    lead = 1.0 + 2j * np.pi * frequency * (values["sigma_f"] / speed if slip == "kinematic" else 0.0)
    if "rack_force_N" in signals:
        return source.shifted(values.get("delay_rack", 0.0)).filtered(lead / vehicle.pinion_ratio)
    matrices = single_track_matrices(speed, single_track(values, vehicle))
    front = frequency_response(matrices, frequency)[:, VEHICLE_OUTPUTS.index("slip_front"), 0]
    return source.filtered(values["C_f"] * values["n_t"] / vehicle.steering_ratio**2 * front * lead)


def block_scores(error: Floats, jacobian: Floats, sizes: Sequence[int], runs: Sequence[Run], speed: float) -> Scores:
    """Scores of a time-domain residual, summed within blocks of BLOCK_S; ``sizes`` are the samples of each run.

    The same block of repeated runs is one cluster: what the model leaves out repeats, and must not count as averaged.
    In a sine it repeats, mirrored, in every half period: there a block is a fifth of all half periods.
    """
    found: Scores = {}
    first = 0
    for run, size in zip(runs, sizes, strict=True):
        sine = run.manoeuvre == "steady_state"
        length = max(1, round((HALF_PERIOD_S / SINE_BLOCKS if sine else BLOCK_S) / run.dt / THIN))
        for block, start in enumerate(range(first, first + size, length)):
            part = slice(start, min(start + length, first + size))
            key = (speed, "block", run.manoeuvre, block % SINE_BLOCKS if sine else block)
            score = jacobian[part].T @ error[part]
            found[key] = found[key] + score if key in found else score
        first += size
    inflate = np.sqrt(len(found) / max(len(found) - jacobian.shape[1], 1.0))
    return {key: inflate * score for key, score in found.items()}
