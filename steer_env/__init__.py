"""Steering plants, haptic references and the Gymnasium environments made of them.

Importing this package registers the environment ids and nothing else: the physics is compiled and
the plotting libraries are loaded when they are first used.
"""

from itertools import product

import gymnasium

__version__ = "0.1.0"

for _plant, _causality in product(("EPAS", "SbW"), ("impedance", "admittance")):
    gymnasium.register(
        id=f"steer_env/{_plant}-{_causality.capitalize()}-v0",
        entry_point="steer_env.envs:SteerEnv",
        vector_entry_point="steer_env.envs:SteerVectorEnv",
        max_episode_steps=None,  # the manoeuvre ends the episode
        kwargs={"plant": _plant, "causality": _causality},
    )

for _causality in ("impedance", "admittance"):
    gymnasium.register(
        id=f"steer_env/Rig-{_causality.capitalize()}-v0",
        entry_point="steer_env.rig.rig_env:RigEnv",
        max_episode_steps=None,
        kwargs={"causality": _causality},
    )
