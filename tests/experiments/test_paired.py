"""Differences on the same cases: made-up results whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.bench_cases import Case
from experiments.bench_protocol import Protocol
from experiments.paired import differences

PROTOCOL = Protocol.load()
FEW = replace(PROTOCOL, bootstrap={**PROTOCOL.bootstrap, "resamples": 200})


def results(controller, scores):
    """Results of scores [place, draw]: places are speeds."""
    return [
        {
            "case": dict(
                Case("SbW", "impedance", controller, 10.0 + place, "step_steer", "tense", split="test", draw=k).__dict__
            ),
            "stable": True,
            "scores": {"tracking_jnd": float(score)},
        }
        for place, row in enumerate(scores)
        for k, score in enumerate(row)
    ]


@pytest.mark.parametrize("draws", [1, 3])
def test_what_all_cases_share_does_not_blur_a_difference(draws):
    """Catches cases that are drawn apart: a shift of 0.1 in every case is certain, however the cases differ."""
    rng = np.random.default_rng(0)
    base = rng.uniform(0.5, 3.0, (30, draws))
    given = [*results("a", base - 0.1), *results("b", base)]
    (found,) = differences(given, [("a", "b")], PROTOCOL)
    assert found.score == pytest.approx(-0.1)
    assert found.interval == pytest.approx((-0.1, -0.1))
    assert (found.share, found.cases) == (1.0, 30 * draws)
    (back,) = differences(given, [("b", "a")], PROTOCOL)
    assert (back.score, back.share) == (-found.score, 0.0)


def test_the_interval_is_as_wide_as_the_difference_is_unsure():
    """Equal but for their own noise: near nine in ten 95 % intervals or more hold 0, and noise halved halves them."""

    def intervals(size):
        for seed in range(40):
            rng = np.random.default_rng(seed)
            base = rng.uniform(1.0, 2.0, (25, 1)) + np.zeros((25, 3))
            noisy = [base + size * rng.standard_normal(base.shape) for _ in range(2)]
            given = [*results("a", noisy[0]), *results("b", noisy[1])]
            yield differences(given, [("a", "b")], FEW)[0].interval

    wide, narrow = list(intervals(0.1)), list(intervals(0.05))
    assert sum(low <= 0.0 <= high for low, high in wide) >= 35
    ratio = np.mean([high - low for low, high in narrow]) / np.mean([high - low for low, high in wide])
    assert ratio == pytest.approx(0.5, abs=0.07)
