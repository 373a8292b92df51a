"""Step I: the single track and the steering trail from frequency responses (Section 3.4.2).

    lags  delay_imu, delay_rack    axle and rack equations over all speeds (``axles.fit_lags``)
    I-a1  C_f, C_r        yaw rate, lateral acceleration, sideslip per tyre angle, magnitude below 0.5 Hz
    I-a2  sigma, J_z      the same, magnitude and phase over the whole band; J_z within 5 % of its theoretical value
    I-b1  n_t             rack force per rack travel, magnitude below 0.5 Hz
    I-b2  sigma again     rack force per rack travel, whole band
    I-c   all of them     past the paper: each axle by its own equation (``axles.fit_axles``)

The paper names the latency of CAN signals as the likely cause of relaxation lengths near 1 m in step I-a2. Each sensor
group's lag behind the CAN bus is therefore found first. Where channels for that are missing, lags are unknowns of steps
I-a2 and I-b2: a lag turns the phase and leaves the magnitude, a relaxation length changes both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.axles import Axles, can_balance, fit_axles, fit_lags
from identification.frf import Complexes, Floats, FrequencyResponse, Spectra
from identification.stages import Chain, Model, ResponseTerm, Values
from identification.vehicle_bounds import BOUNDS, LOW_HZ, START, YAW_INERTIA_TOLERANCE
from steer_env.physics.linear import VEHICLE_OUTPUTS, frequency_response, single_track_matrices
from steer_env.physics.vehicle import SingleTrack
from steer_env.plants.reference_row import KnownVehicle

NO_SWEEP = "no usable sweep (see the remarks)"
BODY = ("yaw_rate", "lateral_acceleration", "sideslip_angle")


@dataclass(frozen=True)
class SpeedData:
    """Measured responses of one speed in m/s, by name: BODY per tyre angle (rad), "rack" in N/m.

    ``lines`` [n, 3] are the frequencies in Hz that all of them share; ``spectra`` is what they were made from.
    """

    speed: float
    lines: Floats
    responses: Mapping[str, FrequencyResponse]
    spectra: Spectra


@dataclass
class TrackModel:
    """The single track's responses at one speed, computed once for all channels at the same parameter values."""

    speed: float
    lines: Floats
    vehicle: KnownVehicle
    _key: tuple[float, ...] = ()
    _value: Complexes = field(default_factory=lambda: np.zeros(0, complex))

    def response(self, values: Values) -> Complexes:
        """H [n, 3, 4] from tyre angle to VEHICLE_OUTPUTS."""
        p = single_track(values, self.vehicle)
        if tuple(p) != self._key:
            H = frequency_response(single_track_matrices(self.speed, p), self.lines.ravel())
            self._key, self._value = tuple(p), H[:, :, 0].reshape(*self.lines.shape, -1)
        return self._value

    def body(self, name: str) -> Model:
        """Model of one body channel with the lag of the inertial unit."""
        column = VEHICLE_OUTPUTS.index(name)

        def model(values: Values, measured: FrequencyResponse) -> Complexes:
            return self.response(values)[measured.point, :, column] * lag(values.get("delay_imu", 0.0), measured)

        return model

    def rack(self, values: Values, measured: FrequencyResponse) -> Complexes:
        """F_rack / x_rack in N/m (Eq. 9) with the lag of the strain gauges."""
        v = self.vehicle
        gain = values["C_f"] * values["n_t"] * (v.pinion_ratio / v.steering_ratio) ** 2
        slip = self.response(values)[measured.point, :, VEHICLE_OUTPUTS.index("slip_front")]
        out: Complexes = gain * slip * lag(values.get("delay_rack", 0.0), measured)
        return out


def single_track(values: Values, vehicle: KnownVehicle) -> SingleTrack:
    """Physics parameters from what is known and what has been found so far."""
    return SingleTrack(
        m=vehicle.mass, l_f=vehicle.cg_to_front_axle, l_r=vehicle.cg_to_rear_axle,
        J_z=values["J_z"], C_f=values["C_f"], C_r=values["C_r"],
        sigma_f=values["sigma_f"], sigma_r=values["sigma_r"],
        n_t=values.get("n_t", 0.0), i_s=vehicle.steering_ratio,
    )  # fmt: skip


def lag(delay: float, measured: FrequencyResponse) -> Complexes:
    """exp(-j w delay) at the lines of a response."""
    turn: Complexes = np.exp(-2j * np.pi * measured.line_frequency * delay)
    return turn


