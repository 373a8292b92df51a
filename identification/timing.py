"""Lag of the torsion-bar signal behind the pinion angle, from the bar itself.

M_tb = (c_tb + b_tb s)(delta_s - delta_pin) holds at every instant, with known c_tb and b_tb. If the logged torque lags
the logged pinion angle by delay_bar, and the logged steering angle by delay_steering, both show as a turn of phase.
This matters for damping: at a rack stiffness of 40 N m/rad, 5 ms of unnoticed lag read as 0.2 N m s/rad of b_ref.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.equations import Equation
from identification.frf import Complexes, Spectra
from identification.stages import Chain, Values

BOUNDS = {"delay_bar": (-0.05, 0.05), "delay_steering": (-0.05, 0.05)}  # s, a few CAN frames
STEER, ANGLE, TORQUE = "steering_angle_rad", "pinion_angle_rad", "torsion_bar_torque_Nm"
INSTRUMENT = "steering_torque_Nm"
NEEDS = (STEER, ANGLE, TORQUE, INSTRUMENT)


@dataclass(frozen=True)
class Bar:
    """The torsion bar of one recording; stiffness in N m/rad, damping in N m s/rad."""

    data: Spectra
    stiffness: float
    damping: float

    def error(self, values: Values) -> tuple[Complexes, Complexes]:
        """Measured torque minus that of the measured twist, over the measured torque."""
        lines, s = self.data.lines, 2j * np.pi * self.data.frequency
        twist = lines[STEER] * np.exp(s * values["delay_steering"]) - lines[ANGLE]
        M_tb = lines[TORQUE] * np.exp(s * values["delay_bar"])
        return M_tb - (self.stiffness + s * self.damping) * twist, M_tb


def identify_timing(data: Spectra, stiffness: float, damping: float, key: object, chain: Chain) -> Chain:
    """Fit delay_bar and delay_steering in s as a stage of ``chain``; returns the chain."""
    start = dict.fromkeys(BOUNDS, 0.0)
    bar = Bar(data, stiffness, damping)
    equation = Equation(data, INSTRUMENT, bar.error, NEEDS[:3], tuple(BOUNDS), start, key)
    return chain.fit([equation], start, BOUNDS)
