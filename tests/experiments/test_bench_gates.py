"""The gates of the benchmark: a wrong controller is named unsafe and stands behind, whatever its mean score."""

import pytest

import controllers
from experiments.bench_cases import Case
from experiments.bench_gates import gates_of, unstable_episodes, unstable_share
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import standings
from experiments.bench_run import run_cases
from steer_env.plants import Reference
from tests.experiments.wrong_controllers import spoilt

REFERENCE = Reference.load("published")
WRONG = {"turned": spoilt(factor=-1.0), "five": spoilt(factor=5.0), "late": spoilt(late=True)}
MANOEUVRES = ("step_steer", "release")
PLACES = [(75.0, manoeuvre, "relaxed") for manoeuvre in MANOEUVRES]


def cases_of(name):
    return [
        Case(plant, "impedance", name, speed, manoeuvre, arm, split="test", draw=k)
        for plant in ("EPAS", "SbW")
        for speed, manoeuvre, arm in PLACES
        for k in (0, 1)
    ]


@pytest.fixture(scope="module")
def judged():
    names = ["pid", *WRONG]
    results = run_cases([case for name in names for case in cases_of(name)], REFERENCE, makers=WRONG)
    gates, proof = gates_of(names, REFERENCE, results, WRONG, quick=True)
    return results, gates, proof


def test_wrong_controllers_are_named_and_stand_behind(judged):
    """A flipped sign, a command five times too large, 10 ms more delay; catches a gate that only averages."""
    results, gates, proof = judged
    ranking = standings(results, Protocol.load(), gates)
    assert ranking[0].controller == "pid"
    assert ranking[0].safe, ranking[0].why_unsafe
    for standing in ranking[1:]:
        assert not standing.safe
        assert any("grows by" in reason for reason in standing.why_unsafe), standing
    systems = {(gate["plant"], gate["causality"]) for gate in proof["gates"] if gate["controller"] == "late"}
    assert len(systems) == 4
    assert all(not gate["safe"] for gate in proof["gates"] if gate["controller"] in WRONG)


def test_a_right_controller_is_not_blamed_for_the_reference():
    """Episodes at places where the reference itself is unstable do not count."""
    case = Case("EPAS", "admittance", "pid", 15.0, "release", "tense", split="test")
    thrown = [{"case": dict(case.__dict__), "stable": False}]
    assert len(unstable_episodes("pid", thrown, set())) == 1
    assert not unstable_episodes("pid", thrown, {("EPAS", "admittance", 15.0, "tense")})
    assert not unstable_episodes("lead", thrown, set())


def test_the_share_for_tuning_agrees_with_the_gate():
    """Catches a cheap check that differs from the proof that it stands for, and a delay that does nothing."""

    def pid(*told):
        return controllers.make("pid", *told)

    assert unstable_share(pid, "SbW", "impedance", REFERENCE, [75.0]) == 0.0
    assert unstable_share(pid, "SbW", "impedance", REFERENCE, [75.0], late=8) > 0.0
    assert unstable_share(WRONG["turned"], "SbW", "impedance", REFERENCE, [75.0]) > 0.5
