"""Where the boxes meet: what a controller sees and what it must offer.

Simulation, bench and rig all use these. A period of a control loop goes as follows: the environment
(or the rig) measures, updates the reference and hands an ``Observation`` to the controller; the
controller returns a motor torque in N m at the motor's own shaft, positive to the left; limits sit
after it, never inside it. The same controller object gives the same torques for the same sequence
of observations, whether it runs step by step or compiled in a rollout.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

from steer_env.physics.control_unit import Observation

__all__ = ["Controller", "Law", "Observation"]

Law = Callable[[Observation, Any, Any], tuple[float, Any]]
"""A control law as a pure function: (observation, state, parameters) -> (torque in N m, new state).

State and parameters are NamedTuples of floats (parameters may hold an array, such as the reference
over speed); the function is marked ``@scalar``, so that it compiles into a rollout.
"""


@runtime_checkable
class Controller(Protocol):
    """A control law with its parameters and its present state."""

    law: Law
    parameters: Any

    def reset(self, period: float) -> None:
        """Forget the past; control periods will be ``period`` seconds. Called before an episode."""

    def state(self) -> Any:
        """The law's present state, a NamedTuple of floats."""

    def __call__(self, observation: Observation) -> float:
        """Motor torque in N m for this period."""
