"""After training: the policy keeps as much authority as its loops bear.

What was learned from episodes can still shake in the small, at a place or with an arm that episodes
hardly visit. So the loop's modes over one step of the policy are looked at everywhere (experiments.periodic_loop):
every speed, operating point and arm, as told and with commands one period later. The largest of SHARES is
kept at which nothing grows that does not grow under the base law alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from controllers import policy
from controllers.policy import PolicyController
from controllers.policy_file import Policy
from experiments.periodic_loop import growing
from steer_env.plants import PLANTS, Reference

SHARES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25, 0.1)
LATE = (0, 1)  # periods


def gated(found: Policy, reference: Reference) -> Policy:
    """The policy with its authority cut as far as it has to be; ``training`` tells by how much, and what is left."""
    speeds = [row.speed_kmh for row in reference.file.rows]

    def places(controller: PolicyController) -> set[Any]:
        return {
            (late, *place)
            for late in LATE
            for place in growing(controller, found.plant, found.causality, reference, speeds, late)
        }

    def with_share(share: float) -> PolicyController:
        kept = replace(found, authority=found.authority * share)
        return policy.of(kept, PLANTS[found.plant], reference)

    allowed = places(with_share(0.0))
    for share in SHARES:
        left = places(with_share(share)) - allowed
        if not left:
            break
    told = {"authority_share": share, "places_that_grow": sorted(map(list, left)), "under_the_base_law": len(allowed)}
    return replace(found, authority=found.authority * share, training={**found.training, "gate": told})
