"""What every motor of the table must do, at both ends of the bus."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from steer_env.rig.frame import Frame
from steer_env.rig.motors import MOTORS, make
from steer_env.rig.motors.motor import DriveStatus, Rejected, Sample
from steer_env.rig.virtual import drive_class
from steer_env.rig.virtual import settings as settings_of
from steer_env.rig.virtual.drive import Drive
from steer_env.rig.virtual.wheel import Readings
from tests.rig.conversation import Conversation

motors = pytest.mark.parametrize("name", list(MOTORS))
# Half a step of what a protocol can say: angle in rad, rate in rad/s, torque in N m.
RESOLUTION = {
    "simulated": (0.5e-5, 1e-3, 2.5e-4),
    "senso_wheel": (math.pi / 40_000, math.pi / 60.0, 0.5e-3),
    "odrive": (1e-5, 1e-5, 1e-6),
    "odrive_05": (1e-5, 1e-5, 1e-6),
    "moteus": (1e-5, 1e-5, 1e-6),
    "cia402": (math.pi / 65_536, 0.5e-3, 0.5e-3 * 7.5),
}
STATES = ("off", "ready", "on", "error")
signs = st.sampled_from([1, -1])
zeros = st.floats(-3.0, 3.0)


def pair(name: str, **options) -> tuple:
    """A motor and a drive of the same settings."""
    both = {**settings_of(name), **options}
    drive: Drive = drive_class(name)(make(name, **both), None)
    return make(name, **both), drive


def test_every_row_has_a_resolution_here():
    assert set(RESOLUTION) == set(MOTORS)


@motors
@settings(max_examples=25, deadline=None)
@given(torque=st.floats(-7.5, 7.5), sign=signs)
def test_a_torque_arrives_as_it_was_meant(name, torque, sign):
    """Catches a scale, a sign applied twice or never, a rounding that truncates."""
    talk = Conversation(name, {"sign": sign}, sign=sign)
    talk.until("on")
    talk.run(torque, 2)
    assert talk.virtual.drive.target() == pytest.approx(torque, abs=RESOLUTION[name][2] + 1e-9)


@motors
@settings(max_examples=60, deadline=None)
@given(
    angle=st.floats(-9.0, 9.0), rate=st.floats(-30.0, 30.0), torque=st.floats(-7.5, 7.5), sensor=st.floats(-15, 15),
    sign=signs, zero=zeros,
)  # fmt: skip
def test_a_sample_arrives_as_it_was_measured(name, angle, rate, torque, sensor, sign, zero):
    """Sign and zero of the mounting cancel; what a protocol does not have is nan and nothing else is."""
    motor, drive = pair(name, sign=sign, zero=zero)
    frames = answers_of(motor, drive, Readings(angle, rate, torque, sensor))
    (sample,) = [m for f in frames for m in motor.decode(f) if isinstance(m, Sample)]
    steps = RESOLUTION[name]
    assert sample.angle == pytest.approx(angle, abs=steps[0] * 1.01)
    assert sample.rate == pytest.approx(rate, abs=steps[1] * 1.01)
    if name == "odrive_05":
        assert math.isnan(sample.torque)
    else:
        assert sample.torque == pytest.approx(torque, abs=steps[2] * 1.01)
    if name == "simulated":
        assert sample.sensor_torque == pytest.approx(sensor, abs=steps[2] * 1.01)
    else:
        assert math.isnan(sample.sensor_torque)
    assert (sample.counter >= 0) == (motor.counter_modulus > 0)


def answers_of(motor, drive, readings: Readings) -> list[Frame]:
    """Frames with which a drive reports readings: its answers to a command, or its cyclic messages."""
    if "EncoderEstimates" in drive.cycles:
        return drive.cyclic("EncoderEstimates", readings, 1e-3)
    for frame in motor.bring_up(DriveStatus("off", (), "pre-operational")):
        drive.receive(frame, readings, 0.0)
    return [answer for frame in motor.torque_frames(0.0) for answer in drive.receive(frame, readings, 1e-3)]


@motors
@settings(max_examples=30, deadline=None)
@given(torque=st.floats(-7.5, 7.5), sign=signs)
def test_a_command_can_be_read_back_from_its_frame(name, torque, sign):
    """What a log's replay takes for the commanded torque; a stop commands zero, an answer nothing."""
    motor, _ = pair(name, sign=sign)
    brought_up = DriveStatus("off", (), "switched on")
    motor.bring_up(brought_up)
    read = [value for frame in motor.torque_frames(torque) if (value := motor.commanded(frame)) is not None]
    assert read == [pytest.approx(torque, abs=RESOLUTION[name][2] + 1e-9)]
    stopped = [value for frame in motor.stop_frames() if (value := motor.commanded(frame)) is not None]
    assert set(stopped) == {0.0}
    assert all(motor.commanded(Frame(key[0], bytes(8), key[1])) is None for key in motor.reply_identifiers)


