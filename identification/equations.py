"""Linear equations between measured signals, tested with the instrument of Eq. 5.

Where all signals of an equation are measured, its parameters follow without simulating the rest of the car. With the
cross spectrum of the equation error and the steering torque made small, noise on any channel has no bias (instrumental
variables), and because the sum over runs and neighbouring lines is taken of the error itself, there is no averaging
error either: on data that obey the equation the error is zero line by line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.frf import (
    MIN_COHERENCE,
    NEIGHBOURS,
    Complexes,
    Floats,
    Spectra,
    coherence,
    groups,
    scatter,
    smoothed,
)
from identification.stages import Scores, Values

FLOOR = 0.01  # relative error that an averaged point is allowed beside its scatter


@dataclass(frozen=True)
class Equation:
    """One complex equation over frequency; a ``stages.Problem``.

    ``error`` maps parameter values to (error, scale), both spectra [n_runs, n_lines]; the residual is error over scale
    after averaging. ``start`` are values at which the scatter is judged. ``names`` are the parameters that matter,
    ``channels`` those whose coherence counts, ``key`` names the recording. The relative error allowed to a point is
    FLOOR (1 + (f / knee_Hz)^2): a finite knee says that the equation leaves out effects that grow with frequency.
    """

    data: Spectra
    instrument: str
    error: Callable[[Values], tuple[Complexes, Complexes]]
    channels: Sequence[str]
    names: Sequence[str]
    start: Values
    key: object
    knee_Hz: float = np.inf
    _keep: Floats = field(init=False, repr=False)
    _size: Floats = field(init=False, repr=False)
    _floor: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        D = groups(self.data.lines[self.instrument])
        gamma = np.min([coherence(D, groups(self.data.lines[c])) for c in self.channels], axis=0)
        object.__setattr__(self, "_keep", np.flatnonzero(gamma > MIN_COHERENCE))
        by_run = self._by_run(self.start)
        spread: Floats = np.zeros(by_run.shape[1])
        if by_run.shape[0] > 1:
            spread = smoothed(scatter(by_run - by_run.mean(axis=0)))
        frequency = self.data.frequency[NEIGHBOURS // 2 :: NEIGHBOURS][self._keep]
        floor = FLOOR * (1.0 + (frequency / self.knee_Hz) ** 2)
        object.__setattr__(self, "_floor", floor)
        object.__setattr__(self, "_size", np.sqrt(floor**2 + spread))

    @property
    def points(self) -> int:
        """Number of coherent averaged frequencies."""
        return int(self._keep.size)

    def uses(self, name: str) -> bool:
        """Whether a parameter enters the equation."""
        return name in self.names

    def residual(self, values: Values) -> Floats:
        """[2 n]: real parts, then imaginary parts."""
        error = self._by_run(values).sum(axis=0) / self._size
        return np.concatenate([error.real, error.imag])

    def scores(self, jacobian: Floats, values: Values) -> Scores:
        """One cluster per run and frequency point for noise, and one per point for what the equation leaves out.

        The allowed relative error is counted as a real one, half of its power in each part of the complex number.
        Otherwise long records would promise a precision that no model of a car has.
        """
        error = self._by_run(values)
        error = (error - error.mean(axis=0)) / self._size
        runs, n = error.shape
        inflate = np.sqrt(runs / max(runs - 1.0, 1.0))
        found: Scores = {
            (self.key, run, int(self._keep[k])): inflate
            * (error[run, k].real * jacobian[k] + error[run, k].imag * jacobian[n + k])
            for run in range(runs)
            for k in range(n)
        }
        left_out = self._floor / self._size / np.sqrt(2.0)
        for k in range(n):
            found[(self.key, "real", self.error.__name__, k)] = left_out[k] * jacobian[k]
            found[(self.key, "imaginary", self.error.__name__, k)] = left_out[k] * jacobian[n + k]
        return found

    def _by_run(self, values: Values) -> Complexes:
        """Share of each run in the relative equation error, [n_runs, n_kept]."""
        error, scale = self.error(values)
        D = np.conj(self.data.lines[self.instrument])
        total = np.abs(groups(D * scale).sum(axis=(0, 2)))[self._keep]
        by_run: Complexes = groups(D * error).sum(axis=2)[:, self._keep] / total
        return by_run
