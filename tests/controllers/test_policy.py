"""The policy as a controller: the contract, what is held between two steps, and files that are wrong."""

import json
import pickle
import subprocess
import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import controllers
from controllers import CAUSALITIES, policy, policy_file, policy_law
from experiments.law_half import law_half
from experiments.learning.scoring import training_score
from experiments.linear_loop import closed_loop, environment_half, modes
from experiments.operating_points import place_of
from experiments.periodic_loop import growing, step_modes
from experiments.rollout import run
from experiments.step_times import compiled_passes, recorded
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.errors import InputError
from steer_env.interface import Controller, Observation
from steer_env.plants import DRIVERS, PLANTS, Reference
from tests.controllers.made_up_policy import made_up
from tests.controllers.stepped_episode import assert_steps_are_the_rollout

REFERENCE = Reference.load("published")
LOOPS = list(product(("pid", None), PLANTS, CAUSALITIES))


def controller_of(found, **gains):
    return policy.of(found, PLANTS[found.plant], REFERENCE, **gains)


def observations(n, seed=0, size=1.0):
    rng = np.random.default_rng(seed)
    scale = np.array([1.0, 10.0, 200.0, 5.0, 2.0, 20.0, 200.0, 20.0, 0.0, 2.0, 2.0, 2.0, 2.0])
    rows = size * scale * rng.standard_normal((n, len(scale)))
    rows[:, Observation._fields.index("speed")] = rng.uniform(1.0, 50.0, n)
    return [Observation(*row.tolist()) for row in rows]


def torques(controller, seen):
    controller.reset(PERIOD)
    return [controller(observation) for observation in seen]


@pytest.mark.parametrize(("base", "plant", "causality"), LOOPS)
def test_the_contract(base, plant, causality):
    """Catches a missing method, hidden state, a NaN, an offset, and a left turn that is not a right turn."""
    controller = controller_of(made_up(plant, causality, base))
    assert isinstance(controller, Controller)
    seen = observations(60)
    first = torques(controller, seen)
    assert len(set(first)) > 10
    assert torques(controller, seen) == first, "reset must forget"
    assert torques(controller_of(made_up(plant, causality, base)), seen) == first, "same policy, same torque"
    assert np.isfinite(torques(controller, observations(60, 1, size=100.0))).all()
    mirrored = [Observation(*(-v for v in o))._replace(speed=o.speed) for o in seen]
    np.testing.assert_allclose(torques(controller, mirrored), np.negative(first), rtol=1e-9)
    rest = Observation(*[0.0] * 13)._replace(speed=20.0)
    assert torques(controller, [rest] * 7) == [0.0] * 7


@pytest.mark.parametrize("squashed", [False, True])
@pytest.mark.parametrize(("plant", "causality"), [("EPAS", "admittance"), ("SbW", "impedance")])
def test_python_and_machine_code_give_the_same_bits(plant, causality, squashed):
    """Catches a law that only looks the same in a rollout: an int, a sum in another order, a global."""
    task = Task(plant, causality, REFERENCE, duration=0.3)
    assert_steps_are_the_rollout(controller_of(made_up(plant, causality, squashed=squashed)), task)


@pytest.mark.parametrize(("plant", "causality"), list(product(PLANTS, CAUSALITIES)))
def test_a_policy_that_does_nothing_is_its_base_law_bit_for_bit(plant, causality):
    """Catches a base law with other gains, called at another rate, or whose state is lost."""
    task = Task(plant, causality, REFERENCE, manoeuvre="on_centre_weave", duration=3.0)
    bare = controllers.make("pid", PLANTS[plant], REFERENCE, causality, tuned=False)
    signals = [run(task, law, seed=1).signals for law in (bare, controller_of(made_up(plant, causality, size=0.0)))]
    assert np.array_equal(*signals)


def test_an_action_is_held_until_the_next_step_of_the_policy():
    """Seen through a law without base and without lag: catches decimation that drifts or starts late."""
    found = made_up("EPAS", base=None, bandwidth_Hz=0.0, authority=1.0, size=0.3, shares=((0.0, 1.0),))
    controller = controller_of(found)
    given = np.array(torques(controller, observations(40))).reshape(-1, controller.decimation)
    assert controller.decimation == 5
    assert (given == given[:, :1]).all()
    assert (np.diff(given[:, 0]) != 0.0).all()
    controller.reset(0.5e-3)
    assert controller.decimation == 10, "the same times on a faster loop"
    with pytest.raises(InputError, match="no multiple"):
        controller.reset(2e-3)


