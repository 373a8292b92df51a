"""Parameter sets: plants, drivers, sensors and references. No equations.

To add a plant, write its file with a ``Plant`` and add a row to PLANTS; tests run over the table.
"""

from __future__ import annotations

from steer_env.plants.drivers import DRIVERS
from steer_env.plants.epas import EPAS
from steer_env.plants.plant_set import Plant
from steer_env.plants.reference import Reference
from steer_env.plants.sbw import SBW

PLANTS: dict[str, Plant] = {"EPAS": EPAS, "SbW": SBW}

__all__ = ["DRIVERS", "PLANTS", "Plant", "Reference"]
