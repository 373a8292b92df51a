"""What the study of learned policies tells: when a policy is better for good, and what a variant comes to."""

import json
from dataclasses import replace

import pytest

from controllers import policy_file
from experiments import policy_study
from experiments.learning.config import TrainConfig
from experiments.learning.scoring import Score
from experiments.policy_study import VARIANTS, final, seconds_until
from experiments.train import config_of
from steer_env.plants import Reference
from tests.controllers.made_up_policy import made_up

REFERENCE = Reference.load("published")


def points(*scores):
    return [{"cpu_s": 2.0 * k, "jnd": score} for k, score in enumerate(scores)]


def test_better_counts_from_when_it_stays_so():
    """Catches the luck of one kept policy that is taken for having learned."""
    assert seconds_until(points(0.9, 0.6, 0.8, 0.6, 0.5), 0.7) == 6.0
    assert seconds_until(points(0.6, 0.5), 0.7) == 0.0
    assert seconds_until(points(0.6, 0.7), 0.7) is None
    assert seconds_until([], 0.7) is None


def test_every_variant_can_be_asked_for():
    for settings in VARIANTS.values():
        assert config_of("SbW-Impedance", 0, settings).plain() == TrainConfig().changed(settings).plain()


def test_a_variant_is_told_by_its_last_quarter_and_kept(tmp_path, monkeypatch):
    """Catches a mean over the whole of training, when nothing is learned yet, and a score that is made twice."""
    config = TrainConfig()
    policy_file.save(replace(made_up("SbW", "impedance"), shares=((5.0, 0.5), (10.0, 0.25))), tmp_path)
    log = [{"tracking": -value} for value in (9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 1.0, 3.0)]
    (tmp_path / "run.json").write_text(json.dumps({"log": log}))
    monkeypatch.setattr(policy_study, "_score", lambda *_: Score(0.5, 0.75, 1, 42))
    found = final(config, tmp_path, REFERENCE)
    assert found == {"jnd": 0.5, "mean": 0.75, "unstable": 1, "cases": 42, "share": 0.25, "own_domain": 2.0}
    monkeypatch.setattr(policy_study, "_score", pytest.fail)
    assert final(config, tmp_path, REFERENCE) == found
