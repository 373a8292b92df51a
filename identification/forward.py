"""Reference and torsion bar simulated forward, led by the measured steering angle (output error).

    J_ref d'' + b_ref d' + M_rack + M_fric(d) = M_eff(M_tb),   M_tb = c_tb (delta_s - d) + b_tb (delta_s' - d')

Inverting Eq. 16 needs the measured pinion angle twice differentiated, whose noise then passes the curved assist and the
friction: with a band wide enough for the harmonics of friction it biases them, with a narrow one the harmonics are
missing. Here the simulation makes its own motion, so nothing is differentiated but the robot's fine angle (once, times
the small b_tb), and noise ends where it should, in the residual. Needs the steering angle and the bar's c_tb and b_tb.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.campaign import Run
from identification.frf import Floats
from identification.motion import BandLimited, band_filter, band_limited
from identification.stages import Scores, Values
from identification.torque import (
    SETTLE_S,
    THIN,
    VEHICLE_PARAMETERS,
    block_scores,
    friction_of,
    rack_torque,
)
from steer_env.physics._jit import compiled
from steer_env.physics.assist import assist
from steer_env.physics.friction import dahl_step
from steer_env.plants.reference_row import KnownVehicle

NEEDS = ("steering_angle_rad", "torsion_bar_torque_Nm")
INPUT_HZ = 38.0  # band of the inputs, to what 100 Hz sampling holds
FINE = 6  # input points per sample; the integration takes every second one as its step, those between as midpoints


@compiled
def simulated_torque(
    steer: Floats, steer_rate: Floats, rack: Floats, h: float, keep: int, J: float, b: float, r: float, sigma: float,
    M_C: float, c_fric: float, c_tb: float, b_tb: float,
) -> Floats:  # fmt: skip
    """Torsion-bar torque in N m every ``keep`` steps of h seconds; inputs in rad, rad/s, N m at steps and midpoints.

    Classical Runge-Kutta; friction takes its exact Dahl value at each stage's own displacement. The four stages are a
    loop and not four copies, which compiles four times faster and runs the same.
    """
    steps = (steer.size - 1) // 2
    out = np.zeros(steps // keep + 1)
    angle, rate, friction = steer[0], 0.0, 0.0
    for k in range(steps):
        step = push = slope_x = slope_v = 0.0
        for stage in range(4):
            i = 2 * k + (stage + 1) // 2
            reach = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            weight = 1.0 if stage in (0, 3) else 2.0
            x, v = angle + reach * slope_x, rate + reach * slope_v
            M = c_tb * (steer[i] - x) + b_tb * (steer_rate[i] - v)
            if stage == 0 and k % keep == 0:
                out[k // keep] = M
            resist = dahl_step(friction, x - angle, M_C, c_fric) + b * v + rack[i]
            slope_x, slope_v = v, (assist(M, r, sigma) - resist) / J
            step += weight * slope_x
            push += weight * slope_v
        friction = dahl_step(friction, h / 6.0 * step, M_C, c_fric)
        angle += h / 6.0 * step
        rate += h / 6.0 * push
    if steps % keep == 0:
        out[steps // keep] = c_tb * (steer[-1] - angle) + b_tb * (steer_rate[-1] - rate)
    return out


@dataclass(frozen=True)
class Inputs:
    """One run: steering angle, rate and rack torque at FINE points per sample, torque [n] and kept samples."""

    steer: Floats
    steer_rate: Floats
    rack: Floats
    M_tb: Floats
    keep: slice


@dataclass
class ForwardMisfit:
    """Error of the simulated torsion-bar torque over the runs of one speed in m/s; a ``stages.Problem``.

    ``bar`` is (c_tb in N m/rad, b_tb in N m s/rad); ``weights`` multiply the errors of a manoeuvre. The mean error of
    each run is taken out, and both torques pass the same zero-phase band limit.
    """

    runs: Sequence[Run]
    speed: float
    vehicle: KnownVehicle
    slip: str
    bar: tuple[float, float]
    weights: dict[str, float] = field(default_factory=dict)
    _signals: list[dict[str, BandLimited]] = field(init=False, repr=False)
    _inputs: tuple[tuple[float, ...], list[Inputs]] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        names = (*NEEDS, "pinion_angle_rad", "rack_force_N")
        self._signals = [
            {n: band_limited(run.channels[n], run.dt, INPUT_HZ) for n in names if n in run.channels}
            for run in self.runs
        ]
        self._filters = [band_filter(run.channels[NEEDS[0]].size, run.dt) for run in self.runs]

    def uses(self, name: str) -> bool:
        """A measured rack force leaves the vehicle's parameters out of it."""
        modelled = any("rack_force_N" not in signals for signals in self._signals) or self.slip == "kinematic"
        return name not in VEHICLE_PARAMETERS or modelled

    def residual(self, values: Values) -> Floats:
        """[sum of kept samples] in N m: measured minus simulated, every THIN-th sample."""
        parts = []
        for run, inputs, kernel in zip(self.runs, self.inputs(values), self._filters, strict=True):
            error = inputs.M_tb - self.simulate(inputs, run.dt, friction_of(run, values))
            kept = kernel(error)[inputs.keep][::THIN]
            parts.append((kept - kept.mean()) * self.weights.get(run.manoeuvre, 1.0))
        return np.concatenate(parts)

    def simulate(self, inputs: Inputs, dt: float, values: Values) -> Floats:
        """Simulated torque [n] in N m."""
        torque: Floats = simulated_torque(
            inputs.steer, inputs.steer_rate, inputs.rack, 2.0 * dt / FINE, FINE // 2,
            values["J_ref"], values["b_ref"], values["r"], values["sigma_assist"], values["M_fric_C"],
            values["c_fric"], *self.bar,
        )  # fmt: skip
        return torque

    def scores(self, jacobian: Floats, values: Values) -> Scores:
        """One cluster per block of a run."""
        return block_scores(self.residual(values), jacobian, self.sizes(values), self.runs, self.speed)

    def sizes(self, values: Values) -> list[int]:
        """Kept samples of each run."""
        return [i.M_tb[i.keep][::THIN].size for i in self.inputs(values)]

    def inputs(self, values: Values) -> list[Inputs]:
        """The runs shifted by the lags in ``values``; kept until those change."""
        keys = ("delay_bar", "delay_steering", "delay_rack", "C_f", "C_r", "n_t", "sigma_f", "sigma_r", "J_z")
        now = tuple(values.get(k, 0.0) for k in keys)
        if self._inputs is None or self._inputs[0] != now:
            made = [self._prepare(r, s, values) for r, s in zip(self.runs, self._signals, strict=True)]
            self._inputs = (now, made)
        return self._inputs[1]

    def _prepare(self, run: Run, signals: dict[str, BandLimited], values: Values) -> Inputs:
        steer = signals["steering_angle_rad"].shifted(values.get("delay_steering", 0.0))
        rack = rack_torque(signals, values, self.vehicle, self.slip, self.speed)
        margin = round(SETTLE_S / run.dt)
        return Inputs(
            steer=steer.fine(FINE),
            steer_rate=steer.rate().fine(FINE),
            rack=rack.fine(FINE),
            M_tb=signals["torsion_bar_torque_Nm"].shifted(values.get("delay_bar", 0.0)).signal(),
            keep=slice(margin, steer.n - margin),
        )
