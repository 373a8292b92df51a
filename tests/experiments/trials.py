"""Trials whose signals are known, and the signals to put into them."""

import numpy as np

from experiments.metrics import Trial
from experiments.rollout import Episode
from steer_env.envs.layout import PARAMETERS, PERIOD, Truth
from steer_env.envs.task import Task, prepare
from steer_env.physics import linear as linear_physics
from steer_env.physics.reference import ReferenceParameters


def trial(manoeuvre, causality="impedance", linear=False, parameters=None, **signals):
    """A trial at 75 km/h on EPAS whose signals are given; the others are zero.

    parameters: fields of the manoeuvre's record to replace.
    """
    task = Task("EPAS", causality, linear=linear, manoeuvre=manoeuvre, speed_kmh=75.0)
    setup = prepare(task, np.random.default_rng(0), PERIOD)
    if parameters:
        driven = PARAMETERS.read(setup.row, "manoeuvre")._replace(**parameters)
        setup.row[PARAMETERS["manoeuvre"]] = driven
    n = max(len(values) for values in signals.values())
    rows = np.zeros((n, len(Truth._fields)))
    rows[:, Truth._fields.index("speed")] = 75.0 / 3.6
    for name, values in signals.items():
        rows[:, Truth._fields.index(name)] = values
    return Trial(Episode(setup, rows, True), causality, linear, manoeuvre)


def sine(seconds=20.5, lead_in=0.5, frequency=0.2):
    """(Sine of amplitude 1 after the lead-in, time since then in s)."""
    t = PERIOD * np.arange(1, round(seconds / PERIOD) + 1) - lead_in
    return np.where(t > 0.0, np.sin(2.0 * np.pi * frequency * t), 0.0), t


def chirp(seconds=19.0, band=(0.2, 5.0)):
    """Chirp in 17.5 s after half a second, at rest at both ends."""
    t = PERIOD * np.arange(1, round(seconds / PERIOD) + 1) - 0.5
    inside = (t > 0.0) & (t < 17.5)
    return np.where(inside, np.sin(2.0 * np.pi * (band[0] + 0.5 * (band[1] - band[0]) / 17.5 * t) * t), 0.0)


def answered(torque, gain=1.0, delay=0.0):
    """Angle of the linear reference at 75 km/h under a torque, by its lines; scaled and late."""
    setup = prepare(Task(linear=True, speed_kmh=75.0), np.random.default_rng(0), PERIOD)
    p: ReferenceParameters = setup.reference.at(75.0 / 3.6)
    padded = np.concatenate([torque, np.zeros(60000 - len(torque))])
    f = np.fft.rfftfreq(len(padded), PERIOD)
    matrices = linear_physics.reference_matrices(75.0 / 3.6, p, 1.0 + p.k_gain)
    H = linear_physics.frequency_response(matrices, f)[:, 0, 0]
    lines = np.fft.rfft(padded) * gain * H * np.exp(-2j * np.pi * f * delay)
    return np.fft.irfft(lines, len(padded))[: len(torque)]
