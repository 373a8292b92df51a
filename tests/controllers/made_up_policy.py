"""Policies with drawn weights, for tests: nothing was learned, everything else is as in a trained one."""

import numpy as np

from controllers.policy_file import N_SIGNALS, Policy


def made_up(plant="EPAS", causality="impedance", base="pid", size=1.0, seed=0, **changed):
    """A policy whose weights are normal with the given size (0: it does nothing)."""
    rng = np.random.default_rng(seed)
    scales = (0.3, 0.5, 2.0, 30.0, 2.0, 2.0, 100.0, 100.0, 7.0, 1.0, 0.3, 5.0, 1.0, 0.5, 0.5, 0.5, 0.5)
    n, m = 6, 5
    values = {
        "plant": plant,
        "causality": causality,
        "base": base,
        "base_gains": {},
        "authority": 0.02,
        "shares": ((5.0, 0.5), (10.0, 1.0)),
        "sample_time": 5e-3,
        "bandwidth_Hz": 20.0,
        "squashed": False,
        "scales": scales,
        "keep": 0.98,
        "mean_speed": 17.0,
        "speed_scale": 8.0,
        "slope_limit": 4.0,
        "history": 4,
        "training": {"seed": seed},
        "weights": {
            "first": size * rng.standard_normal((2 * N_SIGNALS, n)) / 6.0,
            "second": size * rng.standard_normal((n, m)),
            "last": size * rng.standard_normal(m),
        },
    }
    return Policy(**{**values, **changed})
