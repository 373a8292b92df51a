"""The drive's own torque limit: set to the safety layer's cap at bring-up, and read back where the drive can tell it.

It is the last thing between the motor and a command that was damaged behind our CAN controller, in a gateway or a
driver: nothing on our side sees such a frame, and most drives check none.
"""

from __future__ import annotations

import math

from steer_env.rig.frame import Frame
from steer_env.rig.motors.motor import Motor

ASK_EVERY = 0.02  # s between two questions that the drive has not answered
ROUNDING = 1e-6  # N m


class DriveLimit:
    """Of one drive and one cap in N m; ``torque`` is the most that the drive gives, as it told: nan if it has not."""

    def __init__(self, motor: Motor, cap: float) -> None:
        self._motor, self._cap = motor, cap
        self.torque = math.nan
        self.settled = False  # whether all has been done that can be
        self._asked = -math.inf

    def restart(self) -> None:
        """Begin anew: the drive may have lost its supply."""
        self.torque, self.settled, self._asked = math.nan, False, -math.inf

    def frames(self, now: float) -> tuple[Frame, ...]:
        """What is to be sent at a time in s."""
        if self.settled or now - self._asked < ASK_EVERY:
            return ()
        self._asked, self.settled = now, self._motor.own_limit != "told"
        return self._motor.limit_frames(self._cap)

    def take(self, frame: Frame) -> None:
        """Look whether a frame from the bus tells the limit."""
        told = self._motor.told_limit(frame)
        if told is not None:
            self.torque, self.settled = told, True

    def refusal(self) -> str:
        """Why the rig must not be armed, or ""."""
        if self.torque > self._cap + ROUNDING:
            return f"the drive's own torque limit is {self.torque:g} N m, above the cap of {self._cap:g} N m"
        return ""