def test_the_share_goes_through_its_rows_and_holds_at_its_ends():
    rows = np.array([[5.0, 0.5], [10.0, 1.0], [20.0, 0.2]])
    for speed, share in ((1.0, 0.5), (5.0, 0.5), (7.5, 0.75), (10.0, 1.0), (15.0, 0.6), (30.0, 0.2)):
        assert policy_law.share_at(speed, rows) == pytest.approx(share)
    assert policy_law.share_at(7.0, rows[:1]) == 0.5
    one, half = (controller_of(made_up(base=None, shares=((0.0, share),))) for share in (1.0, 0.5))
    seen = observations(20)
    np.testing.assert_allclose(torques(half, seen), 0.5 * np.array(torques(one, seen)), rtol=1e-12)


def test_the_lag_and_the_relief_are_what_they_say():
    """A step through the lag after n periods: 1 - exp(-2 pi f n T); beyond the slope limit limit / slope."""
    found = made_up("EPAS", "admittance", base=None, size=0.0)
    p = controller_of(found).parameters
    m = policy_law.Memory(action_1=1.0)
    for n in range(1, 40):
        value, m = policy_law.smoothed(m, p)
        assert value == pytest.approx(1.0 - np.exp(-2.0 * np.pi * 20.0 * n * PERIOD), rel=1e-12)
    o = Observation(*[0.0] * 13)._replace(speed=75.0 / 3.6)
    assert policy_law.relief(o, p) == 1.0
    steep = policy_law.relief(o._replace(torsion_bar_torque=4.0), p)
    from controllers.blocks import assist_slope
    from controllers.schedule import felt_at

    assert steep == pytest.approx(4.0 / assist_slope(4.0, felt_at(o.speed, p.schedule)))
    assert steep < 0.6
    assert policy_law.relief(o._replace(torsion_bar_torque=4.0), p._replace(admittance=0.0)) == 1.0


def test_one_step_takes_less_than_20_us():
    found = made_up("EPAS", "admittance")
    rng = np.random.default_rng(0)
    wide = {"first": rng.standard_normal((34, 64)), "second": rng.standard_normal((64, 64)) / 8.0}
    controller = controller_of(replace(found, weights={**wide, "last": rng.standard_normal(64)}, sample_time=PERIOD))
    rows = recorded(Task("EPAS", "admittance", REFERENCE), controller, 2000)
    controller.reset(PERIOD)
    _, times, _ = compiled_passes(controller.law, controller.state(), controller.parameters, rows, 3)
    assert np.median(times.min(axis=0)) < 20e3, "ns, the clock included, the network in every period"


