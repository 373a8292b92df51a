"""What the driver tries to do: one closed-form function of time per file, and their table.

To add a manoeuvre: write ``my_test.py`` with ``signal(t, p) -> Hand`` (scalar, compiled when called
so), and add a row to MANOEUVRES. Tests run over the table: finite, bounded, at rest at the start,
the same for the same parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from steer_env.manoeuvres import (
    constant_speed_cornering,
    frequency_response,
    high_frequency_response,
    on_centre_weave,
    random_torque,
    release,
    standstill,
    steady_state,
    step_steer,
)
from steer_env.manoeuvres.parameters import ManoeuvreParameters
from steer_env.physics._jit import named, scalar
from steer_env.physics.driver import Hand

__all__ = ["MANOEUVRES", "Manoeuvre", "ManoeuvreParameters", "hand_at", "kind_of"]


class Manoeuvre(NamedTuple):
    """A row: signal, parameters, and the lateral acceleration in m/s2 that sets its amplitude.

    ``lateral_acceleration`` None takes the paper's amplitude for the speed; 0 keeps the amplitude
    of ``parameters``.
    """

    signal: Callable[[float, Any], Hand]
    parameters: ManoeuvreParameters
    lateral_acceleration: float | None


MANOEUVRES: dict[str, Manoeuvre] = {
    "frequency_response": Manoeuvre(frequency_response.signal, frequency_response.DEFAULT, None),
    "steady_state": Manoeuvre(steady_state.signal, steady_state.DEFAULT, None),
    "on_centre_weave": Manoeuvre(on_centre_weave.signal, on_centre_weave.DEFAULT, 2.0),
    "step_steer": Manoeuvre(step_steer.signal, step_steer.DEFAULT, 2.0),
    "release": Manoeuvre(release.signal, release.DEFAULT, 1.0),
    "random_torque": Manoeuvre(random_torque.signal, random_torque.DEFAULT, 0.0),
    "constant_speed_cornering": Manoeuvre(constant_speed_cornering.signal, constant_speed_cornering.DEFAULT, None),
    "standstill": Manoeuvre(standstill.signal, standstill.DEFAULT, 0.0),
    "high_frequency_response": Manoeuvre(high_frequency_response.signal, high_frequency_response.DEFAULT, 0.0),
}


def kind_of(name: str) -> int:
    """Number of a manoeuvre in the table, as compiled code wants it."""
    return list(MANOEUVRES).index(name)


def _dispatch(
    rows: list[tuple[int, Callable[[float, Any], Hand]]],
) -> Callable[[float, float, Any], Hand]:
    """Fold the table into nested ifs, which is what compiled code can call."""
    number, signal = rows[0]
    if len(rows) == 1:

        def last(kind: float, t: float, p: Any) -> Hand:
            return signal(t, p)

        return scalar(named(last, number))
    others = _dispatch(rows[1:])

    def chosen(kind: float, t: float, p: Any) -> Hand:
        if kind == number:
            return signal(t, p)
        return others(kind, t, p)

    return scalar(named(chosen, number))


hand_at = _dispatch([(k, row.signal) for k, row in enumerate(MANOEUVRES.values())])
