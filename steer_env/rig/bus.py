"""A CAN bus through python-can: frames in and out, its health, and what is refused on principle.

    with open_bus("socketcan", "can0", bitrate=1_000_000) as bus:
        bus.send(frame)
        received = bus.receive(0.005)

Frames are sent one at a time and only by ``send``. There is no cyclic sending, neither the kernel's nor a thread's: it
would go on feeding the last torque to the drive, and its watchdog, when this program hangs.

python-can's ``udp_multicast`` serves virtual motors. Only interface-local IPv6 groups (ff11::/16, RFC 4291 2.7) are
taken, because these never leave the host; python-can's own default groups are routable.
"""

from __future__ import annotations

import ipaddress
import time
from collections import deque
from types import TracebackType
from typing import Any, NamedTuple, Protocol

from steer_env.errors import InputError
from steer_env.rig.frame import Frame, Received

ECHOES = 10_000  # own frames that may still be on their way back
QUIET = 1.0  # s without error frames after which a bus counts as recovered
# linux/can/error.h: class bits in the identifier of an error frame, and the controller's state in data[1].
_ERR_CONTROLLER, _ERR_BUS_OFF, _ERR_RESTARTED = 0x004, 0x040, 0x100
_CONTROLLER_WARNING, _CONTROLLER_PASSIVE, _CONTROLLER_ACTIVE = 0x0C, 0x30, 0x40


class Health(NamedTuple):
    """What a bus has seen since it was opened.

    ``state`` is inferred from error frames (python-can reports none on SocketCAN): "active", "warning", "passive" or
    "bus-off".
    """

    state: str = "active"
    error_frames: int = 0
    bus_off: int = 0
    send_errors: int = 0
    remote_frames: int = 0


class Link(Protocol):
    """What the layers above need of a bus; the stepped virtual motor offers the same."""

    def send(self, frame: Frame) -> bool:
        """Hand a frame to the controller at once; False where it did not take it (never queued for later)."""

    def receive(self, timeout: float) -> Received | None:
        """The next data frame that others sent, waiting at most ``timeout`` s; None: there was none."""

    def now(self) -> float:
        """The link's clock in s: ``time.monotonic()``, or the virtual time."""

    def health(self) -> Health:
        """Error frames, bus-off and refused frames so far."""

    def close(self) -> None:
        """Let go of the bus."""


class Bus:
    """A ``Link`` over an open python-can bus; a context manager. Made by ``open_bus``."""

    def __init__(self, can_bus: Any, hears_itself: bool = False) -> None:
        self._bus: Any = can_bus
        self._echoes: deque[Frame] | None = deque(maxlen=ECHOES) if hears_itself else None
        self._health = Health()
        self._last_error = float("-inf")

    def send(self, frame: Frame) -> bool:
        """Hand a frame to the controller at once; False where it did not take it."""
        import can

        if self._echoes is not None:
            self._echoes.append(frame)
        try:
            self._bus.send(message_of(frame), timeout=0.0)
        except can.CanError:
            if self._echoes is not None:
                self._echoes.pop()
            self._health = self._health._replace(send_errors=self._health.send_errors + 1)
            return False
        return True

    def receive(self, timeout: float) -> Received | None:
        """The next data frame that others sent, waiting at most ``timeout`` s; None: there was none."""
        deadline = time.monotonic() + timeout
        while True:
            message = self._bus.recv(max(deadline - time.monotonic(), 0.0))
            host_time = time.monotonic()
            if message is None:
                return None
            if message.is_error_frame:
                self._note_error(message, host_time)
            else:
                frame = frame_of(message)
                if not self._is_echo(frame):
                    if frame.remote:
                        self._health = self._health._replace(remote_frames=self._health.remote_frames + 1)
                    return Received(frame, message.timestamp, host_time)
            if host_time >= deadline:
                return None

    @property
    def python_can(self) -> Any:
        """The python-can bus itself, for configuring a drive before a run; never for torque."""
        return self._bus

    def now(self) -> float:
        """The host's monotonic clock in s."""
        return time.monotonic()

    def health(self) -> Health:
        """Error frames, bus-off and refused frames so far."""
        if self._health.state in ("warning", "passive") and time.monotonic() - self._last_error > QUIET:
            self._health = self._health._replace(state="active")
        return self._health

    def close(self) -> None:
        """Let go of the bus."""
        self._bus.shutdown()

    def __enter__(self) -> Bus:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _is_echo(self, frame: Frame) -> bool:
        """Whether the frame is an own one coming back, in the order sent; a second equal one is not ours."""
        if not self._echoes or frame not in self._echoes:
            return False
        while self._echoes.popleft() != frame:
            pass  # those before it got lost
        return True

    def _note_error(self, message: Any, host_time: float) -> None:
        health, state, kind = self._health, self._health.state, message.arbitration_id
        self._last_error = host_time
        if kind & _ERR_BUS_OFF:
            health, state = health._replace(bus_off=health.bus_off + 1), "bus-off"
        elif kind & _ERR_RESTARTED:
            state = "active"
        elif kind & _ERR_CONTROLLER and len(message.data) > 1 and state != "bus-off":
            levels = message.data[1]
            if levels & _CONTROLLER_PASSIVE:
                state = "passive"
            elif levels & _CONTROLLER_WARNING:
                state = "warning"
            elif levels & _CONTROLLER_ACTIVE:
                state = "active"
        self._health = health._replace(state=state, error_frames=health.error_frames + 1)


