"""What the shipped gains promise of steer-by-wire in impedance: felt torque within 1 JND at every frequency."""

import pytest

import controllers
from experiments import bench_cases
from experiments.assessment import assess
from experiments.bench_cases import Case
from experiments.bench_gates import unstable_share
from experiments.metrics import JND, score
from experiments.stability_gate import safe
from steer_env.plants import Reference

NAME = "disturbance_observer"
REFERENCE = Reference.load("published")


def chirp(linear, seed=0):
    case = Case("SbW", "impedance", NAME, 75.0, "frequency_response", "relaxed", linear)
    return bench_cases.trial_of(case, bench_cases.episode_of(case, REFERENCE, seed))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_point_of_the_response_is_within_one_jnd(seed):
    """Relaxed arm, 75 km/h, 0.2-5 Hz: |H / Href - 1| < 15 %; catches gains that are good on average alone."""
    trial = chirp(False, seed)
    found, f = score(trial), trial.slow_response.frequency
    assert f[0] < 0.35
    assert f[-1] > 4.8
    assert len(f) > 20
    worst = abs(trial.slow_response.achieved / trial.slow_response.wanted - 1.0).max()
    assert worst / JND == pytest.approx(found["frf_worst_jnd"])
    assert worst < JND


def test_it_is_within_the_limits_of_the_linear_reference_too():
    """1.5 dB and 10 deg over 0.2-4 Hz: what damping foretold by more than the delay must not be bought with."""
    found = score(chirp(True))
    assert found["worst_magnitude"] < 1.5
    assert found["worst_phase"] < 10.0


def test_it_is_stable_with_every_arm_and_one_period_later():
    """The linear proof over speeds, operating points and arms, and the same with commands 1 ms late."""

    def make(*told):
        return controllers.make(NAME, *told)

    speeds = [row.speed_kmh for row in REFERENCE.file.rows]
    gate = safe(assess(make, "SbW", "impedance", REFERENCE, speeds))
    assert gate.safe, gate.failures
    assert gate.delay_margin_ms > 1.0
    assert unstable_share(make, "SbW", "impedance", REFERENCE, speeds, late=1) == 0.0