def test_files_hold_the_policy_and_no_torch_is_needed(tmp_path):
    """Catches a number that a file rounds, and an import that makes a rig carry a learning library."""
    found = made_up("SbW", "admittance")
    policy_file.save(found, tmp_path)
    read = policy_file.load(tmp_path)
    for name, value in found.weights.items():
        assert np.array_equal(read.weights[name], value)
    assert replace(read, weights={}, source="") == replace(found, weights={}, source="")
    code = (
        "import sys, controllers\nfrom steer_env.plants import PLANTS, Reference\n"
        f"name, reference = 'policy:{tmp_path.as_posix()}', Reference.load('published')\n"
        "law = controllers.make(name, PLANTS['SbW'], reference, 'admittance')\n"
        "print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"torch", "stable_baselines3"} & set(done.stdout.split())


class Trap:
    """What a pickle can do to whoever reads it."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


def test_files_that_are_wrong_are_refused_and_never_run(tmp_path):
    """Truncated, pickled, mixed up, with NaN, of another shape: catches a reader that trusts, or that unpickles."""
    found = made_up()

    def broken(mend, **changed):
        policy_file.save(replace(found, **changed), tmp_path)
        mend()
        with pytest.raises(InputError) as told:
            policy_file.load(tmp_path)
        assert str(tmp_path) in str(told.value)

    weights, described = tmp_path / policy_file.WEIGHTS, tmp_path / policy_file.DESCRIPTION
    trap = tmp_path / "sprung"
    for content in (weights_cut(found, tmp_path), b"", pickle.dumps(Trap(trap)), b"\xff" * 64):
        broken(lambda content=content: weights.write_bytes(content))
        broken(lambda content=content: described.write_bytes(content))
    assert not trap.exists()
    broken(lambda: weights.unlink())
    broken(lambda: described.write_text("[1, 2]"))
    broken(lambda: described.write_text(json.dumps({**json.loads(described.read_text()), "schema_version": 99})))
    broken(lambda: described.write_text(json.dumps({**json.loads(described.read_text()), "authority": "much"})))
    broken(lambda: policy_file.save(made_up(seed=1), tmp_path / "other") or other_weights(tmp_path))
    broken(lambda: None, weights={**found.weights, "last": np.full(5, np.nan)})
    broken(lambda: None, weights={**found.weights, "last": np.zeros(4)})
    broken(lambda: None, scales=(1.0,) * 16)
    broken(lambda: None, sample_time=0.0)


def weights_cut(found, folder):
    policy_file.save(found, folder)
    return (folder / policy_file.WEIGHTS).read_bytes()[:-7]


def other_weights(folder):
    (folder / policy_file.WEIGHTS).write_bytes((folder / "other" / policy_file.WEIGHTS).read_bytes())


def test_names(tmp_path):
    policy_file.save(made_up("SbW", "impedance"), tmp_path)
    law = controllers.make(f"policy:{tmp_path}", PLANTS["SbW"], REFERENCE, "impedance", authority=0.5)
    assert law.parameters.authority == 0.5
    wrapped = controllers.make(f"passivity:policy:{tmp_path}", PLANTS["SbW"], REFERENCE, "impedance")
    assert np.isfinite(torques(wrapped, observations(20))).all()
    with pytest.raises(InputError, match="trained for SbW"):
        controllers.make(f"policy:{tmp_path}", PLANTS["EPAS"], REFERENCE, "impedance")
    with pytest.raises(InputError, match="trained for impedance"):
        controllers.make(f"policy:{tmp_path}", PLANTS["SbW"], REFERENCE, "admittance")
    with pytest.raises(InputError, match="no such file"):
        controllers.make(f"policy:{tmp_path / 'nowhere'}", PLANTS["SbW"], REFERENCE, "impedance")
    with pytest.raises(InputError, match="none is shipped for lorry-impedance"):
        controllers.make("policy", replace(PLANTS["SbW"], name="lorry"), REFERENCE, "impedance")


def test_modes_over_a_step_are_those_of_a_period_where_the_policy_does_nothing():
    """exp(rate * step) is what five periods multiply to: catches periods in the wrong order, and a mode left out."""
    place = place_of(PLANTS["SbW"], "impedance", REFERENCE, 75.0, "centre_stuck")
    arms = [DRIVERS["relaxed"]]
    bare = controllers.make("pid", PLANTS["SbW"], REFERENCE, "impedance", tuned=False)
    slow = modes(closed_loop(environment_half(place, arms), law_half(bare, place)))[0]
    found = step_modes(controller_of(made_up("SbW", size=0.0)), place, arms)[0]
    below = slow[slow.imag < np.pi / 5e-3 - 1.0]
    assert below.size >= 6
    for rate in below[:6]:
        assert np.abs(found - rate).min() < 1e-5 * abs(rate)


def test_modes_over_a_step_grow_as_a_simulated_loop_does():
    """A gain on the bar's torque that shakes: unstable by its modes, and so in an episode."""
    weights = {"first": np.zeros((34, 1)), "second": np.ones((1, 1)), "last": np.full(1, 1.0)}
    weights["first"][policy_law.Signals._fields.index("error"), 0] = 1.0
    shaky = made_up("SbW", weights=weights, authority=12.0, bandwidth_Hz=30.0)
    place = place_of(PLANTS["SbW"], "impedance", REFERENCE, 75.0, "centre_stuck")
    assert step_modes(controller_of(shaky), place, [DRIVERS["relaxed"]])[0][0].real > 5.0
    calm = replace(shaky, authority=0.01)
    assert step_modes(controller_of(calm), place, [DRIVERS["relaxed"]])[0][0].real < 0.0
    task = Task("SbW", "impedance", REFERENCE, manoeuvre="standstill", driver="relaxed", duration=2.0)
    bar = [run(task, controller_of(found), seed=0)["torsion_bar_torque"] for found in (calm, shaky)]
    assert np.abs(bar[1]).max() > 20.0 * np.abs(bar[0]).max()


@pytest.mark.parametrize("name", policy_file.folders())
def test_shipped_policies_are_stable_and_pay(name):
    """Catches a file that was trained over other gains or code: growth, an arm, a score worse than bare."""
    plant, causality = name.split("-")
    law = controllers.make("policy", PLANTS[plant], REFERENCE, causality)
    assert growing(law, plant, causality, REFERENCE, [75.0]) == {}
    for arm, driver in DRIVERS.items():
        manoeuvre = "random_torque" if driver.k == 0.0 else "on_centre_weave"
        task = Task(plant, causality, REFERENCE, False, None, manoeuvre, 60.0, arm, duration=4.0)
        assert run(task, law, seed=1).stable, arm
    assert law.policy.training["config"]["action"]["base"] == law.policy.base
    scores = [
        training_score(make, plant, causality, REFERENCE, speeds_kmh=(60.0, 90.0))
        for make in (controllers.maker("policy"), lambda p, r, _: policy.base_of(law.policy, p, r))
    ]
    assert scores[0].jnd < scores[1].jnd


def test_one_is_shipped_for_each_causality():
    assert {name.split("-")[1] for name in policy_file.folders()} == set(CAUSALITIES)
