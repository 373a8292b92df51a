"""The environment on a motor is the environment: same spaces, info and reward; and it always ends without torque."""

import gymnasium
import numpy as np
import pytest

import controllers
import steer_env  # noqa: F401  (registers the ids)
from steer_env.errors import InputError, RigError
from steer_env.plants import PLANTS
from steer_env.rig.rig_env import RigEnv
from steer_env.rig.safety_limits import Limits
from steer_env.rig.virtual.faults import Fault
from steer_env.rig.virtual.wheel import PERFECT, Imperfections

SENSORS = PLANTS["SbW"].sensors._replace(torque_noise=0.0)
WIDE = Limits(
    torque_cap=7.5, rate_up=1e5, rate_down=1e5, window_change=50.0, energy_store=500.0, energy_income=50.0,
    angle_limit=9.4,
)  # fmt: skip
TASK = {"manoeuvre": "frequency_response", "sensors": SENSORS, "duration": 3.0}
IDEAL = {"bitrate": 0, "dead_time": 1e-3, "imperfections": PERFECT}


def rig(causality="Impedance", **options):
    return gymnasium.make(f"steer_env/Rig-{causality}-v0", **{"motor": "simulated", **TASK, **options})


def virtual_of(env):
    return env.unwrapped.session.link.motor


def run(env, steps, law=None, seed=3):
    """Observed angle, torque, command and reward [n, 4], and the last info."""
    inside = env.unwrapped
    controller = law or controllers.make("pid", inside.plant, inside.reference, inside.task.causality)
    _, info = env.reset(seed=seed)
    if law is None:
        controller.reset(1e-3)
    rows = []
    for _ in range(steps):
        _, reward, terminated, ended, info = env.step(inside.action_for(controller(info["observation"])))
        seen = info["observation"]
        rows.append((seen.pinion_angle, seen.torsion_bar_torque, info["command"], reward))
        assert not terminated
        if ended:
            break
    return np.array(rows), info


@pytest.mark.parametrize("causality", ["Impedance", "Admittance"])
def test_simulated_and_real_are_the_same_to_whoever_uses_them(causality):
    """Spaces, and every name in info: a recorder or policy of the one must work on the other."""
    real, simulated = rig(causality), gymnasium.make(f"steer_env/SbW-{causality}-v0", **TASK)
    assert real.action_space == simulated.action_space
    assert real.observation_space == simulated.observation_space
    for act in (lambda env: env.reset(seed=1)[1], lambda env: env.step(np.array([0.01], np.float32))[4]):
        info, expected = act(real), act(simulated)
        assert info.keys() == expected.keys() | {"rig"}
        assert {name: type(info[name]) for name in expected} == {name: type(expected[name]) for name in expected}
    assert real.unwrapped.plant == simulated.unwrapped.plant
    assert real.unwrapped.reference.speed == simulated.unwrapped.reference.speed
    real.close()


@pytest.mark.parametrize("causality", ["Impedance", "Admittance"])
def test_on_a_wire_without_delay_both_are_equal_to_within_resolution(causality):
    """Two steps of the sensors' resolution: one is the rounding, one what the loop makes of it."""
    real, _ = run(rig(causality, limits=WIDE, virtual=IDEAL), 900)
    simulated, _ = run(gymnasium.make(f"steer_env/SbW-{causality}-v0", **TASK), 900)
    assert np.abs(simulated[:, 0]).max() > 0.1
    assert np.abs(real - simulated)[:, 0].max() <= 2.0 * SENSORS.angle_step + 1e-6
    assert np.abs(real - simulated)[:, 1].max() <= 2.0 * SENSORS.torque_step + 1e-6


def test_the_same_seed_gives_the_same_bits_and_another_does_not():
    first, second, third = (run(rig(sensors=None, virtual={"seed": seed}), 700)[0] for seed in (4, 4, 5))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, third)


def test_the_reward_is_that_of_the_measured_signals():
    env = rig(limits=WIDE)
    _, info = run(env, 900)
    error = info["torsion_bar_torque"] - info["reference"]
    assert info["error"] == pytest.approx(error)
    assert info["reward_tracking"] == pytest.approx(-min(abs(error) / env.unwrapped.task.reward.torque_scale, 10.0))
    assert info["reference"] == info["observation"].reference
    assert info["command"] == info["observation"].last_torque_1
    env.close()


