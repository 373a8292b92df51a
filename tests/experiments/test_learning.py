"""Training: what the learner sees is what the controller does, and nothing is lost when a run is killed."""

import json
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from controllers import policy, policy_file
from controllers.blocks import NotchState
from controllers.policy_law import Memory, PolicyState, Signals, action_of
from experiments.bench_protocol import Protocol
from experiments.learning import domain
from experiments.learning.config import Domain, TrainConfig
from experiments.learning.kernel import ANGLE_FLOOR, ENERGY_ALLOWANCE, TORQUE_FLOOR, Judged, judged_after
from experiments.learning.records import nested_loader, nested_storer, numbers_in, size_of
from experiments.measures import JND
from experiments.train import config_of
from steer_env.envs.layout import PERIOD, Truth
from steer_env.envs.period import control_period
from steer_env.errors import InputError
from steer_env.interface import Observation
from steer_env.plants import PLANTS, Reference
from tests.controllers.made_up_policy import made_up

pytest.importorskip("stable_baselines3", reason="extra [learn] is not installed")
import torch

from experiments.learning import run as running
from experiments.learning.agent import actors_of, make_agent, weights_of
from experiments.learning.arrangement import Arrangement, Scales
from experiments.learning.run import Run
from experiments.learning.vec_env import PolicyVecEnv

REFERENCE = Reference.load("published")
SMALL = {"learning.environments": "8", "learning.rollout": "16", "learning.batch": "64", "learning.steps": "640",
         "learning.warm_up": "64", "learning.buffer": "400"}  # fmt: skip
SCALES = Scales((0.3, 0.5, 2.0, 30.0, 2.0, 2.0, 100.0, None, 7.0, 1.0, 0.3, 5.0, 1.0, 0.5, 0.5, 0.5, 0.5), 0.3)


class EnergyPair(NamedTuple):
    first: float
    notch: NotchState


def small(algorithm="ppo", **settings):
    named = {name.replace("__", "."): value for name, value in settings.items()}
    return TrainConfig("SbW", "impedance").changed({**SMALL, "learning.algorithm": algorithm, **named})


def environments(config, n=8, scales=SCALES):
    return PolicyVecEnv(Arrangement(config, scales), n, config.reward, 0)


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3"])
def test_exported_is_original(algorithm):
    """Catches a weight that is transposed, an offset, a squashing that differs: 1e-6 against torch itself."""
    config = small(algorithm)
    env = environments(config)
    agent = make_agent(config, env)
    with torch.no_grad():
        for layers in actors_of(agent):
            layers[-1].weight.mul_(1.0 if algorithm != "ppo" else 30.0)
            for layer in layers:
                layer.weight.add_(0.2 * torch.randn_like(layer.weight) * (layer.weight != 0.0))
    agent._last_obs = env.reset()
    exported = replace(
        made_up("SbW", "impedance", weights=weights_of(agent), squashed=algorithm != "ppo"), scales=SCALES.scales
    )
    p = policy.of(exported, PLANTS["SbW"], REFERENCE).parameters
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(30):
        observed = env.observed()
        theirs, _ = agent.predict(observed, deterministic=True)
        ours = [
            action_of(Signals(*signals), float(speed), p)
            for signals, speed in zip(env.signals, env.rows[0].observations[:, 8], strict=True)
        ]
        worst = max(worst, float(np.abs(theirs[:, 0] - ours).max()))
        mirrored, _ = agent.predict(observed * np.append(np.full(34, -1.0), 1.0).astype(np.float32), deterministic=True)
        np.testing.assert_allclose(mirrored, -theirs, atol=1e-6)
        env.step(rng.uniform(-1.0, 1.0, (8, 1)))
    assert worst < 1e-6
    assert np.abs(theirs).max() > 1e-3


