"""Controllers that must be caught: pid with its command multiplied, turned round or late."""

from typing import Any, NamedTuple

import controllers
from controllers.law import LawController
from steer_env.physics._jit import named, scalar


class Wrong(NamedTuple):
    """What is done to a right law: a factor on its command, and whether it is late."""

    right: Any
    factor: float
    late: float


class Late(NamedTuple):
    """The law's state and its last commands, newest first."""

    right: Any
    c1: float = 0.0
    c2: float = 0.0
    c3: float = 0.0
    c4: float = 0.0
    c5: float = 0.0
    c6: float = 0.0
    c7: float = 0.0
    c8: float = 0.0
    c9: float = 0.0
    c10: float = 0.0


_laws: dict[Any, Any] = {}


def spoilt(factor: float = 1.0, late: bool = False):
    """A maker of pid with its command times a factor, or ten periods late."""

    def make(plant, reference, causality):
        pid = controllers.make("pid", plant, reference, causality, tuned=False)
        right = pid.law

        def law(o, x, p):
            torque, inner = right(o, x.right, p.right)
            sent = p.factor * (x.c10 if p.late > 0.5 else torque)
            return sent, Late(inner, torque, x.c1, x.c2, x.c3, x.c4, x.c5, x.c6, x.c7, x.c8, x.c9)

        spoiler = _laws.setdefault(right, scalar(named(law, right)))

        def design(period):
            pid.reset(period)
            return Wrong(pid.parameters, factor, 1.0 if late else 0.0)

        return LawController(spoiler, design, Late(pid.state()))

    return make