def test_without_a_word_no_torque_is_above_2_newton_metres():
    """And what was really applied, not what was wished, is what observation and info tell."""
    env = rig()
    rows, info = run(env, 400, law=lambda seen: 7.5)
    assert np.abs(rows[:, 2]).max() <= 2.0
    assert np.abs(rows[:, 2]).max() > 1.0
    assert info["observation"].last_torque_1 == info["command"]
    assert "cap" in info["rig"]["limited_by"] or info["ended"]
    assert env.unwrapped.connection.limits_of(env.unwrapped.session.motor).torque_cap == 2.0
    env.close()


def test_a_small_drive_brings_its_cap_down_and_none_goes_above_its_rating():
    env = rig(motor="odrive", motor_options={"rated_torque": 1.0})
    rows, _ = run(env, 200, law=lambda seen: 7.5)
    assert np.abs(rows[:, 2]).max() <= 1.0
    env.close()
    with pytest.raises(InputError, match="rating"):
        rig(motor="odrive", motor_options={"rated_torque": 1.0}, torque_cap=1.5)


@pytest.mark.parametrize(
    ("fault", "reason"), [("drive_fault", "drive"), ("injected_command", "somebody else"), ("cut_to_host", "stale")]
)
def test_a_trip_ends_the_episode_without_torque_and_with_its_reason(fault, reason):
    env = rig(virtual={"faults": [Fault(fault, start=0.9)]})
    _, info = run(env, 1200)
    assert info["ended"].startswith("tripped")
    assert reason in info["ended"]
    virtual = virtual_of(env)
    virtual.advance(0.02)
    assert virtual.drive.state in ("off", "error")
    assert abs(virtual.motor_torque) < 1e-3
    with pytest.raises(RuntimeError, match="reset"):
        env.unwrapped.step(np.zeros(1, np.float32))
    env.close()


@pytest.mark.parametrize("how", ["end of the manoeuvre", "close", "not a number", "exception"])
def test_however_it_ends_the_drive_is_off(how):
    env = rig(duration=0.05)
    env.reset(seed=0)
    virtual = virtual_of(env)
    assert virtual.drive.state == "on"
    for _ in range(100):
        env.step(np.array([0.1], np.float32))
    if how == "end of the manoeuvre":
        ended = False
        while not ended:
            *_, ended, info = env.step(np.array([0.1], np.float32))
        assert info["ended"] == how
    elif how == "not a number":
        with pytest.raises(ValueError, match="finite"):
            env.unwrapped.step(np.array([np.nan], np.float32))
    elif how == "exception":
        with pytest.raises(ZeroDivisionError), env:
            raise ZeroDivisionError
    env.close()
    env.close()
    virtual.advance(0.02)
    assert virtual.drive.state == "off"
    assert abs(virtual.motor_torque) < 1e-3


def test_reset_turns_a_wheel_back_gently():
    """From 1 rad: with at most 1 N m, at no more than walking pace, to within 0.02 rad and at rest."""
    peak = {"torque": 0.0, "rate": 0.0}
    env = rig(virtual={"angle": 1.0})
    inside = env.unwrapped

    def watch(frame, time, sent):
        if inside._session is None:
            return  # it is being closed
        virtual = virtual_of(env)
        peak["torque"] = max(peak["torque"], abs(virtual.motor_torque))
        peak["rate"] = max(peak["rate"], abs(virtual.wheel.state.pinion_rate))

    inside.connection.tap = watch
    env.reset(seed=0)
    state = virtual_of(env).wheel.state
    assert abs(state.pinion_angle) < 0.02
    assert abs(state.pinion_rate) < 0.05
    assert 0.05 < peak["torque"] <= 1.0
    assert 0.3 < peak["rate"] < 2.5
    env.close()