@dataclass
class VehicleIdentification:
    """Step I for one speed, or for several that share their parameters. Fitted: ``params_``, ``std_``, ``chain_``.

    ``stepwise_`` is the chain after the paper's steps, ``chain_`` after I-c; ``skipped_`` maps a step that could not be
    run to why. ``lags=False`` takes all sensors as synchronous.
    """

    vehicle: KnownVehicle
    lags: bool = True

    def fit(self, data: Sequence[SpeedData], lags: Chain | None = None) -> VehicleIdentification:
        """Run all steps on one or several speeds, from the lags already found (``axles.fit_lags``); returns self."""
        theory = self.vehicle.yaw_inertia
        bounds = {**BOUNDS, "J_z": (theory * (1 - YAW_INERTIA_TOLERANCE), theory * (1 + YAW_INERTIA_TOLERANCE))}
        self.skipped_: dict[str, str] = {}
        axles = [Axles(d.spectra, d.speed, self.vehicle) for d in data]
        balanced = bool(axles) and all(can_balance(a.data) for a in axles)
        if lags is None and self.lags and balanced:
            lags = fit_lags(axles)
        known = lags.copy() if lags is not None else Chain({})
        lag_values = {n: v for n, v in known.values.items() if n.startswith("delay")}
        self._unknown_lags = self.lags and lags is None
        self.stepwise_ = replace(known.copy(), values={**START, "J_z": theory, **lag_values}, at_bound=set())
        self._fit_body(data, bounds)
        self._fit_rack(data, bounds)
        if balanced:
            begin = {**self.stepwise_.values, **lag_values}
            self.chain_ = fit_axles(axles, replace(known, values=begin, at_bound=set()))
        else:
            self.skipped_["I-c"] = "needs yaw rate, lateral acceleration and sideslip"
            self.chain_ = self.stepwise_
        self.params_, self.std_ = dict(self.chain_.values), self.chain_.std_
        return self

    def _fit_body(self, data: Sequence[SpeedData], bounds: Mapping[str, tuple[float, float]]) -> None:
        names = [n for n in BODY if all(n in d.responses for d in data)]
        if not names or not data:
            why = "no yaw rate, lateral acceleration or sideslip channel" if data else NO_SWEEP
            self.skipped_["I-a1"] = self.skipped_["I-a2"] = why
            return
        transient = ["sigma_f", "sigma_r", "J_z"]
        if "sideslip_angle" in names and len(names) > 1:
            low = self._body_terms(data, names, below=LOW_HZ, phase=0.0)
            self.stepwise_.fit(low, {n: self.stepwise_.values[n] for n in ("C_f", "C_r")}, bounds)
        else:
            self.skipped_["I-a1"] = "needs sideslip and one of yaw rate, lateral acceleration; C_f, C_r taken in I-a2"
            transient = ["C_f", "C_r", *transient]
        start = {n: self.stepwise_.values[n] for n in transient}
        if self._unknown_lags:
            start["delay_imu"] = 0.0
        self.stepwise_.fit(self._body_terms(data, names), start, bounds)

    def _fit_rack(self, data: Sequence[SpeedData], bounds: Mapping[str, tuple[float, float]]) -> None:
        if not data or not all("rack" in d.responses for d in data):
            why = "no usable rack_force_N channel" if data else NO_SWEEP
            self.skipped_["I-b1"] = self.skipped_["I-b2"] = why
            self.stepwise_.values.pop("n_t")
            return
        if "I-a2" in self.skipped_:
            self.skipped_["I-b1"] = self.skipped_["I-b2"] = "needs step I-a"
            self.stepwise_.values.pop("n_t")
            return
        low = self._rack_terms(data, below=LOW_HZ, phase=0.0)
        self.stepwise_.fit(low, {"n_t": self.stepwise_.values["n_t"]}, bounds)
        start = {n: self.stepwise_.values[n] for n in ("sigma_f", "sigma_r")}
        if self._unknown_lags:
            start["delay_rack"] = 0.0
        self.stepwise_.fit(self._rack_terms(data), start, bounds)

    def _body_terms(
        self, data: Sequence[SpeedData], names: Sequence[str], below: float = np.inf, phase: float = 1.0
    ) -> list[ResponseTerm]:
        share = 1.0 / len(names)
        return [
            ResponseTerm(
                d.responses[n].below(below), TrackModel(d.speed, d.lines, self.vehicle).body(n), d.speed, share,
                phase * share,
            )
            for d in data
            for n in names
        ]  # fmt: skip

    def _rack_terms(
        self, data: Sequence[SpeedData], below: float = np.inf, phase: float = 1.0
    ) -> list[ResponseTerm]:
        return [
            ResponseTerm(
                d.responses["rack"].below(below), TrackModel(d.speed, d.lines, self.vehicle).rack, d.speed, 1.0, phase
            )
            for d in data
        ]