@pytest.mark.parametrize(("causality", "base"), [("impedance", "pid"), ("admittance", "lqg"), ("impedance", "none")])
def test_the_learner_drives_what_the_controller_drives(causality, base):
    """The same episode in training and with the exported controller, bit for bit: decimation, lag, memory, base law."""
    config = replace(small(), causality=causality).changed({"action.base": base})
    env = environments(config, 2)
    env.reset()
    scales = tuple(None if base == "none" and name == "command" else scale
                   for name, scale in zip(Signals._fields, SCALES.scales, strict=True))  # fmt: skip
    found = made_up("SbW", causality, None if base == "none" else base, scales=scales, authority=0.3,
                    keep=env.arrangement.keep, bandwidth_Hz=12.0, shares=((0.0, 1.0),),
                    base_gains=running.base_gains(config))  # fmt: skip
    controller = policy.of(found, PLANTS["SbW"], REFERENCE)
    rows, seen = env.rows[0], Observation(*env.rows[0].observations[0].tolist())
    states = rows.parameters[0].copy(), rows.states[0].copy(), rows.lines[0].copy()
    noise = np.random.default_rng()
    noise.bit_generator.state = env.rng.bit_generator.state
    for _ in range(100):
        actions = [
            action_of(Signals(*signals), float(o[8]), controller.parameters)
            for signals, o in zip(env.signals, rows.observations, strict=True)
        ]
        env.step(np.array(actions)[:, None])
        for draw in noise.standard_normal((2, 5, 2))[0]:
            seen, _ = control_period(controller(seen), *draw.tolist(), *states, *env._tables[0])
        assert tuple(rows.observations[0].tolist()) == tuple(map(float, seen))


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3"])
def test_a_run_that_is_killed_ends_where_it_would_have_ended(algorithm, tmp_path, monkeypatch):
    """Catches what a checkpoint forgets: an optimiser's moments, a generator, an environment, the replay buffer."""
    monkeypatch.setattr(running, "measured", lambda config: SCALES)
    monkeypatch.setattr(running, "gated", lambda found, reference: found)
    monkeypatch.setattr(running, "CHECKPOINT_S", 0.0)
    config = small(algorithm)
    whole = Run(config, tmp_path / "whole").learn()

    def killed(self):
        if self.run.agent.num_timesteps >= 384:
            raise KeyboardInterrupt
        return True

    folder = tmp_path / "killed"
    with monkeypatch.context() as patch:
        patch.setattr(running._Keeper, "_on_step", killed)
        interrupted = Run(config, folder)
        with pytest.raises(KeyboardInterrupt):
            interrupted.learn()
    assert not (folder / policy_file.DESCRIPTION).exists()
    again = Run(config, folder)
    assert 0 < again.agent.num_timesteps < 640
    resumed = again.learn()
    for name, value in whole.weights.items():
        assert np.array_equal(resumed.weights[name], value), name
    assert policy_file.load(folder).training["steps"] == policy_file.load(tmp_path / "whole").training["steps"] >= 640
    told = json.loads((folder / "run.json").read_text())
    assert {"tracking", "smoothness", "passivity", "effort"} <= set(told["log"][-1])
    assert list((folder / "tensorboard").rglob("events*"))
    with pytest.raises(InputError, match="other settings"):
        Run(replace(config, seed=1), folder)
    (folder / "checkpoint.pt").write_bytes(b"nothing")
    with pytest.raises(InputError, match="no checkpoint"):
        Run(config, folder)


def test_scales_are_stored_and_hide_what_is_not_to_be_seen(tmp_path, monkeypatch):
    """Catches a normalisation that stays in the learner, and a history that leaks."""
    monkeypatch.setattr(running, "gated", lambda found, reference: found)
    from experiments.learning import calibration

    monkeypatch.setattr(calibration, "SECONDS", 2.0)
    found = Run(small(), tmp_path).learn()
    read = policy_file.load(tmp_path)
    assert read.scales == found.scales
    shown = dict(zip(Signals._fields, read.scales, strict=True))
    assert shown["reference_acceleration"] is None, "always zero in impedance"
    assert [shown[f"action_{k}"] for k in (1, 2, 3, 4)] == [None] * 4
    assert 0.5 < shown["command"] < 10.0
    assert read.authority == pytest.approx(0.3 * shown["command"], rel=1e-2)
    more = Arrangement(small(action__history="2"), SCALES)
    assert more.config.action.history == 2
    from experiments.learning.arrangement import visible

    seen = dict(zip(Signals._fields, visible(more.config, np.ones(17)), strict=True))
    assert (seen["action_2"], seen["action_3"]) == (0.5, None)


