"""A drive under control, on every motor: in, through a fault, and out again, always without torque at the end."""

import math

import pytest

from experiments.rig_checks import Bench, all_checks
from experiments.rig_faults import CAP, OPTIONS, failures, outcome
from experiments.rig_mutation import MODULES, mutants_of
from steer_env.errors import InputError, RigError
from steer_env.plants import PLANTS
from steer_env.rig import motors
from steer_env.rig.frame import Frame
from steer_env.rig.safety import State
from steer_env.rig.safety_limits import Limits
from steer_env.rig.session import RigSession
from steer_env.rig.virtual.faults import Fault
from steer_env.rig.virtual.link import SteppedLink
from steer_env.rig.virtual.motor import VirtualMotor


def opened(name="senso_wheel", tap=None, watchdog=None, **virtual):
    motor = VirtualMotor(name, **OPTIONS[name], **virtual)
    codec = motors.make(name, **OPTIONS[name])
    return RigSession(SteppedLink(motor), codec, PLANTS["SbW"], Limits(), watchdog, tap), motor


def ready(name="senso_wheel", **options):
    session, motor = opened(name, **options)
    session.bring_up(2.0)
    session.arm()
    return session, motor


@pytest.mark.parametrize("name", list(OPTIONS))
def test_every_motor_comes_up_gives_the_torque_asked_for_and_goes_down(name):
    session, motor = ready(name)
    assert motor.drive.state == "on"
    assert session.safety.state is State.ARMED
    for _ in range(60):
        session.cycle(0.4)
    assert session.applied == 0.4
    assert motor.motor_torque == pytest.approx(0.4, abs=0.02)
    assert session.reading.angle == pytest.approx(motor.wheel.state.pinion_angle, abs=0.02)
    session.bring_down()
    motor.advance(0.02)
    assert motor.drive.state in ("off", "error")
    assert abs(motor.motor_torque) < 1e-6


@pytest.mark.parametrize("name", list(OPTIONS))
@pytest.mark.parametrize("fault", ["cut_to_drive", "drive_fault", "latched_torque", "host: exception"])
def test_a_fault_ends_in_zero_torque(name, fault):
    """A piece of the matrix of experiments.rig_faults; a drive that reports no torque cannot be caught disobeying."""
    done = outcome(name, fault, 1)
    if not (fault == "latched_torque" and name == "odrive_05"):
        assert failures([done]) == []
    assert done.largest_command <= CAP


def test_the_matrix_notices_what_is_not_as_it_must_be():
    """An outcome with torque left, one above the cap and one that raised: three complaints."""
    good = outcome("senso_wheel", "drive_fault", 0)
    assert failures([good]) == []
    bad = [good._replace(last_torque=0.1), good._replace(largest_command=1.6), good._replace(error="KeyError")]
    assert len(failures(bad)) == 3
    assert failures([good._replace(last_torque=math.nan)]) != []


def test_nothing_but_a_torque_command_is_sent_while_polling():
    """Catches a poll that tells the drive zero torque in between, which some polls do."""
    sent = []
    session, _ = ready(tap=lambda frame, time, ours: sent.append(frame) if ours else None)
    for _ in range(40):
        session.cycle(0.3)
    del sent[:]
    for _ in range(50):
        session.cycle(0.3)
    commands = [frame for frame in sent if frame.identifier == 0x201]
    assert len(commands) == 50
    assert all(frame == session.motor.torque_frames(0.3)[0] for frame in commands)
    assert 3 <= len(sent) - len(commands) <= 6  # a status every 10 ms


def test_a_frame_that_only_we_may_send_trips():
    session, motor = ready()
    session.cycle(0.2)
    motor.wire.queue("other", session.motor.torque_frames(0.2)[0], motor.now)
    for _ in range(3):
        session.cycle(0.2)
    assert session.foreign == 1
    assert "somebody else" in session.safety.trip_reason
    motor.advance(0.02)
    assert motor.drive.state == "off"


@pytest.mark.parametrize(
    "frame",
    [Frame(0x07F, bytes(8)), Frame(0x060, b""), Frame(0x061, b"", remote=True), Frame(0x069, b""), Frame(0x074, b"")],
    ids=["no such command", "NMT", "asks for the heartbeat", "asks for estimates", "asks for the current"],
)
def test_whatever_would_feed_the_watchdog_of_an_odrive_05_trips(frame):
    """Firmware 0.5 takes any frame of its node for life of its host: a torque of a program that died would stay."""
    session, motor = ready("odrive_05")
    fed = motor.drive._fed
    motor.advance(0.5e-3)
    motor.drive.receive(frame, motor.wheel.read(), motor.now)
    assert motor.drive._fed > fed
    motor.wire.queue("other", frame, motor.now)
    for _ in range(3):
        session.cycle(0.2)
    assert "somebody else" in session.safety.trip_reason