@motors
def test_no_frame_is_made_of_a_torque_beyond_the_rating_or_not_finite(name):
    motor = make(name, **settings_of(name))
    for torque in (math.nan, math.inf, -math.inf, motor.rated_torque * 1.0001, -motor.rated_torque * 1.0001):
        with pytest.raises(ValueError, match="torque"):
            motor.torque_frames(torque)


@motors
@settings(max_examples=40, deadline=None)
@given(states=st.lists(st.sampled_from(STATES), max_size=6), torque=st.floats(-7.0, 7.0))
def test_whatever_is_sent_has_an_identifier_that_is_watched(name, states, torque):
    """Catches a command whose injection by another node would go unnoticed."""
    motor = make(name, **settings_of(name))
    frames = [*motor.torque_frames(torque), *motor.stop_frames()]
    polls = {frame.key for frame in motor.poll_frames() if not frame.data}
    for state in states:
        frames += [*motor.bring_up(DriveStatus(state)), *motor.bring_down(DriveStatus(state))]
    assert {frame.key for frame in frames} <= motor.command_identifiers
    assert {frame.key for frame in motor.poll_frames()} <= motor.command_identifiers | (polls & motor.reply_identifiers)
    assert not motor.command_identifiers & motor.reply_identifiers


@motors
def test_brought_up_and_down_one_observed_status_at_a_time(name):
    """On with no torque, holds a torque, off again; nothing skips a state."""
    talk = Conversation(name)
    way = [status.state for status in talk.until("on")]
    assert way[0] == "off"
    assert way[-1] == "on"
    assert talk.virtual.motor_torque == 0.0
    talk.run(0.4, 50)
    assert talk.virtual.motor_torque == pytest.approx(0.4, abs=RESOLUTION[name][2])
    talk.until("off")
    talk.virtual.advance(0.02)
    assert abs(talk.virtual.motor_torque) < 1e-9


@motors
def test_torque_frames_never_turn_a_drive_on(name):
    """A program that starts to send torques at a drive at rest, or after it was brought down, moves nothing."""
    talk = Conversation(name)
    talk.run(1.0, 100)
    assert talk.virtual.drive.state == "off"
    talk.until("on")
    talk.run(0.5, 10)
    talk.until("off")
    talk.run(1.0, 100)
    assert talk.virtual.drive.state == "off"
    assert abs(talk.virtual.motor_torque) < 1e-9


@motors
def test_stop_frames_stop_from_every_state(name):
    talk = Conversation(name)
    talk.period(*talk.motor.stop_frames())
    assert talk.virtual.drive.state == "off"
    talk.until("on")
    talk.run(2.0, 20)
    for _ in range(2):
        talk.period(*talk.motor.stop_frames())
    assert talk.virtual.drive.state == "off"
    assert talk.virtual.drive.target() == 0.0


@motors
def test_an_error_is_cleared_by_bringing_up_and_by_nothing_else(name):
    """Catches torque frames that quit an error on the way, as if nothing had been."""
    talk = Conversation(name)
    talk.until("on")
    talk.virtual.drive.trip(talk.virtual.drive.fault)
    statuses = [status for heard in talk.run(0.5, 60) for status in heard.statuses]
    statuses += talk.period(*talk.motor.poll_frames()).statuses
    assert talk.virtual.drive.state == "error"
    assert statuses[-1].state == "error"
    assert statuses[-1].faults
    talk.until("on")
    assert talk.virtual.drive.faults == set()


@motors
@settings(max_examples=100, deadline=None)
@given(data=st.binary(max_size=64), identifier=st.integers(0, 0x7FF), fd=st.booleans(), remote=st.booleans())
def test_a_frame_of_another_length_kind_or_node_is_not_believed(name, data, identifier, fd, remote):
    """Foreign identifiers say nothing at all; own ones with a wrong form are rejected or say nothing."""
    motor = make(name, **settings_of(name))
    frame = Frame(identifier, data, False, fd, remote)
    if frame.key not in motor.reply_identifiers:
        assert motor.decode(frame) == ()
    for key in sorted(motor.reply_identifiers):
        own = Frame(key[0], data, key[1], fd, remote)
        wrong = remote or fd != (motor.data_bitrate > 0) or (not motor.data_bitrate and len(data) > 8)
        assume(wrong)
        assert all(isinstance(message, Rejected) for message in motor.decode(own))


def test_the_wheel_s_watchdog_is_never_switched_off():
    """Bit 0x0100 of the control word, which is forbidden in normal operation."""
    talk = Conversation("senso_wheel")
    talk.until("on")
    talk.run(0.5, 10)
    talk.virtual.drive.trip("overcurrent")
    talk.until("on")
    talk.until("off")
    controls = [frame.data[1] for frame in [*talk.sent, *talk.motor.stop_frames()] if frame.identifier == 0x200]
    assert len(controls) > 5
    assert not any(byte & 0x01 for byte in controls)
