"""Frames that were published or computed from published layouts, byte by byte."""

import math

import pytest

from steer_env.errors import InputError
from steer_env.rig.frame import Frame
from steer_env.rig.motors import e2e, make, moteus_frames
from steer_env.rig.motors.cia402 import STATUS_WORDS
from steer_env.rig.motors.dbc import dbc
from steer_env.rig.motors.motor import DriveStatus, Rejected, Sample


def test_senso_wheel_command_control_and_answer():
    """Catches a swapped field, a wrong scale, byte order or sign in the frames of the wheel."""
    file = dbc("senso_wheel")
    values = {"Torque": -1.234, "Friction": 0.3, "Damping": 0.1, "Stiffness": 1.0}
    assert file.encode("NormalCommand", values) == bytes.fromhex("2efb2c010a001100")
    motor = make("senso_wheel")
    (command,) = motor.torque_frames(-1.234)
    assert command == Frame(0x201, bytes.fromhex("2efb000000000000"))
    (_, control) = motor.bring_up(DriveStatus("ready", (), "normal"))
    assert control == Frame(0x200, bytes.fromhex("14001c0200006464"))  # normal, ON, 540 deg, 100 %, 100 %
    (sample,) = motor.decode(Frame(0x211, bytes.fromhex("f0d8ffffe2ffc409")))
    assert sample.angle == pytest.approx(-math.pi / 2.0, abs=1e-12)
    assert sample.rate == pytest.approx(-30.0 / 60.0 * 2.0 * math.pi, rel=1e-9)
    assert sample.torque == pytest.approx(2.5, abs=1e-12)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ("0000000000000000", DriveStatus("off", (), "none")),
        ("124000001c020000", "ready"),
        ("142400001c02f6ff", "on"),
        ("1800800000000000", DriveStatus("error", ("CAN watchdog",), "normal")),
        ("1800010200000000", DriveStatus("error", ("overcurrent", "switched on outside end stop"), "normal")),
        ("1800001000000000", DriveStatus("error", ("error bit 12",), "normal")),
        ("1600000000000000", None),  # no such state
        ("3400000000000000", None),  # no such mode
    ],
)
def test_senso_wheel_status(data, expected):
    """Catches an error bit under a wrong name, and a state that does not exist being taken for one."""
    (found,) = make("senso_wheel").decode(Frame(0x210, bytes.fromhex(data)))
    if expected is None:
        assert isinstance(found, Rejected)
    elif isinstance(expected, str):
        assert (found.state, found.faults) == (expected, ())
    else:
        assert found == expected


def test_odrive_torque_and_estimates():
    """Node 1, 1.5 N m is the maker's example; half a turn left at one turn per second."""
    for name in ("odrive", "odrive_05"):
        motor = make(name, node=1, rated_torque=4.0)
        assert motor.torque_frames(1.5) == (Frame(0x02E, bytes.fromhex("0000c03f")),)
        (sample,) = motor.decode(Frame(0x029, bytes.fromhex("0000003f0000803f")))
        assert sample[:2] == pytest.approx((math.pi, 2.0 * math.pi), rel=1e-12)


def test_odrive_watchdog_bits_differ_between_firmwares():
    old, new = make("odrive_05", rated_torque=4.0), make("odrive", rated_torque=4.0, node=1)
    assert old.decode(Frame(0x021, bytes.fromhex("0008000001000000"))) == (DriveStatus("error", ("watchdog",), "idle"),)
    assert new.decode(Frame(0x021, bytes.fromhex("0000000101030000"))) == (DriveStatus("error", ("watchdog",), "idle"),)
    # Byte 5 is a motor error flag in 0.5 and the result of the last procedure in 0.6.
    closed = Frame(0x021, bytes.fromhex("0000000008010000"))
    assert old.decode(closed) == (DriveStatus("error", ("MotorErrorFlag",), "closed loop control"),)
    assert new.decode(closed) == (DriveStatus("on", (), "closed loop control"),)


def test_moteus_frames_are_read_as_the_maker_explains_them():
    """The annotated example of the maker's protocol page, host's side."""
    found = moteus_frames.registers_of(bytes.fromhex("01000a07206000200150ff140400130d"))
    assert found.writes == {0x000: 10.0, 0x020: 96.0, 0x021: 288.0, 0x022: -176.0}
    assert found.reads == (*((k, 0x04) for k in range(4)), *((k, 0x00) for k in (0x0D, 0x0E, 0x0F)))