def test_a_wheel_that_does_not_settle_is_let_go(monkeypatch):
    """A weight of 3 N m that hangs a full turn away: 1 N m cannot lift it over, and must not go on trying."""
    monkeypatch.setattr("steer_env.rig.rig_env.SETTLE_TIMEOUT", 2.0)
    env = rig(virtual={"imperfections": Imperfections(0.0, 21.0, 3.0), "angle": 6.0})
    with pytest.raises(RigError, match=r"settle|tripped"):
        env.reset(seed=0)
    virtual = virtual_of(env)
    virtual.advance(0.02)
    assert virtual.drive.state == "off"
    env.close()


def test_a_recorder_that_fails_ends_the_run_and_never_the_stop():
    """A full disk: the episode trips, and zero torque and the drive's state down still go out."""
    env = rig()
    env.reset(seed=0)

    def full(frame, time, sent):
        raise OSError("no space left on device")

    env.unwrapped.session._tap = full
    virtual = virtual_of(env)
    _, _, _, ended, info = env.step(np.array([0.1], np.float32))
    if not ended:
        _, _, _, ended, info = env.step(np.array([0.1], np.float32))
    assert ended
    assert "recorder fails" in info["ended"]
    virtual.advance(0.02)
    assert virtual.drive.state == "off"
    env.close()


def test_a_bus_that_raises_does_not_keep_the_stop_from_being_tried():
    env = rig()
    env.reset(seed=0)
    session, virtual = env.unwrapped.session, virtual_of(env)
    send, calls = session.link.send, []

    def unplugged(frame):
        calls.append(frame)
        if len(calls) < 4:
            raise OSError("no such device")
        return send(frame)

    session.link.send = unplugged
    _, _, _, ended, info = env.step(np.array([0.1], np.float32))
    while not ended:
        _, _, _, ended, info = env.step(np.array([0.1], np.float32))
    assert "bus fails" in info["ended"]
    virtual.advance(0.02)
    assert virtual.drive.state == "off"
    env.close()


def test_a_real_rig_is_locked_until_somebody_unlocks_it():
    env = gymnasium.make("steer_env/Rig-Impedance-v0", motor="senso_wheel", interface="virtual", channel="locked")
    with pytest.raises(InputError, match="locked"):
        env.reset(seed=0)
    env.unwrapped.unlock()
    with pytest.raises(RigError, match="come up"):  # nobody is on that bus
        env.reset(seed=0)
    with pytest.raises(InputError, match="locked"):  # and both acts are needed again
        env.reset(seed=0)
    env.close()


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"motor": "steam"}, "there is no 'steam'"),
        ({"interface": "socketcan"}, "channel"),
        ({"interface": "virtual", "channel": "x", "virtual": {"seed": 1}}, "stepped"),
        ({"watchdog": True}, "watchdog"),
        ({"torque_cap": 1.0, "limits": Limits()}, "limits are given too"),
        ({"torque_cap": 8.0}, "rating"),
        ({"patience": 0.5}, "patience"),
        ({"patience": 11.0}, "patience"),
        ({"colour": "red"}, "there is no option 'colour'"),
    ],
)
def test_what_cannot_be_is_told_before_a_bus_is_opened(options, complaint):
    with pytest.raises(InputError, match=complaint):
        rig(**options)


def held_up(patience):
    """Limits, and how an episode ended in which three cycles in four were 3 ms late."""
    env = rig(motor="senso_wheel", patience=patience)  # no counter: two answers at once are no miss
    env.reset(seed=0)
    session, virtual, waiting = env.unwrapped.session, virtual_of(env), []
    receive = session.link.receive

    def late(timeout):
        if waiting:
            virtual.advance(waiting.pop())  # somebody else has the processor
        return receive(timeout)

    session.link.receive = late
    for k in range(40):
        if k % 4:
            waiting.append(3e-3)
        _, _, _, ended, info = env.step(np.zeros(1, np.float32))
        if ended:
            break
    env.close()
    return session.safety.limits, info["ended"]


def test_patience_lets_cycles_be_late_and_moves_no_other_limit():
    (usual, tripped), (patient, ended) = held_up(1.0), held_up(5.0)
    assert tripped == "tripped: the measurement is stale"
    assert ended == ""
    changed = {name for name in Limits._fields if getattr(usual, name) != getattr(patient, name)}
    assert changed == {"stale_after", "longest_cycle"}


def test_it_draws_nothing():
    with pytest.raises(ValueError, match="draws nothing"):
        RigEnv(render_mode="human")
