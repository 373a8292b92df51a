"""After training: the policy keeps as much authority at each speed as its loops bear.

What was learned from episodes can still shake in the small, at a place or with an arm that episodes
hardly visit. So the loop's modes over one step of the policy are looked at (experiments.periodic_loop): at every
speed of the reference, every operating point and arm, as told and with commands one period later. At each
speed the largest of SHARES is kept at which nothing grows that does not grow under the base law alone. A policy that
gives the whole torque stays as it is: less of it is not safer, and there is no law to fall back on.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from controllers import policy
from controllers.policy_file import Policy
from experiments.periodic_loop import growing
from steer_env.plants import PLANTS, Reference
from steer_env.units import from_kmh

SHARES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25, 0.1, 0.0)
LATE = (0, 1)  # periods


def gated(found: Policy, reference: Reference) -> Policy:
    """The policy with its authority cut, speed by speed, as far as it has to be."""
    if found.base is None:
        return found
    controllers = {
        share: policy.of(replace(found, authority=share * found.authority), PLANTS[found.plant], reference)
        for share in SHARES
    }

    def places(share: float, speed_kmh: float) -> set[Any]:
        return {
            (late, *place)
            for late in LATE
            for place in growing(controllers[share], found.plant, found.causality, reference, [speed_kmh], late)
        }

    shares = []
    for row in reference.file.rows:
        allowed = places(0.0, row.speed_kmh)
        share = next(share for share in SHARES if not places(share, row.speed_kmh) - allowed)
        shares.append((from_kmh(row.speed_kmh), share))
    return replace(found, shares=tuple(shares))