def open_bus(
    interface: str,
    channel: str,
    bitrate: int = 1_000_000,
    data_bitrate: int = 0,
    port: int = 43113,
) -> Bus:
    """Open a bus. Raises InputError where python-can, the interface or the channel is not there, or is refused.

    Args:
        interface: python-can's name: socketcan, pcan, slcan, udp_multicast, virtual, ...
        channel: as the interface names it: can0, /dev/ttyACM0, ff11::7079:1 (a group's address).
        bitrate: bit/s; SocketCAN has it set by ``ip link`` and ignores it here.
        data_bitrate: bit/s of the FD data phase; 0: classic CAN.
        port: UDP port of udp_multicast; all groups on a port hear each other on Linux.
    """
    try:
        import can
    except ImportError:
        raise InputError(f"bus {interface}", "python-can is not installed", "pip install 'steer-env[rig]'") from None
    options: dict[str, Any] = {"bitrate": bitrate, "fd": data_bitrate > 0}
    if data_bitrate:
        options["data_bitrate"] = data_bitrate
    if interface == "udp_multicast":
        channel, options = local_group(channel), {"fd": data_bitrate > 0, "port": port, "hop_limit": 0}
    elif interface == "virtual":
        options = {}
    elif interface == "socketcan":
        options = {"fd": data_bitrate > 0}
    try:
        opened = can.Bus(interface=interface, channel=channel, **options)
    except (can.CanError, OSError, ValueError, TypeError, NotImplementedError) as error:
        raise InputError(
            f"bus {interface} {channel}",
            f"does not open ({type(error).__name__}: {error})",
            "check the interface's name, that the adapter is plugged in and its driver loaded, and the channel",
        ) from error
    return Bus(opened, hears_itself=interface == "udp_multicast")


def local_group(channel: str) -> str:
    """The channel if it is an interface-local IPv6 group; raises InputError otherwise."""
    mend = "give a group in ff11::/16, such as ff11::7079:1, which never leaves this host"
    try:
        address = ipaddress.IPv6Address(channel)
    except ValueError:
        raise InputError("channel of udp_multicast", f"{channel!r} is no IPv6 address", mend) from None
    if address not in ipaddress.IPv6Network("ff11::/16"):
        raise InputError("channel of udp_multicast", f"{channel} can leave this host", mend)
    return str(address)


def message_of(frame: Frame) -> Any:
    """The python-can message of a frame."""
    import can

    return can.Message(
        arbitration_id=frame.identifier,
        data=None if frame.remote else frame.data,
        dlc=len(frame.data),
        is_extended_id=frame.extended,
        is_fd=frame.fd,
        bitrate_switch=frame.fd,
        is_remote_frame=frame.remote,
        check=True,
    )


def frame_of(message: Any) -> Frame:
    """The frame of a python-can data or remote message."""
    data = b"" if message.is_remote_frame else bytes(message.data)
    return Frame(message.arbitration_id, data, message.is_extended_id, message.is_fd, message.is_remote_frame)