def test_node_0_of_an_odrive_05_gets_no_torque():
    """Frames of the highest priority would belong to it: none of ours could get through, and its watchdog stay fed."""
    options = {**OPTIONS["odrive_05"], "node": 0}
    motor = VirtualMotor("odrive_05", **options)
    session = RigSession(SteppedLink(motor), motors.make("odrive_05", **options), PLANTS["SbW"], Limits())
    with pytest.raises(InputError, match="node_id"):
        session.bring_up(1.0)
    assert motor.drive.state == "off"


def test_a_frame_of_others_does_not():
    session, motor = ready()
    motor.wire.queue("other", Frame(0x123, b"12345678"), motor.now)
    for _ in range(5):
        session.cycle(0.2)
    assert session.foreign == 0
    assert session.safety.state is State.ARMED


class Dog:
    """A watchdog of which a test decides how it is."""

    fired, alive, beats, watching = False, True, 0, False

    def beat(self):
        self.beats += 1

    def watch(self, on):
        self.watching = on

    def close(self):
        self.watching = None


@pytest.mark.parametrize(("state", "reason"), [({"fired": True}, "has dropped"), ({"alive": False}, "is gone")])
def test_without_its_watchdog_it_does_not_go_on(state, reason):
    dog = Dog()
    session, motor = ready(watchdog=dog)
    assert dog.watching
    beats = dog.beats
    session.cycle(0.2)
    assert dog.beats == beats + 1
    for name, value in state.items():
        setattr(dog, name, value)
    session.cycle(0.2)
    assert reason in session.safety.trip_reason
    motor.advance(0.02)
    assert motor.drive.state == "off"
    session.close()
    assert dog.watching is None


def test_a_drive_that_does_not_come_up_or_is_not_healthy_is_told():
    session, motor = opened()
    motor.drive.powered = False
    with pytest.raises(RigError, match="does not come up"):
        session.bring_up(0.2)
    session, motor = opened()
    session.bring_up(2.0)
    motor.drive.trip("overcurrent")
    with pytest.raises(RigError, match="drive"):
        session.arm(0.2)


def test_an_exception_inside_a_with_brings_the_drive_down():
    session, motor = ready()
    for _ in range(20):
        session.cycle(0.4)
    with pytest.raises(ZeroDivisionError), session:
        raise ZeroDivisionError
    motor.advance(0.02)
    assert motor.drive.state == "off"
    assert "ZeroDivisionError" in session.safety.trip_reason


def test_after_a_trip_the_stop_is_sent_again_in_each_cycle():
    sent = []
    session, _ = ready(tap=lambda frame, time, ours: sent.append(frame) if ours else None)
    session.cycle(math.nan)
    del sent[:]
    for _ in range(5):
        session.cycle(0.4)
    assert sent == list(session.motor.stop_frames()) * 5


@pytest.mark.parametrize("name", ["senso_wheel", "simulated"])
def test_the_check_of_a_sound_rig_passes_and_leaves_no_torque(name):
    motor = VirtualMotor(name, watchdog_s=0.05)
    bench = Bench(SteppedLink(motor), motors.make(name), lambda: None)
    found = {finding.check: finding.passed for finding in all_checks(bench, armed=True, seconds=0.3)}
    motor.advance(0.05)
    assert abs(motor.motor_torque) < 1e-6
    assert [check for check, passed in found.items() if passed is False] == []
    assert {"bus up", "motor answers", "timing", "limits limit", "bad request trips", "sign"} <= found.keys()


@pytest.mark.parametrize(
    ("fault", "check"), [("cut_to_host", "motor answers"), ("torque_gain", "limits limit"), ("stuck_sensor", "sign")]
)
def test_the_check_finds_what_is_wrong(fault, check):
    motor = VirtualMotor("senso_wheel", faults=[Fault(fault)], watchdog_s=0.05)
    bench = Bench(SteppedLink(motor), motors.make("senso_wheel"), lambda: None)
    failed = [finding.check for finding in all_checks(bench, armed=True, seconds=0.3) if finding.passed is False]
    assert check in failed


def test_without_arming_the_check_sends_no_torque():
    motor = VirtualMotor("senso_wheel")
    bench = Bench(SteppedLink(motor), motors.make("senso_wheel"), lambda: None)
    names = [finding.check for finding in all_checks(bench, armed=False, seconds=0.3)]
    assert names == ["bus up", "motor answers", "torque"]
    assert motor.drive.state == "off"


def test_mutants_are_many_different_and_compile():
    """Catches a mutator that changes nothing, which would count as a fault that no test notices."""
    for module in MODULES:
        mutants = list(mutants_of(module))
        assert len({mutant.source for mutant in mutants}) == len(mutants) > 50
        for mutant in mutants:
            compile(mutant.source, module, "exec")
