"""The virtual motor against closed forms: its watchdog, its plant, its clock, its wire."""

import math
from dataclasses import replace

import numpy as np
import pytest

from steer_env.physics import plant
from steer_env.physics.driver import Driver, Hand
from steer_env.physics.motor import lag_decay
from steer_env.physics.reference import ReferenceParameters
from steer_env.plants.sbw import SBW
from steer_env.rig.motors import MOTORS, make
from steer_env.rig.virtual import settings
from steer_env.rig.virtual.link import SteppedLink
from steer_env.rig.virtual.motor import VirtualMotor
from steer_env.rig.virtual.wheel import PERFECT, Imperfections
from steer_env.rig.virtual.wire import classic_bits, frame_time
from tests.rig.conversation import Conversation

motors = pytest.mark.parametrize("name", list(MOTORS))


@motors
@pytest.mark.parametrize("watchdog_s", [0.005, 0.02, 0.3])
def test_the_watchdog_trips_at_its_time(name, watchdog_s):
    """Silence from one command on: torque until the time is over, error and a falling torque after it."""
    talk = Conversation(name, watchdog_s=watchdog_s)
    talk.until("on")
    talk.run(1.0, 30)
    arrived = talk.virtual.now - 1e-3  # the last command was sent then, and took up to 0.4 ms
    talk.virtual.advance_to(arrived + watchdog_s - 0.05e-3)
    assert talk.virtual.drive.state == "on"
    assert talk.virtual.motor_torque == pytest.approx(1.0, abs=4e-3)
    talk.virtual.advance_to(arrived + watchdog_s + 0.5e-3)
    assert talk.virtual.drive.state == "error"
    assert any("watchdog" in fault for fault in talk.virtual.drive.faults)
    talk.virtual.advance(0.02)
    assert abs(talk.virtual.motor_torque) < 1e-6


def test_a_moteus_command_brings_its_own_watchdog_time():
    """Register 0x027 of the command, not the drive's 100 ms."""
    talk = Conversation("moteus", host={"watchdog_s": 0.01})
    talk.until("on")
    talk.run(0.5, 5)
    talk.virtual.advance(0.012)
    assert talk.virtual.drive.state == "error"


def ideal(name: str = "simulated", **more) -> Conversation:
    """No time on the wire; a command acts one period after it was sent, as in the environments."""
    return Conversation(name, bitrate=0, dead_time=1e-3, watchdog_s=0.0, **more)


def test_the_wheel_moves_as_the_environments_plant_does():
    """Same equations, same grid: bit for bit the state that two steps of 0.5 ms per period give."""
    talk = ideal()
    talk.until("on")
    start = talk.virtual.wheel.state
    # In a register of 0.5 mN m, so that the command is exact at both ends.
    torques = [0.5 * round(2000.0 * math.sin(0.03 * k)) / 1000.0 for k in range(300)]
    hand = Hand(0.2, 0.0, 0.4, 0.7)
    talk.virtual.wheel.hand = hand
    x, due = start, 0.0
    decay = lag_decay(SBW.motor.bandwidth_Hz, 0.25e-3)
    for torque in torques:
        talk.period(*talk.motor.torque_frames(torque))
        for _ in range(2):
            x = plant.plant_step(x, due, decay, hand, 1.0, 0.0, SBW.steering, Driver(), ReferenceParameters(), 0.5e-3)
        due = torque
        got = talk.virtual.wheel.state
        assert got.pinion_angle == pytest.approx(x.pinion_angle, abs=1e-12)
        assert got.steering_rate == pytest.approx(x.steering_rate, abs=1e-10)
        assert got.motor_torque == pytest.approx(x.motor_torque, abs=1e-12)
    assert abs(x.pinion_angle) > 0.1  # it did move


def test_an_unbalanced_wheel_swings_like_a_pendulum():
    """Let go near its lowest point: omega = sqrt(weight arm / J), with hardly any friction."""
    bare = SBW.steering._replace(M_fric=0.0, M_s_fric=0.0, b_pin=0.0, b_s=0.0)
    virtual = VirtualMotor(
        "simulated", plant=replace(SBW, steering=bare), imperfections=Imperfections(0.0, 21.0, 0.8), noise=False,
        angle=0.05,
    )  # fmt: skip
    angles = []
    for _ in range(4000):
        virtual.advance(1e-3)
        angles.append(virtual.wheel.state.steering_angle)
    crossings = np.nonzero(np.diff(np.signbit(angles)))[0]
    period = 2.0 * np.mean(np.diff(crossings)) * 1e-3
    J = bare.J_s + bare.J_pin
    assert period == pytest.approx(2.0 * math.pi * math.sqrt(J / 0.8), rel=0.01)


def test_cogging_shows_on_the_torque_sensor_of_a_wheel_that_is_turned_by_hand():
    """A sin(N angle), felt at the wheel while it is turned slowly."""
    amplitude, order = 0.2, 21.0
    virtual = VirtualMotor("simulated", imperfections=Imperfections(amplitude, order, 0.0), noise=False)
    virtual.wheel.driver = Driver(k=500.0, b=5.0)
    found = []
    for k in range(4000):
        virtual.wheel.hand = Hand(0.2e-3 * k, 0.2, 0.0, 1.0)
        virtual.advance(1e-3)
        x = virtual.wheel.state
        found.append((x.pinion_angle, virtual.wheel.read().sensor_torque))
    angle, torque = np.array(found[500:]).T
    base = np.column_stack([np.sin(order * angle), np.cos(order * angle), np.ones_like(angle), angle])
    fit = np.linalg.lstsq(base, torque, rcond=None)[0]
    assert math.hypot(fit[0], fit[1]) == pytest.approx(amplitude, rel=0.05)


