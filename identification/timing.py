"""Lag of the torsion-bar signal behind the pinion angle, from the bar itself.

M_tb = (c_tb + b_tb s)(delta_s - delta_pin) holds at every instant, with known c_tb and b_tb. If the logged torque lags
the logged pinion angle by delay_bar, and the logged steering angle by delay_steering, both show as a turn of phase.
This matters for damping: at a rack stiffness of 40 N m/rad, 5 ms of unnoticed lag read as 0.2 N m s/rad of b_ref.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from identification.frf import NEIGHBOURS, Complexes, Floats, Spectra
from identification.stages import Chain, Scores, Values

BOUNDS = {"delay_bar": (-0.05, 0.05), "delay_steering": (-0.05, 0.05)}  # s, a few CAN frames
NEEDS = ("steering_angle_rad", "pinion_angle_rad", "torsion_bar_torque_Nm", "steering_torque_Nm")
_FLOOR = 0.01  # relative error that an averaged point is allowed beside its scatter


@dataclass(frozen=True)
class BarEquation:
    """The bar's equation at averaged frequencies, with the steering torque as instrument; a ``stages.Problem``.

    ``key`` names the recording; stiffness in N m/rad, damping in N m s/rad.
    """

    data: Spectra
    stiffness: float
    damping: float
    key: object
    _size: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        error = self._by_run({"delay_bar": 0.0, "delay_steering": 0.0})
        scatter = np.abs(error - error.mean(axis=0)).std(axis=0) if error.shape[0] > 1 else 0.0
        object.__setattr__(self, "_size", np.hypot(_FLOOR, scatter))

    def uses(self, name: str) -> bool:
        """Only the two lags."""
        return name in BOUNDS

    def residual(self, values: Values) -> Floats:
        """[2 n]: real parts, then imaginary parts, relative to the measured torque."""
        error = self._by_run(values).sum(axis=0) / self._size
        return np.concatenate([error.real, error.imag])

    def scores(self, jacobian: Floats, values: Values) -> Scores:
        """One cluster per run and frequency point."""
        error = self._by_run(values)
        error = (error - error.mean(axis=0)) / self._size
        runs, n = error.shape
        inflate = np.sqrt(runs / max(runs - 1.0, 1.0))
        return {
            (self.key, run, k): inflate
            * (error[run, k].real * jacobian[k] + error[run, k].imag * jacobian[n + k])
            for run in range(runs)
            for k in range(n)
        }

    def _by_run(self, values: Values) -> Complexes:
        """Share of each run [n_runs, n] in the relative error of the bar's equation."""
        lines, f = self.data.lines, self.data.frequency
        turn: Callable[[str], Complexes] = lambda name: np.exp(2j * np.pi * f * values[name])  # noqa: E731
        twist = lines["steering_angle_rad"] * turn("delay_steering") - lines["pinion_angle_rad"]
        M_tb = lines["torsion_bar_torque_Nm"] * turn("delay_bar")
        error = M_tb - (self.stiffness + 2j * np.pi * f * self.damping) * twist
        D = np.conj(lines["steering_torque_Nm"])
        cross = _sum_lines(D * error)
        total: Complexes = np.abs(_sum_lines(D * M_tb).sum(axis=0))
        return cross / total


def identify_timing(data: Spectra, stiffness: float, damping: float, key: object, chain: Chain) -> Chain:
    """Fit delay_bar and delay_steering in s as a stage of ``chain``; returns the chain."""
    return chain.fit([BarEquation(data, stiffness, damping, key)], dict.fromkeys(BOUNDS, 0.0), BOUNDS)


def _sum_lines(lines: Complexes) -> Complexes:
    """[n_runs, n_lines] summed over groups of neighbouring lines."""
    n = lines.shape[1] // NEIGHBOURS
    grouped: Complexes = lines[:, : n * NEIGHBOURS].reshape(lines.shape[0], n, NEIGHBOURS).sum(axis=2)
    return grouped
