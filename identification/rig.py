"""Kind "rig": inertia, damping, friction and delay of what is on a motor, from its angle and its commanded torque.

    torque(t - delay) - sensor = J q'' + b q' + M_fric(q; M_C, c_fric) + offset

with the rate-independent Dahl friction (Eq. 15, exact). Written as torque - sensor = ... + delay d(torque)/dt all but
the friction's travel M_C / c_fric is linear; that is searched. All signals pass the same zero-phase band limit, and
only moments in which the motor turns are fitted: at rest friction holds any torque within its level. The standard
errors are a jackknife's over time blocks (drive_fit.py), with Student's t of blocks - 1 for the intervals.

The delay counts from where the log puts a command to where it puts the motion. On a bus these lie apart by a part of
the control period, so below one period it says as much of the log as of the motor.

Without a torque sensor J, b and friction are those of rotor and wheel together, and all of them in the drive's own N m:
a drive that gives 5 % more than it is told has an inertia that is 5 % too small here, and nothing tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from identification import drive_fit
from identification.campaign import Campaign, Run, require
from identification.channels import FloatArray
from identification.drive_fit import TRAVELS, Blocks, Estimate
from identification.drive_signals import dahl_shape
from identification.gap.repeats import SETTLE_S
from identification.gap.rig_model import ANGLE, NARROWEST_HZ, SENSOR, TORQUE, motion, start_values, usable_band
from identification.motion import band_limited
from steer_env.errors import InputError

TERMS = ("inertia_kgm2", "damping_Nms_per_rad", "friction_level_Nm", "offset_Nm", "delay_s")
FRICTION, DELAY = TERMS.index("friction_level_Nm"), TERMS.index("delay_s")
SLIDING_RATE = 0.05  # rad/s
BLOCK_S = 4.0  # of the jackknife
MIN_SLIDING = 10.0  # s of turning in the whole campaign


class RigFit:
    """Parameters of a bench with standard errors.

    Attributes after ``fit``:
        params_, std_, interval_: values, standard errors, 95 % intervals (low, high) by name: ``TERMS`` and
            friction_stiffness_Nm_per_rad.
        band_Hz_: frequency up to which the measured motion is used.
        held_out_: rms error in N m over runs that were held out (else over left-out blocks), of the model and without
            its friction, and the rms of the torque itself.
        notes_: what a reader of the numbers must know.
    """

    def fit(self, campaign: Campaign) -> RigFit:
        """Fit the runs with role "identify" and return self; InputError where they do not hold enough."""
        for run in campaign.runs:
            require(run, [ANGLE, TORQUE], "identification of a rig")
        fitted = [run for run in campaign.runs if run.role == "identify"]
        J, _ = start_values(fitted, NARROWEST_HZ)
        self.band_Hz_ = usable_band(fitted, J)
        grams, samples = self._grams(fitted)
        self._check_enough(samples, fitted, campaign)
        blocks = Blocks(grams, np.zeros((len(TERMS), len(TERMS))), samples)
        fit = drive_fit.estimate(blocks, np.ones(samples.size, bool), 0.0)
        self.notes_ = [f"{run.name}: {note}" for run in campaign.runs for note in run.notes]
        self._set_parameters(fit, drive_fit.jackknife(blocks, 0.0), fitted[0].dt)
        self.travel_ = fit.travel
        held = [run for run in campaign.runs if run.role == "validate"]
        self.held_out_ = self._held_out(blocks, fit, held)
        return self

    def components(self, run: Run) -> dict[str, FloatArray]:
        """Parts of the torque along a run, each [n] in N m, their sum ``model``, ``measured``, time, ``sliding``."""
        table, torque, sliding = self._table(run, self.travel_)
        theta = np.array([self.params_[name] for name in TERMS])
        theta[DELAY] += 0.5 * run.dt
        names = ("inertia", "damping", "friction", "offset", "delay")
        parts = {name: theta[k] * table[:, k] for k, name in enumerate(names)}
        parts["model"] = table @ theta
        return {**parts, "measured": torque, "time": run.time - run.time[0], "sliding": sliding}

    def document(self, campaign: Campaign) -> dict[str, Any]:
        """Return the result as a table for a JSON file."""
        parameters = {
            name: {"value": self.params_[name], "std": self.std_[name], "ci95": list(self.interval_[name])}
            for name in self.params_
        }
        return {
            "schema_version": 1,
            "kind": "rig",
            "campaign": campaign.name,
            "files": campaign.hashes,
            "parameters": parameters,
            "band_Hz": self.band_Hz_,
            "held_out_rms_Nm": self.held_out_,
            "notes": self.notes_,
        }

    def _table(self, run: Run, travel: float) -> tuple[FloatArray, FloatArray, np.ndarray]:
        """Regressors [n, terms], torque [n], and which samples [n] count."""
        angle, rate, acceleration = motion(run.channels[ANGLE], run.dt, self.band_Hz_)
        command = band_limited(run.channels[TORQUE], run.dt, self.band_Hz_)
        friction = band_limited(dahl_shape(run.channels[ANGLE], travel), run.dt, self.band_Hz_).signal()
        regressors = [acceleration, rate, friction, np.ones_like(rate), command.rate().signal()]
        table: FloatArray = np.column_stack(regressors).astype(float)
        torque = np.asarray(command.signal(), dtype=np.float64)
        if SENSOR in run.channels:
            torque -= band_limited(run.channels[SENSOR], run.dt, self.band_Hz_).signal()
        margin = min(round(SETTLE_S / run.dt), angle.size // 5)  # what lies beyond an end of the log is not known
        counts: np.ndarray = np.abs(rate) > SLIDING_RATE
        counts[:margin] = counts[angle.size - margin :] = False
        return table, torque, counts

    def _grams(self, runs: Sequence[Run]) -> tuple[FloatArray, FloatArray]:
        """Gram matrices [travels, blocks, p + 1, p + 1] of the sliding samples, and samples [blocks]."""
        grams: list[FloatArray] = []
        samples: list[float] = []
        for run in runs:
            base, torque, counts = self._table(run, float(TRAVELS[0]))
            every = max(1, int(0.25 / (self.band_Hz_ * run.dt)))  # neighbours tell the same
            counts &= np.arange(counts.size) % every == 0
            shapes = [
                band_limited(dahl_shape(run.channels[ANGLE], travel), run.dt, self.band_Hz_).signal()
                for travel in TRAVELS
            ]
            number = ((run.time - run.time[0]) // BLOCK_S).astype(int)
            for block in np.unique(number[counts]):
                inside = counts & (number == block)
                table = np.column_stack([base, torque])[inside]
                stack = np.empty((len(TRAVELS), len(TERMS) + 1, len(TERMS) + 1))
                for k, shape in enumerate(shapes):
                    table[:, FRICTION] = shape[inside]
                    stack[k] = table.T @ table
                grams.append(stack)
                samples.append(float(inside.sum()))
        if not grams:
            return np.empty((len(TRAVELS), 0, len(TERMS) + 1, len(TERMS) + 1)), np.empty(0)
        return np.stack(grams, axis=1), np.array(samples)

    def _check_enough(self, samples: FloatArray, runs: Sequence[Run], campaign: Campaign) -> None:
        every = max(1, int(0.25 / (self.band_Hz_ * runs[0].dt)))
        seconds = float(samples.sum()) * every * runs[0].dt
        if seconds < MIN_SLIDING:
            raise InputError(
                f"{campaign.folder}: column '{ANGLE}'",
                f"the motor turns faster than {SLIDING_RATE:g} rad/s for only {seconds:.1f} s",
                f"record {MIN_SLIDING:g} s of turning to and fro ('steer-env rig excite')",
            )

    def _set_parameters(self, fit: Estimate, replicates: Sequence[Estimate], dt: float) -> None:
        values = self._named(fit, dt)
        t = float(stats.t.ppf(0.975, len(replicates) - 1))
        self.params_, self.std_, self.interval_ = values, {}, {}
        for name, value in values.items():
            error = float(drive_fit.standard_error(np.array([self._named(r, dt)[name] for r in replicates])))
            self.std_[name], self.interval_[name] = error, (value - t * error, value + t * error)
        if fit.index == 0:
            self.notes_.append("friction_stiffness_Nm_per_rad is a lower bound (the angle is too coarse)")

    @staticmethod
    def _named(fit: Estimate, dt: float) -> dict[str, float]:
        values = {name: float(fit.theta[k]) for k, name in enumerate(TERMS)}
        values["delay_s"] -= 0.5 * dt  # a command is held until the next one: half a sample late by nature
        values["friction_stiffness_Nm_per_rad"] = max(values["friction_level_Nm"], 1e-9) / fit.travel
        return values

    def _held_out(self, blocks: Blocks, fit: Estimate, held: Sequence[Run]) -> dict[str, float]:
        """Rms errors in N m; the model without friction is fitted anew."""
        smaller = np.arange(len(TERMS)) != FRICTION
        if not held:
            whole, rest = drive_fit.held_out(blocks, 0.0), drive_fit.held_out(blocks, 0.0, smaller)
            power = blocks.grams[0, :, -1, -1].sum() / blocks.samples.sum()
            return {"model": whole, "without friction": rest, "torque": float(np.sqrt(power))}
        grams, samples = self._grams(held)
        gram = grams[fit.index].sum(axis=0)
        total = max(float(samples.sum()), 1.0)
        keep = np.append(smaller, True)
        theta, _ = drive_fit.solve(blocks.grams[0].sum(axis=0)[np.ix_(keep, keep)], np.zeros((smaller.sum(),) * 2), 0.0)
        powers = {
            "model": drive_fit.residual(gram, fit.theta),
            "without friction": drive_fit.residual(gram[np.ix_(keep, keep)], theta),
            "torque": float(gram[-1, -1]),
        }
        return {name: float(np.sqrt(max(power, 0.0) / total)) for name, power in powers.items()}
