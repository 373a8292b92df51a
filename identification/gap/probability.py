"""How probable it is that a named effect is the right one: calibrated on blind campaigns."""

from __future__ import annotations

import math

from identification.gap.verdict import Judged

# Logistic in the share put right and the log of held-out z; the numbers were set on the tuning seeds of
# ``experiments.gap_study``, whose report shows on other seeds how far claimed probabilities come true.
INTERCEPT, PUT_RIGHT, LOG_Z = -6.0, 6.0, 1.5
LEAST_Z = 2.0  # as the rules ask for


def probability(step: Judged, kind: str) -> float:
    """Probability in [0, 1] that an accepted candidate's name is right.

    Of a drive, whose torque holds what the road does, only that its held-out gain is no chance: it is not calibrated.
    """
    if kind == "drive":
        return 0.5 * (1.0 + math.erf((step.z - LEAST_Z) / math.sqrt(2.0)))
    score = INTERCEPT + PUT_RIGHT * step.fidelity + LOG_Z * math.log(max(step.z, 1e-3))
    return 1.0 / (1.0 + math.exp(-score))
