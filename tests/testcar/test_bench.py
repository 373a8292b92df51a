"""The virtual bench against closed forms, energy, and what a hidden effect must not give away."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.campaign import read_campaign
from steer_env.physics.bench import contact_impulse
from steer_env.physics.effects.rig_ports import rig_row
from steer_env.testcar.bench import (
    ENCODER_STEP,
    LOADED,
    LOG_PERIOD,
    RECORD,
    Bench,
    Command,
    bench_campaign,
    bench_for,
    bench_rollout,
)

FREE = Command(stiffness=0.0, damping=0.0)
PLAY = {"backlash": {"half_gap_rad": 0.01, "wheel_share": 0.6}}


def rolled(feed: np.ndarray, command: Command = FREE, bench: Bench | None = None, hidden=None) -> dict[str, np.ndarray]:
    """Columns of a rollout without noise and without what an ordinary bench leaves."""
    row = rig_row(hidden) if hidden else None
    record = bench_rollout(feed, np.zeros(feed.size), command, bench or Bench(), row, None)
    return {name: record[:, k] for k, name in enumerate(RECORD)}


def phasor(signal: np.ndarray, frequency: float) -> complex:
    t = LOG_PERIOD * np.arange(signal.size)
    return complex(2.0 * np.mean(signal * np.exp(-2j * np.pi * frequency * t)))


@pytest.mark.parametrize("frequency", [0.5, 2.0, 10.0])
@pytest.mark.parametrize("delay", [0.0, 0.0045])
def test_a_sine_is_answered_as_J_and_b_do(frequency: float, delay: float) -> None:
    """H = exp(-s (delay + half a sample)) / (J s^2 + b s + k): a held command is half a sample late, and no more.

    Catches a delay rounded to steps, and an integrator that lets a torque act early.
    """
    t = LOG_PERIOD * np.arange(round(40.0 / LOG_PERIOD))
    p = Bench(J=0.04, b=0.3)
    seen = rolled(np.sin(2.0 * np.pi * frequency * t), Command(0.8, 0.1, delay), p)
    late = slice(t.size // 2, None)  # the transient is gone after ten time constants
    s = 2j * np.pi * frequency
    held = np.sinc(frequency * LOG_PERIOD) * np.exp(-s * (delay + 0.5 * LOG_PERIOD))
    expected = held / (p.J * s * s + p.b * s)
    measured = phasor(seen["angle"][late], frequency) / phasor(seen["command"][late], frequency)
    assert abs(measured / expected - 1.0) < 1e-3
    assert abs(np.angle(measured / expected)) / (2.0 * np.pi * frequency) < 2e-5  # s


def test_energy_of_a_frictionless_bench_is_kept_and_a_damped_one_gives_it_to_its_damper() -> None:
    """The work that is commanded is kinetic energy plus what b takes; without b nothing is lost in a free turn."""
    n = 4000
    feed = np.where(np.arange(n) < 500, 1.0, 0.0)
    for b in (0.0, 0.2):
        p = Bench(b=b)
        seen = rolled(feed, bench=p)
        work = np.sum(feed[:-1] * np.diff(seen["angle"]))
        lost = p.b * np.sum(seen["rate"][:-1] * np.diff(seen["angle"]))
        kinetic = 0.5 * p.J * seen["rate"][-1] ** 2
        assert work == pytest.approx(kinetic + lost, rel=5e-3)
    assert np.ptp(rolled(feed, bench=Bench(b=0.0))["rate"][600:]) == 0.0


@pytest.mark.parametrize("half_gap", [1e-3, 1e-2, 5e-2])
def test_play_never_makes_energy_and_never_opens_wider_than_it_is(half_gap: float) -> None:
    """Catches a wheel that is stopped or started without a flank, and flanks that pull."""
    n, share = 5000, 0.6
    hidden = {"backlash": {"half_gap_rad": half_gap, "wheel_share": share}}
    t = LOG_PERIOD * np.arange(n)
    feed = np.sin(2.0 * np.pi * 3.0 * t) * (t < 4.0)
    seen = rolled(feed, Command(1.5, 0.0), Bench(b=0.0), hidden)
    J = Bench().J
    kinetic = 0.5 * J * ((1.0 - share) * seen["rate"] ** 2 + share * seen["wheel_rate"] ** 2)
    energy = kinetic + 0.5 * 1.5 * seen["angle"] ** 2
    after = energy[t > 4.01]
    assert after[0] > 0.0
    # The spring is held between samples, which feeds in a little; an impact takes far more.
    held = 0.5 * LOG_PERIOD * 1.5 / J * 2.0 * np.arange(after.size) * LOG_PERIOD
    assert np.all(after <= after[0] * (1.0 + held) + 1e-12)
    assert np.abs(seen["play"]).max() == pytest.approx(half_gap, rel=1e-9)


def test_impact_keeps_momentum_and_ends_at_one_speed() -> None:
    """A free motor hits a wheel at rest: afterwards both turn at J_motor / J of its rate, whatever the gap."""
    n, p, share = 2000, Bench(b=0.0), 0.6
    feed = np.where(np.arange(n) < 5, 1.0, 0.0)
    seen = rolled(feed, bench=p, hidden={"backlash": {"half_gap_rad": 0.02, "wheel_share": share}})
    impulse = float(feed.sum()) * LOG_PERIOD
    assert seen["rate"][6] == pytest.approx(impulse / (p.J * (1.0 - share)), rel=1e-9)
    assert seen["wheel_rate"][6] == 0.0
    assert seen["rate"][-1] == pytest.approx(impulse / p.J, rel=1e-9)
    assert seen["wheel_rate"][-1] == pytest.approx(seen["rate"][-1], rel=1e-9)


def test_contact_pushes_only_where_the_gap_ends() -> None:
    """Hand-calculated: inside the gap nothing, beyond it what brings the play to the flank."""
    assert contact_impulse(0.001, 1.0, 0.01, 20.0, 1e-3) == 0.0
    assert contact_impulse(0.01, 2.0, 0.01, 20.0, 1e-3) == pytest.approx(2.0 / 20.0)
    assert contact_impulse(-0.01, -2.0, 0.01, 20.0, 1e-3) == pytest.approx(-2.0 / 20.0)
    assert contact_impulse(0.01, -2.0, 0.01, 20.0, 1e-3) == 0.0


def test_a_gap_that_is_hardly_there_is_no_gap() -> None:
    """Two masses at a gap of a microradian move as one, to the order of a step (0.25 ms at 2 Hz is 3e-3 rad)."""
    feed = np.sin(2.0 * np.pi * 2.0 * LOG_PERIOD * np.arange(3000))
    rigid = rolled(feed, Command())
    loose = rolled(feed, Command(), hidden={"backlash": {"half_gap_rad": 1e-6, "wheel_share": 0.6}})
    np.testing.assert_allclose(loose["angle"], rigid["angle"], atol=1e-3 * np.abs(rigid["angle"]).max())


def test_an_effect_at_zero_is_absent_to_the_bit_and_compiled_code_is_the_python_code() -> None:
    feed = np.sin(2.0 * np.pi * LOG_PERIOD * np.arange(300))
    noise = 0.01 * np.random.default_rng(1).standard_normal(feed.size)
    everything = {
        "coulomb_friction": {"level_Nm": 0.1}, "torque_ripple": {"amplitude_Nm": 0.05}, **PLAY,
        "quadratic_drag": {"drag_Nms2_per_rad2": 0.01}, "gravity_unbalance": {"sin_Nm": 0.1, "cos_Nm": 0.1},
    }  # fmt: skip
    plain = bench_rollout(feed, noise, Command(), Bench(), None, None)
    assert (bench_rollout(feed, noise, Command(), Bench(), rig_row({}), rig_row({})) == plain).all()
    arguments = (feed, noise, Command(delay=0.0033, gain=1.1, offset=0.02), LOADED, rig_row(everything), None)
    assert (bench_rollout(*arguments) == bench_rollout.py_func(*arguments)).all()


def test_a_campaign_is_read_and_does_not_give_away_what_is_hidden(tmp_path: Path) -> None:
    """Same names, texts and lengths with and without the effect; the same seed gives the same bytes."""
    for name, hidden in (("plain", {}), ("hidden", PLAY), ("again", PLAY)):
        bench_campaign(tmp_path / name, hidden, seed=3, repeats=1)
    files = sorted(p.relative_to(tmp_path / "plain") for p in (tmp_path / "plain").rglob("*") if p.is_file())
    assert files == sorted(p.relative_to(tmp_path / "hidden") for p in (tmp_path / "hidden").rglob("*") if p.is_file())
    assert (tmp_path / "plain/campaign.toml").read_bytes() == (tmp_path / "hidden/campaign.toml").read_bytes()
    for file in files:
        assert (tmp_path / "again" / file).read_bytes() == (tmp_path / "hidden" / file).read_bytes()
    plain, hidden = read_campaign(tmp_path / "plain"), read_campaign(tmp_path / "hidden")
    assert plain.kind == hidden.kind == "rig"
    for one, other in zip(plain.runs, hidden.runs, strict=True):
        assert one.notes == other.notes == []
        assert set(one.channels) == {"motor_angle_rad", "motor_torque_Nm"}
        assert not np.array_equal(one.channels["motor_angle_rad"], other.channels["motor_angle_rad"])
        steps = one.channels["motor_angle_rad"] / ENCODER_STEP
        np.testing.assert_allclose(steps, np.round(steps), atol=2e-2)  # seven digits in the file
        assert np.abs(one.channels["motor_angle_rad"]).max() < 8.0


def test_a_loaded_bench_logs_the_torque_that_the_load_takes(tmp_path: Path) -> None:
    """Sensor torque is k (q - swing) + b q' of the load, to its noise and rounding."""
    bench_campaign(tmp_path / "rig", {}, seed=3, repeats=1, bench=LOADED)
    run = next(r for r in read_campaign(tmp_path / "rig").runs if "b_sine_large" in r.name)
    angle = run.channels["motor_angle_rad"]
    held = LOADED.load_swing * (np.sin(2.3 * run.time) + 0.5 * np.sin(8.2 * run.time))
    load = LOADED.load_stiffness * (angle - held) + LOADED.load_damping * np.gradient(angle, run.dt)
    error = run.channels["sensor_torque_Nm"] - load
    assert abs(float(np.mean(error))) < 1e-3
    assert float(np.std(error)) < 0.02


def test_a_gain_is_hidden_where_a_sensor_can_show_it() -> None:
    """A torque gain always gets the loaded bench; a coin gives it to others too, so that a sensor tells nothing."""
    gain, play = {"torque_gain": {"ratio": 1.1}}, {"backlash": {"half_gap_rad": 0.01}}
    assert all(bench_for(gain, seed) == LOADED for seed in range(20))
    assert {bench_for(play, seed) == LOADED for seed in range(20)} == {True, False}
