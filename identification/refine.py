"""Past the paper: one joint time-domain fit of J_ref, b_ref, assist and friction per speed.

Step II reads Coulomb friction as damping and missing gain (M_C = 2.3 N m and a sweep of 0.1 rad at 105 km/h: k_gain
falls from 2.4 to 0.7 and b_ref / (1 + k_gain) doubles) and the assist curve as inertia and gain. Here sweep and slow
sine are fitted together in time, where rate, acceleration, displacement and amplitude vary apart from each other, so
each effect is told by its own signature. Steps I to III give the start.

Sweep and sine each have a Coulomb level of their own, because a control unit's friction compensation works on a
filtered rate and fades in a sweep: forced to be one, the levels would meet in between and b_ref would pay. The
reference takes the slow one, as the paper does; where they differ, that is worth knowing.

Standard errors use blocks of one second, within which errors may be coloured as they like.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification import forward
from identification.campaign import Run
from identification.forward import ForwardMisfit
from identification.frf import Floats
from identification.stages import Chain, Values
from identification.steady_state import BOUNDS as STEADY_BOUNDS
from identification.steady_state import assist_parameters
from identification.torque import TorqueMisfit
from steer_env.physics._jit import compiled
from steer_env.physics.assist import assist
from steer_env.plants.reference_row import KnownVehicle

TOLERANCE = 1e-7  # a ten thousandth of a standard error, at a third of the simulations
ROUGH = 1e-5  # for the fit that only sets the weights
SWEEP_FRICTION = "M_fric_C_sweep"
BOUNDS = {"J_ref": (0.002, 0.6), "b_ref": (-5.0, 10.0), **STEADY_BOUNDS, SWEEP_FRICTION: (0.0, 15.0)}
UNKNOWNS = ("J_ref", "b_ref", "r", "sigma_assist", "M_fric_C", "c_fric")
TERMS = frozenset({"inertia", "damping", "rack", "friction"})


@dataclass
class Refinement:
    """Joint fit at one speed in m/s. Fitted: ``params_``, ``std_``, ``chain_``, ``misfit_``.

    ``bar`` = (c_tb in N m/rad, b_tb in N m s/rad): the torque is simulated forward from the steering angle
    (``forward``). Without it, or without a steering angle, Eq. 16 is inverted at the measured pinion angle
    (``torque``).
    ``fit_c_fric=False`` keeps the preselected Dahl stiffness. ``weights`` of an earlier fit of the same runs (its
    ``weights_``) say that the chain starts from its solution, which saves finding both anew.
    """

    vehicle: KnownVehicle
    slip: str = "relaxed"
    bar: tuple[float, float] | None = None
    fit_c_fric: bool = True
    weights: dict[str, float] | None = None

    def fit(self, sweeps: Sequence[Run], sines: Sequence[Run], speed: float, chain: Chain) -> Refinement:
        """Fit all of UNKNOWNS from the values in ``chain``; returns self."""
        names = UNKNOWNS if self.fit_c_fric else UNKNOWNS[:-1]
        runs = [*sweeps, *sines]
        led = self.bar is not None and all(n in run.channels for run in runs for n in forward.NEEDS)
        misfit: ForwardMisfit | TorqueMisfit
        if led and self.bar is not None:
            misfit = ForwardMisfit(runs, speed, self.vehicle, self.slip, self.bar)
        else:
            misfit = TorqueMisfit(runs, speed, self.vehicle, self.slip, TERMS)
        start = {n: chain.values[n] for n in names}
        if sweeps and sines:
            start[SWEEP_FRICTION] = chain.values.get(SWEEP_FRICTION, chain.values["M_fric_C"])
        if self.weights is None:
            first = self._fit_from(start, misfit, chain)
            misfit.weights = manoeuvre_weights(misfit, first.values)
            start = {n: first.values[n] for n in start}
        else:
            misfit.weights = self.weights
        self.chain_ = chain.copy().fit([misfit], start, BOUNDS, TOLERANCE)
        self.weights_ = misfit.weights
        self.misfit_ = misfit
        values = self.chain_.values
        swept = np.concatenate([run.channels["torsion_bar_torque_Nm"] for run in sweeps])
        self.params_ = {
            "J_ref": values["J_ref"],
            "b_ref": values["b_ref"],
            "k_gain": equivalent_gain(swept, values["r"], values["sigma_assist"]),
            **assist_parameters(values),
            SWEEP_FRICTION: values.get(SWEEP_FRICTION, values["M_fric_C"]),
        }
        self.std_ = {n: e for n, e in self.chain_.std_.items() if n in BOUNDS}
        self.std_["k_gain"] = self.chain_.error_of(lambda v: equivalent_gain(swept, v["r"], v["sigma_assist"]))
        return self


    def _fit_from(self, start: dict[str, float], misfit: ForwardMisfit | TorqueMisfit, chain: Chain) -> Chain:
        """Fit from step III; a car without assist curve or friction is far from there, so from step II too if closer.

        A constant gain 1 + k_gain is the limit of Eq. 14 for a small sigma: r = 1 / (1 + k_gain).
        """
        found = chain.copy().fit([misfit], start, BOUNDS, ROUGH, final=False)
        linear = dict.fromkeys((n for n in (SWEEP_FRICTION, "M_fric_C") if n in start), 0.01)
        linear |= {"r": 1.0 / (1.0 + chain.values["k_gain"]), "sigma_assist": 0.1}
        linear = {**start, **linear, "J_ref": chain.values["J_ref"], "b_ref": chain.values["b_ref"]}
        if np.sum(misfit.residual({**chain.values, **linear}) ** 2) >= np.sum(misfit.residual(found.values) ** 2):
            return found
        return chain.copy().fit([misfit], linear, BOUNDS, ROUGH, final=False)


def manoeuvre_weights(misfit: ForwardMisfit | TorqueMisfit, values: Values) -> dict[str, float]:
    """One over the root mean square error of each manoeuvre, relative to their geometric mean.

    A sweep holds what the model leaves out at speed; without weights that error would bend the assist curve, which the
    slow sine knows far better.
    """
    squares: dict[str, list[float]] = {}
    parts = np.split(misfit.residual(values), np.cumsum(misfit.sizes(values))[:-1])
    for run, error in zip(misfit.runs, parts, strict=True):
        squares.setdefault(run.manoeuvre, []).append(float(np.mean(error**2)))
    rms = {name: float(np.sqrt(np.mean(found))) for name, found in squares.items()}
    middle = float(np.exp(np.mean(np.log(list(rms.values())))))
    return {name: middle / value for name, value in rms.items()}


def equivalent_gain(M_tb: Floats, r: float, sigma: float) -> float:
    """k_gain of the assist curve over the sweep: least-squares gain from M_tb to M_eff - M_tb (dimensionless).

    It is what a linear assist would need to come closest to the curve over the torques of the sweep, so it belongs to
    the sweep's amplitude, like the value of step II. M_eff = assist(M_tb), Eq. 14.
    """
    return float(M_tb @ (assisted(M_tb, r, sigma) - M_tb) / (M_tb @ M_tb))


@compiled
def assisted(M_tb: Floats, r: float, sigma: float) -> Floats:
    """M_eff [n] in N m (Eq. 14)."""
    out = np.zeros(M_tb.size)
    for k in range(M_tb.size):
        out[k] = assist(M_tb[k], r, sigma)
    return out
