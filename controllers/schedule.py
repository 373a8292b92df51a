"""The reference over speed as a law reads it: straight between rows, held beyond the ends."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from steer_env.physics._jit import scalar, when_compiling
from steer_env.physics.lanes import Path
from steer_env.physics.reference import ReferenceParameters
from steer_env.physics.rows import place
from steer_env.plants import Reference
from steer_env.plants.reference import steady_stiffness


class Felt(NamedTuple):
    """What a law needs to know of the reference at one speed; units as in ReferenceParameters.

    ``stiffness`` in N m/rad is |load torque / pinion angle| at 0.2 Hz (c_pin_on). ``M_fric_C`` is
    zero and ``linear`` 1 where assist and friction are left out (Fig. 9).
    """

    J_ref: float
    b_ref: float
    k_gain: float
    M_fric_C: float
    c_fric: float
    r: float
    sigma: float
    stiffness: float
    linear: float


def schedule_of(reference: Reference) -> NDArray[np.float64]:
    """Rows over speed [n, 1 + fields of Felt]: speed in m/s, then Felt."""
    rows = []
    for row in reference.table:
        speed, p = float(row[0]), ReferenceParameters(*row[1:].tolist())
        friction = 0.0 if p.linear > 0.5 else p.M_fric_C
        stiffness = steady_stiffness(speed, p)
        felt = Felt(p.J_ref, p.b_ref, p.k_gain, friction, p.c_fric, p.r, p.sigma, stiffness, p.linear)
        rows.append((speed, *felt))
    return np.array(rows, dtype=np.float64)


Schedule = NDArray[np.float64] | Felt
"""The reference over speed in a law's parameters: ``schedule_of``, or the Felt of the present speed alone.

A law hands a parameter of this type to ``felt_at`` and to nothing else. Episodes in lanes then look it up when their
speed changes, apart from the law, which without look-ups compiles to vector code.
"""


def schedules_in(parameters: Any, path: Path = ()) -> dict[Path, NDArray[np.float64]]:
    """The parameters of type Schedule, however deep, by the path of field numbers that leads to them."""
    if not hasattr(parameters, "_fields"):
        return {}
    kind: Any = type(parameters)
    hints = _hints(kind)
    found: dict[Path, NDArray[np.float64]] = {}
    for k, (name, value) in enumerate(zip(parameters._fields, parameters, strict=True)):
        if hints.get(name) == Schedule:
            found[(*path, k)] = value
        else:
            found |= schedules_in(value, (*path, k))
    return found


@cache
def _hints(record: Any) -> dict[str, Any]:
    try:
        return get_type_hints(record)
    except NameError:  # a law's own file may name types that only a type checker imports
        return {}


def felt_at(speed: float, schedule: Any) -> Felt:
    """The reference at a speed in m/s."""
    return schedule if isinstance(schedule, Felt) else looked_up(speed, schedule)


def _tell_felt_at() -> None:
    from numba.extending import overload

    from steer_env.physics._records import is_record

    @overload(felt_at, strict=False, jit_options={"forceinline": True, "error_model": "numpy"})
    def compiled(speed: Any, schedule: Any) -> Any:
        if is_record(schedule):
            return lambda speed, schedule: schedule
        return lambda speed, schedule: looked_up(speed, schedule)


when_compiling(_tell_felt_at)


@scalar
def looked_up(speed: float, schedule: Any) -> Felt:
    """The reference at a speed in m/s between the rows of ``schedule_of``."""
    low, high, share = place(speed, schedule)
    return Felt(
        _between(schedule, 1, low, high, share),
        _between(schedule, 2, low, high, share),
        _between(schedule, 3, low, high, share),
        _between(schedule, 4, low, high, share),
        _between(schedule, 5, low, high, share),
        _between(schedule, 6, low, high, share),
        _between(schedule, 7, low, high, share),
        _between(schedule, 8, low, high, share),
        _between(schedule, 9, low, high, share),
    )


@scalar
def _between(schedule: Any, column: int, low: int, high: int, share: float) -> float:
    value: float = schedule[low, column] + share * (schedule[high, column] - schedule[low, column])
    return value
