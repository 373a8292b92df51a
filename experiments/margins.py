"""Margins of a loop from its frequency response, negative feedback: 1 + L is what must not vanish.

    gain    the smallest factor on L, up or down, that brings it through -1
    phase   the smallest turn of L that does
    disk    alpha = 2 / max |S - T| with S = 1 / (1 + L) and T = 1 - S: gain and phase may change
            together, by factors from (2 - alpha) / (2 + alpha) to its inverse, or by
            2 atan(alpha / 2) (Seiler, Packard, Gahinet, IEEE Control Systems 40(5), 2020)
    delay   the smallest extra delay that does, looked for up to DELAY_LIMIT
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

GAIN_LIMIT_dB = 40.0  # what stands for a margin that no gain uses up
REAL = 0.01  # share of the imaginary part up to which the end of a response is real
DELAY_LIMIT = 6e-3  # s, the same for delays


class Margins(NamedTuple):
    """Of a loop that is stable; all are 0 where it is not. Limits: GAIN_LIMIT_dB, 180, 2, DELAY_LIMIT."""

    gain_margin_dB: float = 0.0
    phase_margin_deg: float = 0.0
    disk_margin: float = 0.0
    delay_margin_ms: float = 0.0


def margins(L: NDArray[np.complex128], omega: NDArray[np.float64]) -> Margins:
    """Margins of a stable loop with the response L [n] at rising omega [n] in rad/s.

    Between the points L is taken for straight (gain) and its phase for linear in log frequency.
    """
    phase = np.unwrap(np.angle(L))
    size = np.log(np.abs(L))
    cut = np.flatnonzero(np.signbit(size[:-1]) != np.signbit(size[1:]))
    share = size[cut] / (size[cut] - size[cut + 1])
    turned = phase[cut] + share * (phase[cut + 1] - phase[cut]) + math.pi
    at = omega[cut] ** (1.0 - share) * omega[cut + 1] ** share
    away = np.abs((turned + math.pi) % (2.0 * math.pi) - math.pi)
    delays = (turned % (2.0 * math.pi)) / at
    disk = 2.0 * np.abs(1.0 + L) / np.maximum(np.abs(1.0 - L), 1e-12)
    return Margins(
        gain_margin_dB=min(_gains(L), default=GAIN_LIMIT_dB),
        phase_margin_deg=float(np.degrees(away.min())) if cut.size else 180.0,
        disk_margin=min(float(disk.min()), 2.0),
        delay_margin_ms=1e3 * min(float(delays.min()) if cut.size else DELAY_LIMIT, DELAY_LIMIT),
    )


def _gains(L: NDArray[np.complex128]) -> list[float]:
    """|gain| in dB at which L passes through -1, within the limit: where it crosses the negative real axis."""
    im, re = L.imag, L.real
    cut = np.flatnonzero(np.signbit(im[:-1]) != np.signbit(im[1:]))
    share = im[cut] / (im[cut] - im[cut + 1])
    crossings = re[cut] + share * (re[cut + 1] - re[cut])
    # Where a response ends in a real number (no frequency, half the sampling frequency) that counts too.
    ends = [L[k].real for k in (0, -1) if abs(L[k].imag) < REAL * abs(L[k].real)]
    found = [abs(20.0 * math.log10(-x)) for x in (*crossings.tolist(), *ends) if x < 0.0]
    return [gain for gain in found if gain < GAIN_LIMIT_dB]


def disk_gain(alpha: float) -> tuple[float, float]:
    """(Least, largest) factor on the gain alone that a disk margin allows."""
    low = (2.0 - alpha) / (2.0 + alpha)
    return low, math.inf if low <= 0.0 else 1.0 / low


def disk_phase_deg(alpha: float) -> float:
    """Turn of the phase alone that a disk margin allows."""
    return 2.0 * math.degrees(math.atan(0.5 * alpha))
