"""The seam to python-can: what goes in comes out, what is refused stays out, and what the bus suffers is counted."""

import subprocess
import sys
import time

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steer_env.errors import InputError
from steer_env.rig import bus as rig_bus
from steer_env.rig.bus import frame_of, local_group, message_of, open_bus
from steer_env.rig.frame import Frame
from steer_env.rig.motors import make
from steer_env.rig.motors.motor import DriveStatus, Sample

LENGTHS = [*range(9), 12, 16, 20, 24, 32, 48, 64]


@st.composite
def frames(draw):
    fd, extended = draw(st.booleans()), draw(st.booleans())
    length = draw(st.sampled_from(LENGTHS if fd else LENGTHS[:9]))
    identifier = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    remote = not fd and length == 0 and draw(st.booleans())
    return Frame(identifier, draw(st.binary(min_size=length, max_size=length)), extended, fd, remote)


@settings(max_examples=200, deadline=None)
@given(frame=frames())
def test_a_frame_survives_python_can(frame):
    assert frame_of(message_of(frame)) == frame


def test_a_bus_hands_over_frames_and_hears_others_only():
    """Two ends of python-can's in-process bus; own frames do not come back."""
    with open_bus("virtual", "rig-test") as one, open_bus("virtual", "rig-test") as other:
        sent = [Frame(0x201, bytes([k])) for k in range(5)]
        assert all(one.send(frame) for frame in sent)
        before = time.monotonic()
        received = [other.receive(0.5) for _ in sent]
        assert [each.frame for each in received] == sent
        assert all(before - 1.0 < each.host_time <= time.monotonic() for each in received)
        assert one.receive(0.0) is None
        assert other.receive(0.01) is None


@pytest.mark.parametrize("group", ["ff11::7079:1", "ff11::1", "FF11:0:0:0:0:0:7079:1"])
def test_groups_that_stay_on_this_host(group):
    assert local_group(group).startswith("ff11::")


@pytest.mark.parametrize(
    "group",
    [
        "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173",  # python-can's own default: site-local
        "239.74.163.2",
        "ff12::1",  # link-local
        "ff02::1",
        "ff1e::1",  # global
        "::1",
        "fe80::1",
        "can0",
        "",
    ],
)
def test_a_group_that_can_leave_this_host_is_refused(group):
    """Catches torque commands on the office network."""
    with pytest.raises(InputError, match="udp_multicast"):
        open_bus("udp_multicast", group)


@pytest.mark.parametrize(("interface", "channel"), [("no_such_interface", "x"), ("socketcan", "no_such_can7")])
def test_a_bus_that_is_not_there_is_said_in_one_line(interface, channel):
    with pytest.raises(InputError, match=interface):
        open_bus(interface, channel)


def test_there_is_no_cyclic_sending():
    """A thread or the kernel that repeats a torque would feed the drive's watchdog when this program hangs."""
    with open_bus("virtual", "rig-cyclic") as bus:
        assert not [name for name in dir(bus) if "period" in name or "cycl" in name]


class Errors:
    """A bus that delivers error frames, as SocketCAN does."""

    def __init__(self, *kinds: tuple[int, bytes]) -> None:
        self.messages = [
            can.Message(arbitration_id=kind, data=data, is_error_frame=True, is_extended_id=False)
            for kind, data in kinds
        ]

    def recv(self, timeout):
        return self.messages.pop(0) if self.messages else None

    def send(self, message, timeout):
        raise can.CanOperationError("Transmit buffer full")

    def shutdown(self):
        pass


@pytest.mark.parametrize(
    ("kinds", "state", "off"),
    [
        ([(0x004, b"\0\x08\0\0\0\0\0\0")], "warning", 0),
        ([(0x004, b"\0\x20\0\0\0\0\0\0")], "passive", 0),
        ([(0x040, bytes(8))], "bus-off", 1),
        ([(0x040, bytes(8)), (0x004, b"\0\x08\0\0\0\0\0\0")], "bus-off", 1),
        ([(0x040, bytes(8)), (0x100, bytes(8)), (0x040, bytes(8)), (0x100, bytes(8))], "active", 2),
        ([(0x004, b"\0\x20\0\0\0\0\0\0"), (0x004, b"\0\x40\0\0\0\0\0\0")], "active", 0),
        ([(0x008, bytes(8))], "active", 0),
    ],
)
def test_health_is_inferred_from_error_frames(kinds, state, off):
    """linux/can/error.h; python-can itself always says "active"."""
    bus = rig_bus.Bus(Errors(*kinds))
    for _ in kinds:
        bus.receive(0.0)
    health = bus.health()
    assert (health.state, health.bus_off, health.error_frames) == (state, off, len(kinds))


def test_a_frame_that_the_controller_does_not_take_is_not_sent_later():
    bus = rig_bus.Bus(Errors(), hears_itself=True)
    assert not bus.send(Frame(0x201, bytes(8)))
    assert bus.health().send_errors == 1


class Loop:
    """A bus that hears itself."""

    def __init__(self) -> None:
        self.messages = []

    def send(self, message, timeout):
        self.messages.append(message)

    def recv(self, timeout):
        return self.messages.pop(0) if self.messages else None


def test_own_frames_are_told_from_equal_ones_of_others():
    """One echo per frame sent; the next equal frame was injected, however late the echoes are read."""
    loop = Loop()
    bus = rig_bus.Bus(loop, hears_itself=True)
    frame, other = Frame(0x201, b"\1"), Frame(0x201, b"\2")
    for each in (frame, other, frame):
        bus.send(each)
    loop.messages.insert(1, message_of(Frame(0x211, b"")))
    loop.messages.append(message_of(frame))
    heard = []
    while loop.messages:
        received = bus.receive(0.001)
        heard += [received.frame] if received else []
    assert heard == [Frame(0x211, b""), frame]


def test_a_virtual_motor_in_a_process_of_its_own_answers():
    """steer-env rig virtual on the loopback multicast group; no time is asserted, only that it lives and obeys."""
    group, port = "ff11::7079:7", 43_917
    try:
        bus = open_bus("udp_multicast", group, port=port)
    except InputError as error:
        pytest.skip(f"no IPv6 multicast on the loopback interface here ({error})")
    command = [sys.executable, "-m", "experiments.cli", "rig", "virtual", "--motor", "senso_wheel", "--channel", group]
    command += ["--port", str(port), "--seconds", "240", "--watchdog-ms", "1000", "--quiet"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    motor = make("senso_wheel")
    torques = []
    try:
        with bus:
            deadline, frames, on = time.monotonic() + 240.0, motor.poll_frames(), False
            while time.monotonic() < deadline and len(torques) < 20:
                for frame in frames:
                    bus.send(frame)
                frames = motor.torque_frames(0.3) if on else motor.poll_frames()
                while (received := bus.receive(0.05)) is not None:
                    for message in motor.decode(received.frame):
                        if isinstance(message, DriveStatus):
                            on = message.state == "on"
                            frames = motor.bring_up(message) or frames
                        elif isinstance(message, Sample) and on:
                            torques.append(message.torque)
                if process.poll() is not None:
                    pytest.fail(process.stderr.read())
            for frame in motor.stop_frames():
                bus.send(frame)
    finally:
        process.kill()
        process.communicate()
    assert torques
    assert torques[-1] == pytest.approx(0.3, abs=0.01)
