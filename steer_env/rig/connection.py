"""Which motor, on which bus, under which limits: the options of a rig, checked, and the session they open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from steer_env.envs.layout import PARAMETERS
from steer_env.envs.task import Setup
from steer_env.errors import InputError
from steer_env.manoeuvres import hand_at
from steer_env.plants import Plant
from steer_env.rig import motors
from steer_env.rig.bus import Link, open_bus
from steer_env.rig.motors.motor import Motor
from steer_env.rig.safety_limits import Limits, checked_limits, limits_for
from steer_env.rig.session import RigSession, Tap
from steer_env.rig.watchdog import STALL, Watchdog

OWN_PROCESS_ONLY = ("stepped", "virtual")  # interfaces that no second process can reach
MOST_PATIENT = 10.0  # a measurement of 50 ms, a cycle of 100 ms


@dataclass
class Connection:
    """Everything that can be chosen about a rig.

    motor: a row of ``steer_env.rig.motors.MOTORS``; ``motor_options`` are its own (sign, zero, rated_torque, ...).
    interface, channel: as python-can names them; "stepped" is a virtual motor in this process on a virtual clock, the
        same bits every time. ``port`` is that of udp_multicast; ``bitrate`` in bit/s, None: the motor's own.
    torque_cap: N m; None: the default of 2 N m (``Limits``), or the drive's rating if that is less. Rates, window and
        energy grow with it. ``limits`` gives everything by hand instead.
    watchdog: the second process that drops the drive; None: wherever a second process can reach the bus.
    patience: factor on how late a measurement, a cycle or a beat may be, for a virtual motor on a busy computer; on a
        real one a torque lasts that much longer when something hangs.
    virtual: options of the stepped ``VirtualMotor`` (seed, faults, noise, imperfections, bitrate, ...).
    tap: told every frame, for recorders.
    """

    motor: str = "simulated"
    interface: str = "stepped"
    channel: str = ""
    motor_options: Mapping[str, Any] = field(default_factory=dict)
    port: int = 43113
    bitrate: int | None = None
    torque_cap: float | None = None
    limits: Limits | None = None
    watchdog: bool | None = None
    patience: float = 1.0
    virtual: Mapping[str, Any] = field(default_factory=dict)
    tap: Tap | None = None
    wheel: Any = field(default=None, init=False)

    @classmethod
    def taken_from(cls, options: Mapping[str, Any]) -> tuple[Connection, dict[str, Any]]:
        """The connection among options, and the others; InputError where one contradicts another."""
        own = {f.name for f in fields(cls) if f.init}
        made = cls(**{name: value for name, value in options.items() if name in own})
        made.check()
        return made, {name: value for name, value in options.items() if name not in own}

    def check(self) -> None:
        """Raise InputError for what can be known to be wrong before the bus is opened."""
        if self.torque_cap is not None and self.limits is not None:
            raise InputError("torque_cap", "limits are given too", "write the cap into the limits, or leave them away")
        if self.interface != "stepped" and not self.channel:
            raise InputError("channel", f"interface {self.interface!r} has none", "give it, such as 'can0'")
        if self.interface != "stepped" and self.virtual:
            raise InputError("virtual", f"interface {self.interface!r} is no virtual motor", "use interface='stepped'")
        if not 1.0 <= self.patience <= MOST_PATIENT:
            raise InputError("patience", f"is {self.patience:g}", f"give a factor from 1 to {MOST_PATIENT:g}")
        if self.watchdog and self.interface in OWN_PROCESS_ONLY:
            raise InputError("watchdog", f"no process can reach {self.interface!r}", "leave watchdog away")
        self.limits_of(self.codec())

    def codec(self) -> Motor:
        """The motor's codec, made anew."""
        return motors.make(self.motor, **self.motor_options)

    def limits_of(self, motor: Motor) -> Limits:
        """Limits of the safety layer; InputError where the cap is above the drive's rating."""
        if self.limits is not None:
            limits = checked_limits(self.limits, motor.rated_torque)
        else:
            cap = min(Limits().torque_cap, motor.rated_torque) if self.torque_cap is None else self.torque_cap
            limits = limits_for(cap, motor.rated_torque)
        return checked_limits(
            limits._replace(
                stale_after=self.patience * limits.stale_after, longest_cycle=self.patience * limits.longest_cycle
            ),
            motor.rated_torque,
        )

    def open(self, plant: Plant) -> RigSession:
        """Open the bus (or make the virtual motor), start the watchdog, and hand out the session; no torque yet."""
        motor = self.codec()
        limits = self.limits_of(motor)
        if self.interface == "stepped":
            return RigSession(self._stepped(plant), motor, plant, limits, tap=self.tap, patience=self.patience)
        bus: dict[str, Any] = {"interface": self.interface, "channel": self.channel, "port": self.port}
        bus |= {"bitrate": self.bitrate or motor.bitrate, "data_bitrate": motor.data_bitrate}
        link, watchdog = open_bus(**bus), None
        if self.watchdog or (self.watchdog is None and self.interface not in OWN_PROCESS_ONLY):
            watchdog = Watchdog(self.motor, dict(self.motor_options), bus, stall=STALL * self.patience)
            try:
                watchdog.start()
            except BaseException:
                link.close()
                raise
        return RigSession(link, motor, plant, limits, watchdog, self.tap, self.patience)

    def move_hand(self, setup: Setup, time: float) -> None:
        """Let a stepped virtual driver do what the manoeuvre says at a time in s."""
        if self.wheel is not None:
            episode, manoeuvre = (PARAMETERS.read(setup.row, name) for name in ("episode", "manoeuvre"))
            self.wheel.hand = hand_at(episode.kind, time, manoeuvre)
            self.wheel.driver = PARAMETERS.read(setup.row, "driver")

    def let_go(self) -> None:
        """A stepped virtual driver takes its hands off."""
        if self.wheel is not None:
            self.wheel.hand = self._off

    def _stepped(self, plant: Plant) -> Link:
        from steer_env.rig.virtual.link import SteppedLink
        from steer_env.rig.virtual.motor import VirtualMotor
        from steer_env.rig.virtual.wheel import HANDS_OFF

        options = {"plant": plant} | dict(self.motor_options) | dict(self.virtual)
        virtual = VirtualMotor(self.motor, **options)
        self.wheel, self._off = virtual.wheel, HANDS_OFF
        return SteppedLink(virtual)