def test_moteus_command_by_hand():
    """Mode 10; five floats from 0x020: no position, no velocity, 1.5 N m, gains 0; at most 3 N m; then the query."""
    motor = make("moteus", node=1, rated_torque=3.0)
    (frame,) = motor.bring_up(DriveStatus("off"))
    (frame,) = motor.torque_frames(1.5)
    assert frame.key == (0x8001, True)
    assert frame.fd
    nan, zero, torque, most = "0000c07f", "00000000", "0000c03f", "00004040"
    floats = nan + zero + torque + zero + zero
    rest = "0d25" + most + "0d27" + zero + "0d2b" + zero + "11001f01110f"
    assert frame.data == bytes.fromhex("01000a" + "0c0520" + floats + rest + 14 * "50")
    reply = Frame(0x100, bytes.fromhex("21000a" + "2f01" + "0000003f" + "0000803f" + "0000c0bf" + "210f00"), fd=True)
    status, sample = motor.decode(reply)
    assert status == DriveStatus("on", (), "mode 10")
    assert sample[:3] == pytest.approx((math.pi, 2.0 * math.pi, -1.5))


def test_cia402_frames_by_hand():
    """Node 5, 3 of 6 N m: 500 per mille, control word 0x0F, mode 10; then SYNC."""
    motor = make("cia402", node=5, rated_torque=6.0, increments_per_turn=65536)
    assert motor.bring_up(DriveStatus("off", (), "pre-operational"))[0] == Frame(0x000, b"\x01\x05")
    for name, control in (("switch on disabled", 0x06), ("ready to switch on", 0x07), ("switched on", 0x0F)):
        state = next(state for _, _, found, state in STATUS_WORDS if found == name)
        assert motor.bring_up(DriveStatus(state, (), name))[0] == Frame(0x205, bytes([control, 0, 0, 0, 0x0A]))
    assert motor.torque_frames(3.0) == (Frame(0x205, bytes.fromhex("0f00f4010a")), Frame(0x080, b""))
    status, sample = motor.decode(Frame(0x185, bytes.fromhex("3706" + "00c0ffff" + "0cfe")))
    assert status == DriveStatus("on", (), "operation enabled")
    assert sample.angle == pytest.approx(-math.pi / 2.0)
    assert sample.torque == pytest.approx(-3.0)


def test_cia402_states_are_those_of_the_canopen_library():
    """An independent table of the profile's masks; catches a slip of a bit in ours."""
    p402 = pytest.importorskip("canopen.profiles.p402", reason="the canopen library is not installed")
    theirs = {name.lower(): pattern for name, pattern in p402.State402.SW_MASK.items()}
    ours = {name: (mask, value) for mask, value, name, _ in STATUS_WORDS}
    assert ours == theirs


@pytest.mark.parametrize(("counter", "crc"), [(0, 0xCC), (1, 0x91)])
def test_end_to_end_checksum_has_the_profile_s_values(counter, crc):
    """AUTOSAR profile 1, data id 0x123 in both bytes, eight zero bytes."""
    assert e2e.protected(bytes([0, counter, 0, 0, 0, 0, 0, 0]), 0x123)[0] == crc


def test_crc_has_the_catalogue_s_check_value():
    """CRC-8/SAE-J1850 of "123456789" is 0x4B (start and final value 0xFF)."""
    assert e2e.crc8(b"123456789", 0xFF) ^ 0xFF == 0x4B


@pytest.mark.parametrize(
    ("name", "options", "word"),
    [
        ("odrive", {}, "rated_torque"),
        ("odrive", {"rated_torque": float("nan")}, "rated_torque"),
        ("moteus", {"rated_torque": 2.0, "watchdog_s": float("nan")}, "watchdog_s"),
        ("moteus", {"rated_torque": 2.0, "node": 128}, "node"),
        ("cia402", {"rated_torque": 2.0}, "increments_per_turn"),
        ("senso_wheel", {"sign": 0}, "sign"),
        ("senso_wheel", {"zero": float("inf")}, "zero"),
        ("senso_wheel", {"peak_limit_percent": 200}, "peak_limit_percent"),
        ("senso_wheel", {"increments": 40000}, "increments"),
        ("joystick", {}, "joystick"),
        ("odrive", {"rated_torque": 2.0, "firmware": "0.4"}, "firmware"),
    ],
)
def test_what_a_source_does_not_tell_must_be_given(name, options, word):
    """Catches a rating, a unit or a watchdog time that is made up, and a misspelt option that is ignored."""
    with pytest.raises(InputError, match=word):
        make(name, **options)


def test_a_sample_that_no_wheel_can_give_is_rejected():
    far = Frame(0x211, bytes.fromhex("ffffff7f00000000"))
    assert isinstance(make("senso_wheel").decode(far)[0], Rejected)
    assert isinstance(make("senso_wheel").decode(Frame(0x211, bytes(8)))[0], Sample)