def test_plants_come_from_the_training_seeds_alone(monkeypatch):
    """Catches a learner that meets the plants it will be scored on."""
    drawn = []
    real = np.random.default_rng

    def watched(seed=None):
        drawn.append(seed)
        return real(seed)

    monkeypatch.setattr(domain.np.random, "default_rng", watched)
    drawer, rng = domain.Drawer("EPAS", "impedance", REFERENCE, Domain()), real(0)
    rows = [drawer.draw(rng)[0].row for _ in range(30)]
    first, end = Protocol.load().draw_seeds["training"]
    assert len(set(drawn)) == 30
    assert all(first <= seed < end for seed in drawn)
    test = Protocol.load().draw_seeds["test"]
    assert end <= test[0] or test[1] <= first
    assert len({tuple(row) for row in rows}) == 30
    with pytest.raises(InputError, match="frequency_response"):
        domain.Drawer("EPAS", "impedance", REFERENCE, Domain(manoeuvres=("loop",)))


def test_parts_of_the_reward_in_closed_form():
    """One JND of error costs 1; energy beyond the reference's costs what exceeds the allowance; a floor at rest."""
    rest = Truth(*[0.0] * len(Truth._fields))
    long = Judged(periods=1e6, square=1e6 * 4.0)
    tracking, _, after = judged_after(rest._replace(error=JND * 2.0, reference=2.0), long, 0.0)
    assert tracking == pytest.approx(-1.0)
    assert after.periods == 1e6 + 1.0
    for admittance, floor in ((0.0, TORQUE_FLOOR), (1.0, ANGLE_FLOOR)):
        assert judged_after(rest._replace(error=-JND * floor), Judged(), admittance)[0] == pytest.approx(-1.0)
    given = rest._replace(pinion_angle=0.1, error=-3.0 * ENERGY_ALLOWANCE / 0.1)
    assert judged_after(given, Judged(), 0.0)[1] == pytest.approx(-2.0)
    yielded = rest._replace(pinion_angle=0.1, reference=0.3, torsion_bar_torque=2.0 * ENERGY_ALLOWANCE / 0.2)
    assert judged_after(yielded, Judged(), 1.0)[1] == pytest.approx(-1.0)
    assert judged_after(given._replace(error=5.0), Judged(), 0.0)[1] == 0.0, "a damper costs nothing"
    _, _, kept = judged_after(rest, Judged(energy=1.0), 0.0)
    assert kept.energy == pytest.approx(1.0 - PERIOD / 0.5)


def test_nested_records_survive_a_row():
    """Catches a field that moves when a record holds a record."""
    state = PolicyState(EnergyPair(1.0, NotchState(2.0, 3.0)), 4.0, Memory(*np.arange(5.0, 14.0).tolist()))
    row = np.zeros(20)
    nested_storer(state, 3)(row, state)
    assert size_of(state) == 13
    assert row[3:16].tolist() == numbers_in(state) == list(map(float, range(1, 14)))
    assert nested_loader(state, 3)(row) == state


def test_settings_by_name():
    config = config_of("steer_env/EPAS-Admittance-v0", 3, {"learning.hidden": "64,64", "domain.randomise": "false"})
    assert (config.plant, config.causality, config.seed) == ("EPAS", "admittance", 3)
    assert config.learning.hidden == (64, 64)
    assert config.domain.randomise is False
    for task, settings in (("EPAS", {}), ("EPAS-Impedance", {"learning.speed": "1"}), ("EPAS-Impedance", {"seed": "1"}),
                           ("EPAS-Impedance", {"learning.gamma": "much"}),
                           ("EPAS-Impedance", {"learning.algorithm": "dqn"})):  # fmt: skip
        with pytest.raises(InputError):
            config_of(task, 0, settings)


def test_several_references_share_the_environments():
    """Catches a base law or a table of one reference under the episodes of another."""
    config = small(domain__references="published,published")
    env, one = environments(config, 5), environments(small(), 5)
    env.reset(), one.reset()
    assert [group.size for group in env.groups] == [3, 2]
    for _ in range(20):
        observed, rewards, _, _ = env.step(np.zeros((5, 1)))
        same, others, _, _ = one.step(np.zeros((5, 1)))
    assert np.array_equal(observed, same)
    assert np.array_equal(rewards, others)
