"""A log played back into decoders: what was said, how regularly, and what could not be believed.

Two decoders: ``MotorDecoder`` for the motors of this package, ``DbcDecoder`` for any .dbc file with the counters and
checksums that one tells it. ``aligned`` brings signals of unequal rates to one grid.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from steer_env.errors import InputError
from steer_env.rig.frame import Frame
from steer_env.rig.log_file import Logged
from steer_env.rig.motors.motor import DriveStatus, Motor, Rejected

Array = NDArray[np.float64]
STATES = ("off", "ready", "on", "error")


class Decoded(NamedTuple):
    """Values of a frame by name, why it cannot be believed ("" if it can), and its counter (modulus 0: none)."""

    values: dict[str, float]
    rejected: str = ""
    counter: int = 0
    modulus: int = 0


class Decoder(Protocol):
    """Turns a frame into named values; None: not one of its frames."""

    def __call__(self, frame: Frame, sent: bool) -> Decoded | None:
        """Values of a frame; ``sent``: by the logger."""


@dataclass
class Regularity:
    """Frames of one identifier: times in s, how many were rejected and why, and how many counters did not follow."""

    times: list[float] = field(default_factory=list)
    rejected: dict[str, int] = field(default_factory=dict)
    counter_errors: int = 0
    last_counter: int | None = None

    @property
    def period(self) -> float:
        """Median time between frames in s; nan for a single one."""
        return float(np.median(np.diff(self.times))) if len(self.times) > 1 else math.nan

    @property
    def jitter(self) -> tuple[float, float]:
        """99 % and worst deviation of the time between frames from its median, in s."""
        if len(self.times) < 2:
            return math.nan, math.nan
        late = np.abs(np.diff(self.times) - self.period)
        return float(np.quantile(late, 0.99)), float(late.max())


class Replayed(NamedTuple):
    """Signals (times [n] in s, values [n]) by name, and regularity by (identifier, extended)."""

    signals: dict[str, tuple[Array, Array]]
    regularity: dict[tuple[int, bool], Regularity]
    unknown: int  # frames that no decoder knows


def replay(frames: Iterable[Logged], decode: Decoder) -> Replayed:
    """Play frames into a decoder, in order."""
    series: dict[str, tuple[list[float], list[float]]] = defaultdict(lambda: ([], []))
    regularity: dict[tuple[int, bool], Regularity] = defaultdict(Regularity)
    unknown = 0
    for logged in frames:
        found = decode(logged.frame, logged.sent)
        if found is None:
            unknown += 1
            continue
        entry = regularity[logged.frame.key]
        entry.times.append(logged.time)
        if found.rejected:
            entry.rejected[found.rejected] = entry.rejected.get(found.rejected, 0) + 1
            continue
        if found.modulus:
            last, entry.last_counter = entry.last_counter, found.counter
            entry.counter_errors += last is not None and (last + 1) % found.modulus != found.counter
        for name, value in found.values.items():
            series[name][0].append(logged.time)
            series[name][1].append(value)
    signals = {name: (np.array(times), np.array(values)) for name, (times, values) in series.items()}
    return Replayed(signals, dict(regularity), unknown)


def aligned(
    signals: Mapping[str, tuple[Array, Array]], period: float, held: tuple[str, ...] = ()
) -> tuple[Array, dict[str, Array]]:
    """Signals of unequal rates on one even grid: time [n] in s and values [n] by name.

    Straight between samples, or, for the names in ``held``, the last value so far. The grid runs over the time that all
    signals cover. Raises InputError where there is none.
    """
    if not signals:
        raise InputError("signals", "there are none to align", "choose signals that the log has")
    start = max(float(times[0]) for times, _ in signals.values())
    end = min(float(times[-1]) for times, _ in signals.values())
    n = math.floor((end - start) / period + 1e-9) + 1
    if n < 2:
        raise InputError("signals", "do not overlap in time", "choose signals that were logged together")
    grid: Array = start + period * np.arange(n, dtype=np.float64)
    out: dict[str, Array] = {}
    for name, (times, values) in signals.items():
        if name in held:
            out[name] = values[np.searchsorted(times, grid + 1e-9, side="right") - 1]
        else:
            out[name] = np.interp(grid, times, values)
    elapsed: Array = grid - start
    return elapsed, out


class MotorDecoder:
    """Decoder of a motor: samples, state (index in STATES) and the torque commanded."""

    def __init__(self, motor: Motor) -> None:
        self.motor = motor

    def __call__(self, frame: Frame, sent: bool) -> Decoded | None:
        """Values of a frame from the drive or of a command to it."""
        torque = self.motor.commanded(frame)
        if torque is not None:
            return Decoded({"commanded_torque_Nm": torque})
        messages = self.motor.decode(frame)
        if not messages:
            return None
        values: dict[str, float] = {}
        counter, modulus = 0, 0
        for message in messages:
            if isinstance(message, Rejected):
                return Decoded({}, message.reason)
            if isinstance(message, DriveStatus):
                values["state"] = float(STATES.index(message.state))
                continue
            named = {
                "angle_rad": message.angle,
                "rate_radps": message.rate,
                "torque_Nm": message.torque,
                "sensor_torque_Nm": message.sensor_torque,
            }
            values.update({name: value for name, value in named.items() if not math.isnan(value)})
            if message.counter >= 0:
                counter, modulus = message.counter, self.motor.counter_modulus
        return Decoded(values, "", counter, modulus)


class DbcDecoder:
    """Decoder of a .dbc file.

    ``intact`` maps an identifier to a function frame -> whether its checksum is right, ``counters`` an identifier to
    (signal, modulus). Frames longer than their message are cut to it, as some loggers pad.
    """

    def __init__(
        self,
        path: str | Path,
        intact: Mapping[int, Callable[[Frame], bool]] | None = None,
        counters: Mapping[int, tuple[str, int]] | None = None,
    ) -> None:
        try:
            import cantools
        except ImportError:
            raise InputError(f"{path}", "cantools is not installed", "pip install 'steer-env[rig]'") from None
        try:
            database: Any = cantools.database.load_file(path)
        except (OSError, cantools.database.UnsupportedDatabaseFormatError) as error:
            raise InputError(f"{path}", f"cannot be read ({error})", "give a .dbc file") from error
        self._messages = {(message.frame_id, message.is_extended_frame): message for message in database.messages}
        self._intact, self._counters = dict(intact or {}), dict(counters or {})

    def __call__(self, frame: Frame, sent: bool) -> Decoded | None:
        """Values named Message.Signal."""
        message = self._messages.get(frame.key)
        if message is None or frame.remote:
            return None
        if len(frame.data) < message.length:
            return Decoded({}, "too short")
        frame = frame._replace(data=frame.data[: message.length])
        check = self._intact.get(frame.identifier)
        if check is not None and not check(frame):
            return Decoded({}, "checksum")
        values = message.decode(frame.data, decode_choices=False)
        signal, modulus = self._counters.get(frame.identifier, ("", 0))
        named = {f"{message.name}.{name}": float(value) for name, value in values.items()}
        return Decoded(named, "", int(values[signal]) if signal else 0, modulus)
