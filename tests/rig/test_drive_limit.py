"""The drive's own torque limit: what is left where a command is damaged on its way to a drive that checks nothing."""

import math
import struct

import pytest

from experiments.rig_faults import CAP, OPTIONS
from steer_env.errors import InputError
from steer_env.plants import PLANTS
from steer_env.rig import motors
from steer_env.rig.safety import State
from steer_env.rig.safety_limits import limits_for
from steer_env.rig.session import RigError, RigSession
from steer_env.rig.virtual.link import SteppedLink
from steer_env.rig.virtual.motor import VirtualMotor

LIMITED = [name for name in OPTIONS if name != "simulated"]  # that one checks what it is told
ASKED = 1.3  # N m


def session_of(name, cap=CAP, **options):
    options = {**OPTIONS[name], **options}
    codec = motors.make(name, **options)
    motor = VirtualMotor(name, noise=False, **{**options, "rated_torque": 7.5})
    return RigSession(SteppedLink(motor), codec, PLANTS["SbW"], limits_for(cap, codec.rated_torque)), motor


def armed(name, cap=CAP, **options):
    session, motor = session_of(name, cap, **options)
    session.bring_up(2.0)
    session.arm()
    return session, motor


def torques_of_damaged_commands(name, cap):
    """What the drive would give, N m, for each bit of each frame of a command flipped."""
    session, motor = armed(name, cap)
    frames, given = session.motor.torque_frames(ASKED), {}
    for place, frame in enumerate(frames):
        for bit in range(8 * len(frame.data)):
            data = bytearray(frame.data)
            data[bit // 8] ^= 1 << bit % 8
            damaged = [*frames[:place], frame._replace(data=bytes(data)), *frames[place + 1 :]]
            before = dict(vars(motor.drive))
            for sent in damaged:
                motor.drive.receive(sent, motor.wheel.read(), motor.now)
            given[place, bit] = abs(motor.drive.target())
            vars(motor.drive).update({**before, "faults": set()})
    return given


@pytest.mark.parametrize("name", LIMITED)
def test_no_flipped_bit_of_a_command_gives_more_than_the_cap(name):
    """Catches a limit that is not set, that stands for something else, or that the same damage takes away."""
    given = torques_of_damaged_commands(name, CAP)
    assert {where: torque for where, torque in given.items() if not torque <= CAP + 1e-9} == {}


@pytest.mark.parametrize("name", LIMITED)
def test_with_a_higher_limit_some_flipped_bit_does(name):
    """The test above can fail."""
    assert CAP + 0.2 < max(torques_of_damaged_commands(name, 3.0).values()) <= 3.0 + 1e-9


@pytest.mark.parametrize("name", LIMITED)
def test_the_limit_is_the_cap_rounded_down(name):
    """To 1 % of 7.5 N m (SENSO-Wheel) or 0.1 % of the rating (CiA 402); others have floats."""
    session, motor = armed(name, cap=1.0)
    session.cycle(0.5)
    step = {"senso_wheel": 0.075, "cia402": 0.0075}.get(name, 1e-6)
    vars(motor.drive)["command"] = 7.0
    if name != "moteus":  # its limit goes with the command itself
        assert 1.0 - step <= motor.drive.target() <= 1.0 + 1e-9
    assert session.report()["drive_limit"] == pytest.approx(motor.drive.limit) or name != "cia402"
    assert (session.motor.own_limit == "told") == (name == "cia402")


def patched(monkeypatch, motor, change):
    """Let the SDO server of a virtual drive answer something else."""
    serve = motor.drive._serve
    monkeypatch.setattr(motor.drive, "_serve", lambda *request: change(serve, *request))


def test_a_drive_that_tells_a_higher_limit_is_not_armed(monkeypatch):
    """It accepts the writing and keeps what it had."""
    session, motor = session_of("cia402")

    def keeps_its_own(serve, first, index, sub, content):
        return serve(first, index, sub, 1000)

    patched(monkeypatch, motor, keeps_its_own)
    session.bring_up(2.0)
    assert session.report()["drive_limit"] == pytest.approx(7.5)
    with pytest.raises(RigError, match=r"7\.5 N m, above the cap of 1\.5"):
        session.arm()
    assert session.safety.state is State.TRIPPED
    motor.advance(0.02)
    assert motor.drive.state == "off"


def test_a_drive_that_refuses_to_have_it_written_is_asked_all_the_same(monkeypatch):
    session, motor = session_of("cia402")
    motor.drive.limit = 1.2
    patched(
        monkeypatch, motor,
        lambda serve, first, index, sub, content: (
            struct.pack("<BHBI", 0x80, index, sub, 0x0601_0002) if first == 0x2B else serve(first, index, sub, content)
        ),
    )  # fmt: skip
    session.bring_up(2.0)
    assert session.report()["drive_limit"] == pytest.approx(1.2)
    session.arm()


def test_a_drive_without_a_limit_is_armed_and_a_silent_one_is_not(monkeypatch):
    """0x6072 is optional in the profile; an SDO server is not in CANopen."""
    session, motor = session_of("cia402")
    patched(monkeypatch, motor, lambda serve, first, index, sub, _: struct.pack("<BHBI", 0x80, index, sub, 0x0602_0000))
    session.bring_up(2.0)
    assert math.isnan(session.report()["drive_limit"])
    session.arm()

    session, motor = session_of("cia402")
    received = motor.drive.receive
    monkeypatch.setattr(
        motor.drive, "receive", lambda frame, *rest: [] if frame.identifier == 0x601 else received(frame, *rest)
    )
    with pytest.raises(RigError, match="its own torque limit is not known"):
        session.bring_up(1.0)


def test_it_is_set_anew_when_the_drive_has_lost_its_supply():
    session, motor = armed("odrive")
    assert motor.drive.limit == pytest.approx(CAP)
    motor.drive.power_down()
    for _ in range(10):
        session.cycle(0.1)
    motor.drive.power_up(motor.now)
    assert motor.drive.limit == 7.5
    assert session.safety.state is State.TRIPPED
    session.bring_up(2.0)
    assert motor.drive.limit == pytest.approx(CAP)


def test_an_odrive_needs_both_its_torque_constant_and_a_speed_limit():
    """One message sets current and speed limit; without both it is not sent, and half of it is a mistake."""
    plain = motors.make("odrive", rated_torque=3.0)
    assert (plain.own_limit, plain.limit_frames(1.0)) == ("none", ())
    full = motors.make("odrive", rated_torque=3.0, node=1, torque_constant=0.25, rate_limit=2.0 * math.pi)
    (frame,) = full.limit_frames(1.0)
    assert (frame.identifier, frame.data) == (0x02F, struct.pack("<ff", 1.0, 4.0))  # 1 turn/s, 4 A
    for wrong in ({"torque_constant": 0.1}, {"rate_limit": 10.0}, {"torque_constant": 0.0, "rate_limit": 10.0}):
        with pytest.raises(InputError):
            motors.make("odrive", rated_torque=3.0, **wrong)


def test_golden_frames_of_the_limit():
    """Bytes by the layouts: 20 % in byte 6 of 0x200; 0x6072 = 200 per mille written and read (CiA 301, expedited)."""
    (control,) = motors.make("senso_wheel").limit_frames(1.5)
    assert (control.identifier, control.data[6]) == (0x200, 20)
    drive = motors.make("cia402", rated_torque=7.5, increments_per_turn=4096, node=2)
    (write,) = drive.limit_frames(1.5)
    assert (write.identifier, write.data.hex(" ")) == (0x602, "2b 72 60 00 c8 00 00 00")
    assert drive.told_limit(write._replace(identifier=0x582, data=bytes.fromhex("6072600000000000"))) is None
    (read,) = drive.limit_frames(1.5)
    assert read.data.hex(" ") == "40 72 60 00 00 00 00 00"
    assert drive.told_limit(read._replace(identifier=0x582, data=bytes.fromhex("4b726000c8000000"))) == 1.5
