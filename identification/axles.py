"""Step I past the paper: each axle by its own equation, with measured motion instead of a model of the body.

    front   F_f (1 + s sigma_f / v) = C_f (delta / i_s - (v_y + l_f r) / v)      F_f = (l_r m a_y + J_z r') / L
    rear    F_r (1 + s sigma_r / v) = C_r (l_r r - v_y) / v                      F_r = (l_f m a_y - J_z r') / L
    rack    F_rack = F_f n_t i_rp / i_s

On a car that is a single track these are Eqs. 6 and 9, so nothing changes. On a real one roll and compliance bend the
responses (lateral acceleration by a third near the roll frequency); a body model then pays with C, sigma and J_z, while
the axles' own balance stays true, since force and slip are both measured. The rack equation also tells the lag between
strain gauges and inertial unit without any tyre model, and J_z from how rack force and motion share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.equations import Equation
from identification.frf import Complexes, Spectra
from identification.stages import Chain, Values
from identification.vehicle_bounds import BOUNDS, LOW_HZ, START, YAW_INERTIA_TOLERANCE
from steer_env.plants.reference_row import KnownVehicle

INSTRUMENT = "steering_torque_Nm"
BODY = ("yaw_rate_radps", "lateral_acceleration_mps2", "sideslip_angle_rad")
ANGLE, RACK = "pinion_angle_rad", "rack_force_N"
FRONT = ("C_f", "sigma_f", "J_z", "delay_imu")
REAR = ("C_r", "sigma_r", "J_z")
GAUGE = ("n_t", "J_z", "delay_imu", "delay_rack")


@dataclass(frozen=True)
class Axles:
    """The equations of one speed in m/s, from the spectra of its sweeps."""

    data: Spectra
    speed: float
    vehicle: KnownVehicle

    def equations(self, start: Values, knee_Hz: float = np.inf) -> list[Equation]:
        """Front, rear and, with a rack force, rack; arguments as for ``Equation``."""
        made = [
            Equation(self.data, INSTRUMENT, self.front, (ANGLE, *BODY), FRONT, start, self.speed, knee_Hz),
            Equation(self.data, INSTRUMENT, self.rear, BODY, REAR, start, self.speed, knee_Hz),
        ]
        if RACK in self.data.lines:
            channels = (RACK, *BODY[:2])
            made.append(Equation(self.data, INSTRUMENT, self.rack, channels, GAUGE, start, self.speed, knee_Hz))
        return made

    def front(self, values: Values) -> tuple[Complexes, Complexes]:
        """Slip from force minus slip from motion in rad, over the latter."""
        rate, _, sideslip = self._body()
        lead = self._lead(values, "delay_imu")
        motion = (sideslip + self.vehicle.cg_to_front_axle / self.speed * rate) * lead
        slip = self.data.lines[ANGLE] / self.vehicle.steering_ratio - motion
        force = self._forces(values)[0] * lead
        return force * self._relaxation(values["sigma_f"]) / values["C_f"] - slip, slip

    def rear(self, values: Values) -> tuple[Complexes, Complexes]:
        """As ``front``; all its signals are the inertial unit's, so no lag enters."""
        rate, _, sideslip = self._body()
        slip = self.vehicle.cg_to_rear_axle / self.speed * rate - sideslip
        return self._forces(values)[1] * self._relaxation(values["sigma_r"]) / values["C_r"] - slip, slip

    def rack(self, values: Values) -> tuple[Complexes, Complexes]:
        """Rack force over i_rp n_t / i_s minus front axle force in N, over the latter."""
        v = self.vehicle
        force = self._forces(values)[0] * self._lead(values, "delay_imu")
        gauge = self.data.lines[RACK] * self._lead(values, "delay_rack")
        return gauge * v.steering_ratio / (v.pinion_ratio * values["n_t"]) - force, force

    def _body(self) -> tuple[Complexes, Complexes, Complexes]:
        lines = self.data.lines
        return lines[BODY[0]], lines[BODY[1]], lines[BODY[2]]

    def _forces(self, values: Values) -> tuple[Complexes, Complexes]:
        """Axle forces in N that the measured motion needs."""
        rate, a_y, _ = self._body()
        v = self.vehicle
        moment = values["J_z"] * 2j * np.pi * self.data.frequency * rate
        length = v.cg_to_front_axle + v.cg_to_rear_axle
        front = (v.cg_to_rear_axle * v.mass * a_y + moment) / length
        return front, v.mass * a_y - front

    def _relaxation(self, sigma: float) -> Complexes:
        lag: Complexes = 1.0 + 2j * np.pi * self.data.frequency * sigma / self.speed
        return lag

    def _lead(self, values: Values, name: str) -> Complexes:
        turn: Complexes = np.exp(2j * np.pi * self.data.frequency * values.get(name, 0.0))
        return turn


def can_balance(data: Spectra) -> bool:
    """Whether a recording has what the front and rear equations need."""
    return all(n in data.lines for n in (INSTRUMENT, ANGLE, *BODY))


def fit_lags(axles: Sequence[Axles]) -> Chain:
    """Lags of the inertial unit and, with a rack force, of the strain gauges behind the CAN bus; a new chain.

    At one speed a lag of the inertial unit and the front relaxation length look alike (both turn the phase by w times a
    time). Over several speeds they part, because a lag stays and sigma / v does not. So all speeds are fitted as one.
    """
    chain = _fit_band(axles, Chain({}), ["delay_imu"])
    return chain


def fit_axles(axles: Sequence[Axles], chain: Chain) -> Chain:
    """Fit sigma and J_z over the whole band, then C and n_t where the car is still steady; returns the chain.

    The second fit allows errors that grow with the square of frequency from the paper's 0.5 Hz on: load transfer and
    roll steer make C another at 2 Hz than at 0.2 Hz, and the reference is asked for its steady-state stiffness.
    """
    chain = _fit_band(axles, chain, [])
    slow = [e for a in axles for e in a.equations(chain.values, LOW_HZ)]
    names = [n for n in ("C_f", "C_r", "n_t") if n in chain.values]
    return chain.fit(_with_known(slow, chain), {n: chain.values[n] for n in names}, BOUNDS)


def _fit_band(axles: Sequence[Axles], chain: Chain, lags: list[str]) -> Chain:
    theory = axles[0].vehicle.yaw_inertia
    bounds = {**BOUNDS, "J_z": (theory * (1 - YAW_INERTIA_TOLERANCE), theory * (1 + YAW_INERTIA_TOLERANCE))}
    names = ["C_f", "C_r", "sigma_f", "sigma_r", "J_z"]
    if all(RACK in a.data.lines for a in axles):
        names.append("n_t")
        lags = [*lags, "delay_rack"] if lags else lags
    start = {n: {**START, "J_z": theory, **chain.values}[n] for n in names} | dict.fromkeys(lags, 0.0)
    chain.values.update(start)
    equations = [e for a in axles for e in a.equations(chain.values)]
    return chain.fit(_with_known(equations, chain), start, bounds)


def _with_known(equations: Sequence[Equation], chain: Chain) -> list[Equation]:
    """Leave the rack equations out where some speed has no rack force."""
    return [e for e in equations if "n_t" not in e.names or "n_t" in chain.values]
