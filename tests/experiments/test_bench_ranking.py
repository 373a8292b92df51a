"""Ranks from scores: made-up results whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.bench_cases import Case
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score, score_table, standings

PROTOCOL = Protocol.load()
PLACES = [(speed, arm) for speed in (30.0, 60.0, 90.0, 105.0) for arm in PROTOCOL.arms]


def result(controller, value, speed=60.0, arm="tense", draw=0, stable=True, split="test"):
    case = Case("SbW", "impedance", controller, speed, "step_steer", arm, split=split, draw=draw)
    return {"case": dict(case.__dict__), "stable": stable, "scores": {"tracking_jnd": value} if stable else {}}


def campaign(controller, mean, spread=0.0, seed=0):
    """Scores about a mean at every place, three draws each."""
    rng = np.random.default_rng(seed)
    return [
        result(controller, mean + spread * rng.standard_normal(), speed, arm, k)
        for speed, arm in PLACES
        for k in range(3)
    ]


def test_a_case_score_is_the_mean_of_its_metrics_and_ends_at_the_worst():
    """Catches an unstable case that counts as missing, a None that counts as nought, a cap left out."""
    worst = PROTOCOL.worst_score_jnd
    both = result("pid", 1.0)
    both["case"]["manoeuvre"], both["scores"] = "steady_state", {"tracking_jnd": 1.0, "feel_jnd": 3.0}
    assert case_score(both, PROTOCOL) == 2.0
    both["scores"]["feel_jnd"] = None
    assert case_score(both, PROTOCOL) == 1.0
    both["scores"]["tracking_jnd"] = 1e6
    assert case_score(both, PROTOCOL) == worst
    both["scores"] = {}
    assert case_score(both, PROTOCOL) == worst
    assert case_score(result("pid", 0.0, stable=False), PROTOCOL) == worst


def test_the_score_is_the_interquartile_mean():
    """The best and the worst quarter do not count: 36 cases, 9 left out at either end."""
    values = np.arange(36.0) / 10.0
    rows = [
        result("pid", values[3 * n + k], speed, arm, k) for n, (speed, arm) in enumerate(PLACES) for k in range(3)
    ]
    found = standings(rows, PROTOCOL, {})[0]
    assert found.score == pytest.approx(values[9:27].mean())
    assert (found.rank, found.rank_interval, found.chance_of_best, found.cases) == (1, (1, 1), 1.0, 36)


def test_clear_differences_rank_surely_and_equals_do_not():
    """Catches intervals that are always narrow, and pairs drawn apart: noise shared by all cannot move ranks."""
    clear = [*campaign("a", 1.0, 0.1, 1), *campaign("b", 2.0, 0.1, 2)]
    first, second = standings(clear, PROTOCOL, {})
    assert (first.controller, first.rank_interval, second.rank_interval) == ("a", (1, 1), (2, 2))
    assert first.chance_of_best == 1.0
    equal = [*campaign("a", 2.0, 0.5, 1), *campaign("b", 2.0, 0.5, 2)]
    first, second = standings(equal, PROTOCOL, {})
    assert first.rank_interval == (1, 2)
    assert second.rank_interval == (1, 2)
    paired = [*campaign("a", 2.0, 0.5, 3), *campaign("b", 2.01, 0.5, 3)]
    first, second = standings(paired, PROTOCOL, {})
    assert first.chance_of_best == 1.0
    assert first.score_interval[1] > second.score_interval[0]


def test_the_interval_holds_the_true_mean_as_often_as_it_says():
    """100 worlds of which the true value is known: 95 % intervals must hold it about 95 times."""
    inside, quick = 0, replace(PROTOCOL, bootstrap={"resamples": 400, "coverage": 0.95})
    for world in range(100):
        interval = standings(campaign("a", 3.0, 0.5, world), quick, {})[0].score_interval
        inside += interval[0] <= 3.0 <= interval[1]
    assert 85 <= inside <= 100


def test_an_unsafe_controller_cannot_lead():
    rows = [*campaign("fast", 0.5), *campaign("sound", 2.0)]
    first, second = standings(rows, PROTOCOL, {"fast": ["SbW impedance: 60 km/h, tense: grows"]})
    assert (first.controller, first.rank, second.controller) == ("sound", 1, "fast")
    assert first.chance_of_best == 1.0
    assert not second.safe
    assert "tense" in second.why_unsafe[0]


def test_what_was_trained_on_cannot_be_scored():
    """Catches tuning and scoring on the same plants."""
    rows = campaign("a", 1.0)
    rows[3] = result("a", 1.0, split="training")
    with pytest.raises(ValueError, match="only test cases"):
        score_table(rows, PROTOCOL)
    with pytest.raises(ValueError, match="same places"):
        score_table([*campaign("a", 1.0), *campaign("b", 1.0)[:-3]], PROTOCOL)


def test_training_and_test_plants_come_from_ranges_that_do_not_meet():
    (a, b), (c, d) = PROTOCOL.draw_seeds["training"], PROTOCOL.draw_seeds["test"]
    assert a < b <= c < d


def test_the_protocol_drives_every_place_once():
    cases = PROTOCOL.test_cases("pid")
    assert len(set(cases)) == len(cases) == 2 * 2 * 7 * 3 * 6 * 3
    quick = PROTOCOL.test_cases("pid", quick=True)
    assert set(quick) <= set(cases)
    assert len(quick) == 2 * 2 * 6
    training = PROTOCOL.training_cases("pid", "EPAS", "impedance", (45.0,), 2)
    assert len(training) == 12
    assert all(case.split == "training" and case.arm == "drawn" for case in training)
