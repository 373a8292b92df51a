"""Step I: the single track and the steering trail from frequency responses (Section 3.4.2).

    I-a1  C_f, C_r          yaw rate, lateral acceleration, sideslip per tyre angle, magnitude below 0.5 Hz
    I-a2  sigma, J_z        the same, magnitude and phase over the whole band; J_z within 5 % of its theoretical value
    I-b1  n_t               rack force per rack travel, magnitude below 0.5 Hz
    I-b2  sigma again       rack force per rack travel, whole band

Each sensor group may lag the CAN bus by an unknown time, which the paper names as the likely cause of relaxation lengths
near 1 m in step I-a2. The lag of the inertial unit and that of the strain gauges are therefore unknowns of steps I-a2
and I-b2: a lag turns the phase and leaves the magnitude, a relaxation length changes both, so they can be told apart.
``delays=False`` gives the paper's own steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.frf import Complexes, Floats, FrequencyResponse
from identification.stages import Chain, Model, ResponseTerm, Values, WeightedTerm
from steer_env.physics.linear import VEHICLE_OUTPUTS, frequency_response, single_track_matrices
from steer_env.physics.vehicle import SingleTrack
from steer_env.plants.reference_row import KnownVehicle

LOW_HZ = 0.5  # "below 0.5 Hz is steady state", Section 3.4.2
BOUNDS: dict[str, tuple[float, float]] = {
    "C_f": (2e4, 6e5), "C_r": (2e4, 6e5),  # N/rad, small car to laden van
    "sigma_f": (0.01, 2.0), "sigma_r": (0.01, 2.0),  # m, to twice the paper's failed values
    "n_t": (0.001, 0.4),  # m
    "delay_imu": (-0.03, 0.10), "delay_rack": (-0.03, 0.10),  # s, CAN frames to a filtered GPS/IMU output
}  # fmt: skip
START = {"C_f": 1.2e5, "C_r": 1.2e5, "sigma_f": 0.3, "sigma_r": 0.3, "n_t": 0.08}
YAW_INERTIA_TOLERANCE = 0.05
BODY = ("yaw_rate", "lateral_acceleration", "sideslip_angle")


@dataclass(frozen=True)
class SpeedData:
    """Measured responses of one speed in m/s, by name: BODY per tyre angle (rad), "rack" in N/m.

    ``lines`` [n, 3] are the frequencies in Hz that all of them share.
    """

    speed: float
    lines: Floats
    responses: Mapping[str, FrequencyResponse]


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

    ``skipped_`` maps a step that could not be run to what was missing.
    """

    vehicle: KnownVehicle
    delays: bool = True

    def fit(self, data: Sequence[SpeedData]) -> VehicleIdentification:
        """Run steps I-a1 to I-b2 on the responses of one or several speeds; returns self."""
        theory = self.vehicle.yaw_inertia
        bounds = {**BOUNDS, "J_z": (theory * (1 - YAW_INERTIA_TOLERANCE), theory * (1 + YAW_INERTIA_TOLERANCE))}
        self.skipped_: dict[str, str] = {}
        self.chain_ = Chain({**START, "J_z": theory})
        self._fit_body(data, bounds)
        self._fit_rack(data, bounds)
        self.stepwise_ = self.chain_
        self.chain_ = self._fit_jointly(data, bounds)
        self.params_, self.std_ = dict(self.chain_.values), self.chain_.std_
        return self

    def _fit_jointly(self, data: Sequence[SpeedData], bounds: Mapping[str, tuple[float, float]]) -> Chain:
        """Step I-c, past the paper: all unknowns of step I at once on all its responses.

        The steps hold what a later step will change: C_f and C_r are fitted with start values for sigma and J_z, which
        already matter at 0.5 Hz. Where sideslip is insensitive (its gain passes zero near 60 km/h) that error grows.
        """
        found = self.stepwise_
        if "I-a2" in self.skipped_:
            return found
        names = [n for n in (*BODY, "rack") if all(n in d.responses for d in data)]
        if "n_t" not in found.values and "rack" in names:
            names.remove("rack")
        terms = []
        for d in data:
            model = TrackModel(d.speed, d.lines, self.vehicle)
            terms += [WeightedTerm(d.responses[n], model.rack if n == "rack" else model.body(n), d.speed) for n in names]
        chain = Chain(dict(found.values))
        return chain.fit(terms, {n: v for n, v in found.values.items() if n in bounds}, bounds)

    def _fit_body(self, data: Sequence[SpeedData], bounds: Mapping[str, tuple[float, float]]) -> None:
        names = [n for n in BODY if all(n in d.responses for d in data)]
        if not names:
            self.skipped_["I-a1"] = self.skipped_["I-a2"] = "no yaw rate, lateral acceleration or sideslip channel"
            return
        transient = ["sigma_f", "sigma_r", "J_z"]
        if "sideslip_angle" in names and len(names) > 1:
            low = self._body_terms(data, names, below=LOW_HZ, phase=0.0)
            self.chain_.fit(low, {n: self.chain_.values[n] for n in ("C_f", "C_r")}, bounds)
        else:
            self.skipped_["I-a1"] = "needs sideslip and one of yaw rate, lateral acceleration; C_f, C_r taken in I-a2"
            transient = ["C_f", "C_r", *transient]
        start = {n: self.chain_.values[n] for n in transient}
        if self.delays:
            start["delay_imu"] = 0.0
        self.chain_.fit(self._body_terms(data, names), start, bounds)

    def _fit_rack(self, data: Sequence[SpeedData], bounds: Mapping[str, tuple[float, float]]) -> None:
        if not all("rack" in d.responses for d in data):
            self.skipped_["I-b1"] = self.skipped_["I-b2"] = "no rack_force_N channel"
            self.chain_.values.pop("n_t")
            return
        if "I-a2" in self.skipped_:
            self.skipped_["I-b1"] = self.skipped_["I-b2"] = "needs step I-a"
            self.chain_.values.pop("n_t")
            return
        low = self._rack_terms(data, below=LOW_HZ, phase=0.0)
        self.chain_.fit(low, {"n_t": self.chain_.values["n_t"]}, bounds)
        start = {n: self.chain_.values[n] for n in ("sigma_f", "sigma_r")}
        if self.delays:
            start["delay_rack"] = 0.0
        self.chain_.fit(self._rack_terms(data), start, bounds)

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
