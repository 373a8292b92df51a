"""Kind "drive": what a log of steering angle, steering torque and speed alone can tell.

    steering_torque = c(v) angle + b rate + M_fric(angle; M_C, c_fric) + bias(t)

c(v) is linear between a few speeds, M_fric the rate-independent Dahl model (Eq. 15, exact), and the
bias (road crown, side wind, sensor) a random walk between knots, whose pace held-out data choose.
Only sliding samples are fitted (drive_signals.py says why); the standard errors are a jackknife's
over time blocks (drive_fit.py), with Student's t of blocks - 1 for the intervals.

Not modelled: inertia of the wheel, and that the torque may follow the road instead of leading it.
"""

from typing import Any

import numpy as np
from scipy import stats

from identification import drive_fit
from identification.campaign import Campaign, Run
from identification.channels import FloatArray
from identification.drive_blocks import bias_times, make_blocks, speed_knots
from identification.drive_fit import Blocks, Estimate
from identification.drive_signals import DriveSignals, dahl_shape, prepare
from steer_env.errors import InputError
from steer_env.units import to_kmh

MIN_SLIDING = 10.0  # s of sliding in the whole campaign


class DriveModel:
    """Torque of a steering wheel over angle, rate and speed, with standard errors.

    Args:
        speed_knots: number of speeds between which c(v) is linear.
        bias_step: s between knots of the bias (longer for very long campaigns).
        block: s of one block of the jackknife; longer than residuals stay coloured.
        cutoff_Hz: of the zero-phase low-pass before the fit.
        sliding_rate: rad/s above which the wheel counts as sliding; two steps of a 0.1 deg angle
            sensor in 0.1 s.

    Attributes after ``fit``:
        params_, std_, interval_: values, standard errors, 95 % intervals (low, high), by name:
            stiffness_Nm_per_rad [k] at speeds_, damping_Nms_per_rad, friction_level_Nm,
            friction_stiffness_Nm_per_rad.
        speeds_: [k] m/s.
        bias_: per run (time [m] s, bias [m] N m).
        held_out_: rms error in N m on left-out blocks, of the model and of smaller ones, and the
            rms of the torque itself.
        rest_: 95 % quantile in N m of what friction held at rest; compare friction_level_Nm.
        notes_: what a reader of the numbers must know.
    """

    def __init__(
        self,
        speed_knots: int = 4,
        bias_step: float = 10.0,
        block: float = 5.0,
        cutoff_Hz: float = 5.0,
        sliding_rate: float = 0.04,
    ) -> None:
        self.speed_knots = speed_knots
        self.bias_step = bias_step
        self.block = block
        self.cutoff_Hz = cutoff_Hz
        self.sliding_rate = sliding_rate

    def fit(self, campaign: Campaign) -> "DriveModel":
        """Fit the runs with role "identify" and return self."""
        runs = [run for run in campaign.runs if run.role == "identify"]
        signals = [prepare(run, self.cutoff_Hz, self.sliding_rate) for run in runs]
        self._check_enough(runs, signals, campaign)
        self.notes_ = [f"{run.name}: {note}" for run in runs for note in run.notes]
        self.speeds_ = speed_knots(signals, self.speed_knots)
        times = bias_times(signals, self.bias_step)
        blocks = make_blocks(signals, self.speeds_, times, self.block)
        self.penalty_ = drive_fit.best_penalty(blocks)
        fit = drive_fit.estimate(blocks, np.ones(len(blocks.samples), bool), self.penalty_)
        self.travel_ = fit.travel
        ends = np.cumsum([len(self.speeds_) + 2, *(len(knots) for knots in times)])
        self.bias_ = {
            run.name: (knots, fit.theta[start:end])
            for run, knots, start, end in zip(runs, times, ends[:-1], ends[1:], strict=True)
        }
        self._set_parameters(fit, drive_fit.jackknife(blocks, self.penalty_))
        self.held_out_ = _held_out(blocks, self.penalty_, len(self.speeds_))
        self.residual_rms_ = float(np.sqrt(fit.rss / blocks.samples.sum()))
        self.rest_ = self._held_at_rest(runs)
        return self

    def components(self, run: Run) -> dict[str, FloatArray]:
        """Return the parts of the torque along a fitted run, each [n] in N m, and their sum.

        ``measured`` is the filtered torque they are to be compared with; ``sliding`` [n] bool.
        """
        signals = prepare(run, self.cutoff_Hz, self.sliding_rate)
        stiffness = np.interp(signals.speed, self.speeds_, self.params_["stiffness_Nm_per_rad"])
        parts = {
            "stiffness": stiffness * signals.angle,
            "damping": self.params_["damping_Nms_per_rad"] * signals.rate,
            "friction": self.params_["friction_level_Nm"] * dahl_shape(signals.angle, self.travel_),
            "bias": np.interp(signals.time, *self.bias_[run.name]),
        }
        parts["model"] = np.sum(list(parts.values()), axis=0)
        rest = {"measured": signals.torque, "angle": signals.angle, "speed": signals.speed}
        return {**parts, **rest, "time": signals.time, "sliding": signals.sliding}

    def document(self, campaign: Campaign) -> dict[str, Any]:
        """Return the result as a table for a JSON file."""
        names = self.params_
        return {
            "schema_version": 1,
            "kind": "drive",
            "campaign": campaign.name,
            "files": campaign.hashes,
            "speed_kmh": [to_kmh(float(speed)) for speed in self.speeds_],
            "parameters": {
                name: {
                    "value": np.asarray(self.params_[name]).tolist(),
                    "std": np.asarray(self.std_[name]).tolist(),
                    "ci95": np.asarray(self.interval_[name]).T.tolist(),
                }
                for name in names
            },
            "held_out_rms_Nm": self.held_out_,
            "rest_quantile95_Nm": self.rest_,
            "notes": self.notes_,
        }

    def _check_enough(
        self, runs: list[Run], signals: list[DriveSignals], campaign: Campaign
    ) -> None:
        seconds = sum(
            float(np.count_nonzero(s.sliding)) * run.dt
            for run, s in zip(runs, signals, strict=True)
        )
        if seconds < MIN_SLIDING:
            raise InputError(
                f"{campaign.folder}: column 'steering_angle_rad'",
                f"the wheel turns faster than {self.sliding_rate:g} rad/s for only {seconds:.1f} s",
                f"friction needs {MIN_SLIDING:g} s of turning: log a longer or livelier drive",
            )

    def _set_parameters(self, fit: Estimate, replicates: list[Estimate]) -> None:
        values = self._named(fit)
        spread = [self._named(replicate) for replicate in replicates]
        t = float(stats.t.ppf(0.975, len(replicates) - 1))
        self.params_, self.std_, self.interval_ = {}, {}, {}
        for name, value in values.items():
            column = np.array([entry[name] for entry in spread])
            if name == "friction_stiffness_Nm_per_rad":  # positive, over decades: on a log scale
                error = drive_fit.standard_error(np.log(np.maximum(column, 1e-9)))
                interval = value * np.exp(-t * error), value * np.exp(t * error)
                error = value * error
            else:
                error = drive_fit.standard_error(column)
                interval = value - t * error, value + t * error
            self.params_[name], self.std_[name], self.interval_[name] = value, error, interval
        if fit.index == 0:
            self.notes_.append("friction_stiffness_Nm_per_rad is a lower bound (angle too coarse)")

    def _named(self, fit: Estimate) -> dict[str, Any]:
        k = len(self.speeds_)
        level = float(fit.theta[k + 1])
        return {
            "stiffness_Nm_per_rad": fit.theta[:k],
            "damping_Nms_per_rad": float(fit.theta[k]),
            "friction_level_Nm": level,
            "friction_stiffness_Nm_per_rad": max(level, 1e-9) / fit.travel,
        }

    def _held_at_rest(self, runs: list[Run]) -> float:
        """Return the 95 % quantile in N m of the torque that friction held while nothing moved."""
        held = []
        for run in runs:
            parts = self.components(run)
            still = np.abs(np.gradient(parts["angle"], run.dt)) < 0.25 * self.sliding_rate
            friction = parts["measured"] - parts["model"] + parts["friction"]
            held.append(np.abs(friction[still]))
        everything = np.concatenate(held)
        return float(np.quantile(everything, 0.95)) if everything.size else float("nan")


def _held_out(blocks: Blocks, penalty: float, speeds: int) -> dict[str, float]:
    """Score the model, and smaller ones, on blocks that their fit did not see (rms in N m)."""
    count = len(blocks.roughness)
    friction = np.arange(count) == speeds + 1
    bias = np.arange(count) >= speeds + 2
    return {
        "model": drive_fit.held_out(blocks, penalty),
        "without friction": drive_fit.held_out(blocks, penalty, ~friction),
        "bias alone": drive_fit.held_out(blocks, penalty, bias),
    }