@motors
def test_the_same_seed_gives_the_same_bits(name):
    """And another seed does not: noise, and so frames, differ."""

    def frames(seed: int) -> list:
        talk = Conversation(name, seed=seed, noise=True, imperfections=Imperfections())
        talk.virtual.wheel.plant = SBW
        talk.until("on")
        return [each for heard in talk.run(0.7, 200) for each in heard.frames]

    assert frames(3) == frames(3)
    if name == "simulated":  # the only one with a noisy sensor
        assert frames(3) != frames(4)


@motors
def test_time_may_be_cut_as_one_likes(name):
    """Three periods at once, one by one or in odd pieces: the same frames at the same times."""

    def frames(pieces: list[float]) -> list:
        virtual = VirtualMotor(name, noise=False)
        motor = make(name, **settings(name))
        found = virtual.advance(0.4e-3)  # never at the same instant as the drive's own frames
        for _ in range(20):
            for frame in motor.poll_frames():
                virtual.submit(frame)
            for piece in pieces:
                found += virtual.advance(piece)
        return found

    whole, cut, odd = frames([3e-3]), frames([1e-3] * 3), frames([0.07e-3, 1.93e-3, 0.5e-3, 0.5e-3])
    assert [each.frame for each in whole] == [each.frame for each in cut] == [each.frame for each in odd]
    times = [np.array([each.host_time for each in run]) for run in (whole, cut, odd)]
    np.testing.assert_allclose(times[0], times[1], atol=1e-9)
    np.testing.assert_allclose(times[0], times[2], atol=1e-9)


def test_an_answer_comes_after_both_frames_were_on_the_wire():
    """0x201 and 0x211 at 1 Mbit/s with worst stuffing: 270 us; nothing of it is the drive's."""
    talk = Conversation("senso_wheel")
    (received,) = talk.virtual.exchange(talk.motor.torque_frames(0.0), 1e-3)
    both = 2 * classic_bits(received.frame, True) * 1e-6
    assert received.device_time == pytest.approx(both)
    slow = VirtualMotor("senso_wheel", bitrate=250_000)
    (received,) = slow.exchange(talk.motor.torque_frames(0.0), 3e-3)
    assert received.device_time == pytest.approx(4.0 * both)


@motors
def test_no_more_comes_out_than_the_bus_can_carry(name):
    """A host that sends far too much: the wire is full, not more than full, and refuses the rest."""
    talk = Conversation(name)
    talk.until("on")
    before, start = talk.virtual.wire.busy, talk.virtual.now
    taken = 0
    for _ in range(50):
        for _ in range(60):
            taken += sum(talk.virtual.submit(frame) for frame in talk.motor.torque_frames(0.1))
        talk.virtual.advance(1e-3)
    spent, carried = talk.virtual.now - start, talk.virtual.wire.busy - before
    longest = frame_time(talk.motor.torque_frames(0.0)[0], 1_000_000, talk.motor.data_bitrate) + 0.5e-3
    assert spent - 0.2e-3 <= carried <= spent + longest
    assert talk.virtual.wire.refused > 1000
    assert taken < 3000


def test_the_stepped_link_is_a_bus_on_a_virtual_clock():
    """receive waits no longer than it was told and no longer than until the frame comes."""
    motor = make("senso_wheel")
    with SteppedLink(VirtualMotor("senso_wheel")) as link:
        assert link.receive(0.004) is None
        assert link.now() == pytest.approx(0.004)
        assert link.send(motor.torque_frames(0.0)[0])
        received = link.receive(0.01)
        assert received is not None
        assert received.host_time == link.now() == pytest.approx(0.004 + 270e-6)
        assert link.receive(0.0) is None
        for frame in motor.poll_frames():
            link.send(frame)
        link.advance(0.002)
        times = [link.receive(0.0).host_time, link.receive(0.0).host_time]
        assert times == sorted(times)
        assert times[-1] < link.now() == pytest.approx(0.006 + 270e-6)
        assert link.receive(0.0) is None
        assert link.health().state == "active"


def test_a_wrongly_mounted_drive_is_what_the_host_must_find_out():
    """Sign and zero of the drive and of the host's belief are two things."""
    talk = Conversation("senso_wheel", sign=-1, zero=0.3, imperfections=PERFECT, angle=0.5)
    talk.until("on")
    heard = talk.run(1.0, 100)
    assert talk.virtual.wheel.state.pinion_angle < 0.45  # a torque to the left turned it right
    assert heard[-1].samples[0].angle == pytest.approx(0.3 - talk.virtual.wheel.state.pinion_angle, abs=2e-3)


def test_a_wheel_beyond_its_end_stop_is_not_switched_on():
    """The wheel's error 0x0200: it must be turned back by hand."""
    talk = Conversation("senso_wheel", host={"end_stop_deg": 90}, angle=2.0)
    with pytest.raises(AssertionError, match="switched on outside end stop"):
        talk.until("on", 20)
