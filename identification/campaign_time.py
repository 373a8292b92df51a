"""The time axis of a run: monotonic, without gaps, and made even where it jitters.

Jitter up to 20 % of the step is resampled (docs/formats.md, section 1) with a cubic spline: linear
interpolation would take up to (w dt)^2 / 8 of the amplitude, 1.2 % at 5 Hz and 100 Hz sampling.
"""

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from identification.channels import FloatArray
from steer_env.errors import InputError

JITTER_LIMIT = 0.20  # of the step, docs/formats.md
EVEN = 1e-3  # of the step: below this the time counts as even
STEP_RANGE = (1e-5, 0.1)  # s; assumption: 10 Hz is the least that shows steering dynamics
MIN_SAMPLES = 20


def check_time(time: FloatArray, row: Callable[[int], str]) -> float:
    """Return the step in s, after refusing time that runs backwards, has gaps or a wrong unit."""
    if len(time) < MIN_SAMPLES:
        raise InputError(
            f"{row(len(time) - 1)}: column 'time_s'",
            f"the run has {len(time)} samples",
            f"at least {MIN_SAMPLES} are needed; was the file cut off?",
        )
    steps = np.diff(time)
    late = np.flatnonzero(steps <= 0.0)
    if late.size:
        index = int(late[0]) + 1
        what = "stands still" if steps[index - 1] == 0.0 else "runs backwards"
        raise InputError(
            f"{row(index)}: column 'time_s'",
            f"time {what} here ({time[index]:.6g} s after {time[index - 1]:.6g} s)",
            "sort the samples and remove doubled ones, or split the run where the logger restarted",
        )
    step = float(np.median(steps))
    if not STEP_RANGE[0] <= step <= STEP_RANGE[1]:
        raise InputError(
            f"{row(0)}: column 'time_s'",
            f"the step is {step:.3g} s; steering needs {STEP_RANGE[0]:g} to {STEP_RANGE[1]:g} s",
            'check the unit of the time (map it in [channels], for example unit = "ms")',
        )
    uneven = np.flatnonzero(np.abs(steps - step) > JITTER_LIMIT * step)
    if uneven.size:
        index = int(uneven[0]) + 1
        gap = float(steps[index - 1])
        what = "there is a gap" if gap > 1.5 * step else "the time jitters too much"
        raise InputError(
            f"{row(index)}: column 'time_s'",
            f"{what}: a step of {gap:.6g} s where {step:.6g} s is usual ({uneven.size} places)",
            f"up to {JITTER_LIMIT:.0%} of the step is resampled; split the run here, or log again",
        )
    return step


def make_even(
    time: FloatArray, channels: dict[str, FloatArray], step: float
) -> tuple[FloatArray, dict[str, FloatArray], float, str]:
    """Return time and channels on an even grid, its step, and a note (empty if it was even)."""
    even_step = float(time[-1] - time[0]) / (len(time) - 1)
    worst = float(np.max(np.abs(np.diff(time) - even_step)))
    if worst <= EVEN * even_step:
        return time, channels, even_step, ""
    grid = time[0] + even_step * np.arange(len(time))
    grid[-1] = time[-1]
    even = {name: CubicSpline(time, values)(grid) for name, values in channels.items()}
    note = (
        f"time_s jitters by up to {worst / even_step:.1%} of the step of {even_step:.6g} s: "
        "all channels were resampled (cubic spline)"
    )
    return grid, even, even_step, note
