"""The quadratic programme of mpc: its matrices, its solution, its limits, and what they are worth."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import product

import daqp
import numpy as np
import pytest
from scipy.optimize import nnls

import controllers
from controllers import CAUSALITIES, mpc_moves
from controllers.mpc_design import MOVES, condensed, cost_to_go, interpolation, lq_gain, problem_of
from controllers.mpc_moves import UNSOLVED, code_of, keeps_limits, limits, next_command, signs_of, solved
from experiments.measures import rms
from experiments.rollout import run
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.interface import Observation
from steer_env.plants import PLANTS, Reference
from tests.controllers.stepped_episode import assert_steps_are_the_rollout

NONE = np.zeros((3, 3))
SLOW, WEAK = {"slew_rate": 30.0}, {"rated_torque": 0.5}  # of an EPAS motor: limits that a chirp meets


@cache
def limited_plant(name="EPAS", **motor):
    return replace(PLANTS[name], motor=PLANTS[name].motor._replace(**motor))


def made(plant, causality="impedance", **gains):
    return controllers.make("mpc", plant, Reference.load("published"), causality, tuned=False, **gains)


def problem(plant):
    return problem_of(plant, PERIOD, made(plant).parameters.effort)


def starts(n, seed, p):
    """(forward, last, z) around the limits of a law with parameters p; a third needs more than the motor has."""
    rng = np.random.default_rng(seed)
    reach = p.rated_torque * rng.choice([0.3, 1.0, 3.0], n)
    z = rng.standard_normal((n, 3)) * [5.0 / p.c_tb, 100.0 / p.c_tb, 0.3 * p.rated_torque]
    return zip((reach * rng.uniform(-1, 1, n)).tolist(), rng.uniform(-1, 1, n) * p.rated_torque, z, strict=True)


@pytest.mark.parametrize("name", PLANTS)
def test_without_limits_it_is_the_lq_regulator(name):
    """Catches a wrong condensation: K of the Riccati equation must come out of the programme."""
    q = problem(PLANTS[name])
    for moves in ([0], range(3), range(40)):
        np.testing.assert_allclose(condensed(q, moves, cost_to_go(q)).best[0], -lq_gain(q)[0], rtol=1e-9)
    long = condensed(q, range(250), NONE).best[0]
    np.testing.assert_allclose(long, -lq_gain(q)[0], rtol=1e-6)
    assert abs(condensed(q, range(2), NONE).best[0] / lq_gain(q)[0] + 1.0).max() > 0.1, "a short horizon alone is not"


def simulated(q, v, z):
    """Cost of targets v from a start z, period by period, and of the rest by the LQ optimum."""
    cost = 0.0
    for target in v:
        cost += z @ q.cost @ z + q.effort[0, 0] * target**2
        z = q.step @ z + q.push[:, 0] * target
    return cost + z @ cost_to_go(q) @ z


@pytest.mark.parametrize("moves", [MOVES, (0, 3, 10)])
def test_the_programme_is_the_cost_of_what_would_happen(moves):
    """Catches a period counted twice, a move held where it should bend, a wrong end."""
    q = problem(PLANTS["EPAS"])
    programme = condensed(q, moves, cost_to_go(q))
    place = interpolation(moves)
    rng = np.random.default_rng(0)
    scale = simulated(q, place @ np.eye(len(moves))[0], np.zeros(3)) / (0.5 * programme.H[0, 0])
    for _ in range(20):
        z, v = rng.standard_normal(3) * [0.1, 1.0, 1.0], rng.standard_normal(len(moves))
        expected = simulated(q, place @ v, z) - simulated(q, np.zeros(moves[-1] + 1), z)
        found = scale * (0.5 * v @ programme.H @ v + v @ programme.slopes @ z)
        assert found == pytest.approx(expected, rel=1e-9)
        gradient = programme.H @ programme.best @ z + programme.slopes @ z
        np.testing.assert_allclose(gradient, 0.0, atol=1e-9)


def linear_of(p, z):
    return p.slopes @ z


@pytest.mark.parametrize(("name", "motor"), [("EPAS", ()), ("EPAS", SLOW), ("EPAS", WEAK), ("SbW", ())], ids=str)
def test_a_command_is_the_solution_of_the_programme(name, motor):
    """Karush-Kuhn-Tucker over random starts: multipliers of the right sign must balance the gradient."""
    p = made(limited_plant(name, **dict(motor))).parameters
    rows = np.vstack([np.eye(len(MOVES)), p.increments])
    cut, active = 0, 0.0
    for forward, last, z in starts(1500, 1, p):
        low, high = limits(forward, last, p)
        linear = linear_of(p, z)
        command, active = next_command(forward, last, *z.tolist(), active, p)
        cold, _, flag, _ = daqp.solve(p.H, linear, p.increments, high, low, primal_tol=1e-10)
        assert flag == 1
        assert command - forward == pytest.approx(cold[0], abs=1e-8 * (1.0 + abs(cold[0])))
        if keeps_limits(forward, last, *z.tolist(), p):
            assert active == 0.0
            continue
        cut += 1
        v, now = solved(p.H, p.increments, linear, low, high, 0.0)
        assert now == active
        signs = signs_of(now, high.size)
        margin = np.minimum(rows @ v - low, high - rows @ v)
        assert margin.min() > -1e-9, "a limit is broken"
        assert np.abs(margin[signs != 0.0]).max(initial=0.0) < 1e-9, "a limit that acts is not touched"
        gradient = p.H @ v + linear
        balance = nnls((rows * -signs[:, None])[signs != 0.0].T, gradient)[1]
        assert balance < 1e-8 * (1.0 + np.abs(linear).max())
    assert cut > 300, "and yet limits acted"


def test_a_warm_start_changes_the_work_and_not_the_result():
    """Catches a solver that stops where it starts; the iterations show that it is used at all."""
    p = made(limited_plant(**SLOW)).parameters
    rng = np.random.default_rng(2)
    for forward, last, z in starts(500, 3, p):
        low, high = limits(forward, last, p)
        linear = linear_of(p, z)
        v, now = solved(p.H, p.increments, linear, low, high, 0.0)
        other = code_of(rng.integers(-1, 2, high.size).astype(float))
        for start in (now, other, UNSOLVED):
            again, same = solved(p.H, p.increments, linear, low, high, start)
            np.testing.assert_allclose(again, v, rtol=1e-9, atol=1e-9)
            assert same == now
        if now > 0.0:
            start = signs_of(now, high.size)
            steps = [
                daqp.solve(p.H, linear, p.increments, high, low, **warm)[3]["iterations"]
                for warm in ({"dual_start": start}, {})
            ]
            assert steps[0] <= steps[1]


def test_a_set_of_limits_is_one_number():
    rng = np.random.default_rng(0)
    for n in (1, 10, 33):
        for _ in range(50):
            signs = rng.integers(-1, 2, n).astype(float)
            np.testing.assert_array_equal(signs_of(code_of(signs), n), signs)
    assert code_of(np.zeros(10)) == 0.0


@pytest.mark.parametrize("causality", CAUSALITIES)
@pytest.mark.parametrize("motor", [{}, SLOW, WEAK], ids=str)
def test_a_command_never_exceeds_what_the_motor_can_do(causality, motor):
    """Random observations, far outside what a steering system shows: rated torque and slew rate hold exactly."""
    plant = limited_plant(**motor)
    law, limit = made(plant, causality), plant.motor
    rng = np.random.default_rng(4)
    for size in (1.0, 100.0):
        law.reset(PERIOD)
        last = (0.0, 0.0, 0.0, 0.0)
        for row in size * rng.standard_normal((150, 13)) * [1, 10, 200, 5, 2, 20, 200, 20, 0, 0, 0, 0, 0]:
            command = law(Observation(*row[:8].tolist(), 20.0, *last))
            assert abs(command) <= limit.rated_torque
            assert abs(command - last[0]) <= limit.slew_rate * PERIOD * (1.0 + 1e-9)
            last = (command, *last[:3])


def test_where_no_solution_is_found_the_command_is_the_clipped_one(monkeypatch):
    """A real-time law must go on; that it happened stays visible in the state."""
    p = made(limited_plant(**WEAK)).parameters
    n = len(MOVES)
    assert solved(p.H, p.increments, np.zeros(n), np.ones(2 * n), -np.ones(2 * n), 0.0)[1] == UNSOLVED
    monkeypatch.setattr(mpc_moves, "first_of", lambda *_: (99.0, UNSOLVED))
    assert next_command(2.0, 0.4, 0.0, 0.0, 0.0, 0.0, p) == (0.5, UNSOLVED)


def own_cost(q, p, z, forward, last, planned, periods=500):
    """What regulating the law's own model costs, by mpc or by its LQ gain cut to the motor's limits."""
    gain, cost, active = lq_gain(q)[0], 0.0, 0.0
    for _ in range(periods):
        if planned:
            command, active = next_command(forward, last, *z.tolist(), active, p)
        else:
            bend = p.slew_rate * PERIOD
            command = np.clip(np.clip(forward - gain @ z, last - bend, last + bend), -p.rated_torque, p.rated_torque)
        v = command - forward
        cost += z @ q.cost @ z + q.effort[0, 0] * v * v
        z, last = q.step @ z + q.push[:, 0] * v, command
    return cost


def test_on_its_own_model_knowing_the_slew_rate_pays():
    """Twist of 5 N m rms and a motor that turns slowly: never dearer than the cut LQ gain, far cheaper on average."""
    plant = limited_plant(**SLOW)
    q, p = problem(plant), made(plant).parameters
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(20):
        forward, last = rng.uniform(-0.8, 0.8), rng.uniform(-1.0, 1.0)
        z = np.array([5.0 / p.c_tb * rng.standard_normal(), 0.5 * rng.standard_normal(), last - forward])
        costs = [own_cost(q, p, z, forward, last, planned) for planned in (True, False)]
        shares.append(costs[0] / costs[1])
    assert max(shares) < 1.0 + 1e-6
    assert np.mean(shares) < 0.85


@pytest.mark.parametrize("causality", CAUSALITIES)
def test_with_limits_acting_python_and_machine_code_give_the_same_bits(causality):
    """The call of DAQP out of compiled code; on the shipped plants hardly a limit acts, so here it must."""
    plant = limited_plant(**SLOW, rated_torque=0.8)
    task = Task(plant, causality, "published", driver="tense", duration=0.6, amplitude=0.6)
    law = made(plant, causality)
    active = []

    def watch() -> None:
        active.append(law.state().active)
        assert active[-1] != UNSOLVED

    assert_steps_are_the_rollout(law, task, watch)
    assert sum(state > 0.0 for state in active) > 20


EPISODE = """
import hashlib
from dataclasses import replace
import controllers
from experiments.rollout import run
from steer_env.envs.task import Task
from steer_env.plants import EPAS, Reference
plant = replace(EPAS, motor=EPAS.motor._replace(slew_rate=30.0))
law = controllers.make("mpc", plant, Reference.load("published"), "impedance", tuned=False)
task = Task(plant, "impedance", "published", driver="tense", amplitude=0.6, duration=2.0)
print(hashlib.sha256(run(task, law, 5).signals.tobytes()).hexdigest())
"""


def test_threads_and_another_process_give_the_same_bits(capsys):
    """Catches a solver shared between threads, and machine code whose call of DAQP does not survive the disk."""
    exec(EPISODE, {})
    here = capsys.readouterr().out
    there = subprocess.run([sys.executable, "-W", "error", "-c", EPISODE], capture_output=True, text=True, check=True)
    assert there.stdout == here
    plant = limited_plant(**SLOW)
    task = Task(plant, "impedance", "published", driver="tense", amplitude=0.6, duration=2.0)

    def signals(_):
        return run(task, made(plant), 5).signals

    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(signals, range(4)))
    assert all(np.array_equal(result, results[0]) for result in results)


def test_the_unknown_load_is_taken_off():
    """Hardware with twice the friction and damping that the design was told; the estimate off, the error stays."""
    nominal = PLANTS["EPAS"]
    worn = nominal.steering._replace(M_fric=2.0 * nominal.steering.M_fric, b_pin=2.0 * nominal.steering.b_pin)
    task = Task(replace(nominal, steering=worn), "admittance", "published", manoeuvre="steady_state", duration=10.0)
    error = {load: rms(run(task, made(nominal, "admittance", load=load), seed=1)["error"]) for load in (0.6, 0.01)}
    assert error[0.6] < 0.5 * error[0.01]


@pytest.mark.parametrize(("name", "causality"), list(product(PLANTS, CAUSALITIES)))
def test_knowing_the_limits_costs_nothing_where_a_chirp_meets_the_rated_torque(name, causality):
    """Against the same law that does not know them and is cut: a plan that trusts its model too far does worse."""
    plant = limited_plant(name, rated_torque={"EPAS": 0.5, "SbW": 5.5}[name])
    task = Task(plant, causality, "published", driver="relaxed", speed_kmh=105.0)
    knowing = run(task, made(plant, causality), seed=1)
    cut = run(task, made(plant, causality, rated_torque=50.0, slew_rate=1e6), seed=1)
    assert np.mean(np.abs(knowing["command"]) >= 0.999 * plant.motor.rated_torque) > 0.005
    assert rms(knowing["error"]) < 1.02 * rms(cut["error"])
