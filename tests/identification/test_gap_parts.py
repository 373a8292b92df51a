"""The parts of the gap workflow against closed forms."""

from typing import Any

import numpy as np
import pytest

from identification.campaign import Run
from identification.gap.basis import NoiseSpectrum, band_of, error_zone
from identification.gap.evidence import error_of, fidelity
from identification.gap.fit import Judge, effect_unknowns, fit
from identification.gap.model import Record, Unknown
from identification.gap.published_tables import published_gap
from identification.gap.repeats import records_of
from identification.gap.vehicle_kernel import Steering, rollout
from identification.gap.vehicle_model import late
from identification.gap.verdict import Rules
from steer_env.physics.effects import EFFECTS, Plausible
from steer_env.physics.vehicle import SingleTrack

DT = 0.01


class LineModel:
    """y = a x + b x^3: the smallest model there is, to test the machinery on."""

    channels = ("y",)
    band_Hz = 20.0
    effects: dict[str, Any] = {}  # noqa: RUF012
    unknowns = (Unknown("a", 1.0, 0.01, 100.0, 2.0), Unknown("b", 0.0, -10.0, 10.0, 5.0, log=False))

    def __init__(self, records: tuple[Record, ...]) -> None:
        self.records = records

    def simulate(self, record: Record, values: Any, present: Any) -> dict[str, np.ndarray]:
        x = record.inputs["x"]
        return {"y": values["a"] * x + values["b"] * x**3}

    def judged(self, outputs: Any) -> Any:
        return outputs

    def states(self, record: Record) -> Any:
        return {"x": record.inputs["x"]}


def line_record(rng: np.random.Generator, a: float, b: float, noise: float, repeats: int = 3) -> Record:
    t = np.arange(2000) * DT
    x = np.sin(2.0 * np.pi * 0.5 * t) + 0.3 * np.sin(2.0 * np.pi * 2.3 * t)
    runs = tuple({"y": a * x + b * x**3 + noise * rng.standard_normal(t.size)} for _ in range(repeats))
    mean = np.mean([run["y"] for run in runs], axis=0)
    return Record("line", "free", 0.0, 10.0, DT, {"x": x}, {"y": mean}, slice(100, 1900), "identify", runs)


def line_judge(records: list[Record]) -> Judge:
    model: Any = LineModel(tuple(records))
    return Judge(model, records, NoiseSpectrum(model, records, ["y"]), ["y"])


def test_noise_of_repeats_and_without() -> None:
    """White noise of 0.1 is found as 0.01 of power per coefficient, over the repeats' number in their mean."""
    rng = np.random.default_rng(0)
    for repeats in (3, 1):
        record = line_record(rng, 2.0, 0.0, 0.1, repeats)
        model: Any = LineModel((record,))
        power = NoiseSpectrum(model, [record], ["y"]).at(record, band_of(record, 20.0).frequency)
        assert float(np.mean(power)) == pytest.approx(0.01 / repeats, rel=0.1)


def test_fit_recovers_and_its_intervals_hold_the_truth() -> None:
    """Damped Gauss-Newton with a log and a linear unknown; intervals of 50 noises hold the truth about 95 %."""
    inside = []
    for seed in range(50):
        judge = line_judge([line_record(np.random.default_rng(seed), 2.0, -0.3, 0.05)])
        solution = fit(judge, judge.model.unknowns, np.zeros((1, 3)))
        assert solution.values["a"] == pytest.approx(2.0, rel=0.02)
        low, high = solution.interval("b")
        inside.append(low < -0.3 < high)
    assert 0.84 <= np.mean(inside) <= 1.0


def test_model_error_is_found_and_none_where_there_is_none() -> None:
    """A prediction that is 5 % too small errs by 0.05 of its signal; a perfect one by less than a per cent."""
    record = line_record(np.random.default_rng(1), 2.0, 0.0, 1e-3)
    judge = line_judge([record])
    right, small = judge.predict({"a": 2.0, "b": 0.0}), judge.predict({"a": 1.9, "b": 0.0})
    assert error_of(judge, right).max() < 0.01
    assert 0.02 < error_of(judge, small)[0, error_zone(np.array([0.5]))[0]] < 0.1


def test_fidelity_is_one_for_the_truth_and_low_for_a_bend() -> None:
    """The true change puts everything right, the opposite one makes it worse."""
    judge = line_judge([line_record(np.random.default_rng(2), 2.0, 0.2, 1e-3)])
    null, truth, wrong = (judge.predict({"a": 2.0, "b": b}) for b in (0.0, 0.2, -0.2))
    error = np.full((1, 3), 0.01)
    assert fidelity(judge, null, truth, error) > 0.99
    assert fidelity(judge, null, wrong, error) < -1.0


def test_delay_of_a_sine_is_its_phase() -> None:
    """A cubic delays 3 Hz at 100 Hz by any part of a sample to 1e-4, also backwards."""
    t = np.arange(300) * DT
    for samples in (0.3, 1.7, -0.6, 4.0):
        delayed = late(np.sin(6.0 * np.pi * t), samples)
        exact = np.sin(6.0 * np.pi * (t - samples * DT))
        assert np.abs(delayed - exact)[10:-10].max() < 1e-4


def test_kernel_is_of_fourth_order_without_friction() -> None:
    """Halving the step divides the error by 16 or more: catches a stage that sees the wrong input."""
    p = Steering(0.06, 0.8, 0.3, 1.8, 0.0, 200.0, 115.0, 0.3)
    car = SingleTrack(sigma_f=0.4, sigma_r=0.5)

    def end(substeps: int) -> float:
        h = DT / substeps
        t = np.arange(2 * 400 * substeps + 1) * 0.5 * h
        steer, rate = 0.3 * np.sin(2.0 * np.pi * t), 0.6 * np.pi * np.cos(2.0 * np.pi * t)
        return float(rollout(steer, rate, h, substeps, 20.0, p, car, None)[-37, 0])

    exact = end(64)
    assert abs(end(2) - exact) / abs(end(4) - exact) > 14.0


def run(name: str, scale: float, role: str = "identify", n: int = 1500) -> Run:
    t = np.arange(n) * DT
    angle = scale * np.sin(2.0 * np.pi * 0.2 * t)
    channels = {"steering_angle_rad": angle, "torsion_bar_torque_Nm": 2.0 * angle}
    return Run(name, "steady_state", 60.0 / 3.6, role, t, DT, channels)


def test_repeats_are_averaged_and_others_kept_apart() -> None:
    """Runs of one amplitude make one record; another amplitude its own; held-out runs never mix with fitted ones."""
    runs = [run("a", 1.0), run("b", 1.001), run("c", 0.5), run("d", 1.0, "validate")]
    found = records_of(runs, "steering_angle_rad", ("steering_angle_rad",), ("torsion_bar_torque_Nm",))
    assert sorted((len(r.repeats), r.role) for r in found) == [(1, "identify"), (1, "validate"), (2, "identify")]


def test_without_a_held_out_run_the_end_of_slow_ones_is_held_out() -> None:
    """The split is in time and does not overlap."""
    fitted, held = records_of(
        [run("a", 1.0)], "steering_angle_rad", ("steering_angle_rad",), ("torsion_bar_torque_Nm",)
    )
    assert (fitted.role, held.role) == ("identify", "validate")
    assert fitted.keep.stop == held.keep.start


def test_effect_unknowns_start_at_the_probe_and_believe_in_absence() -> None:
    """The amplitude's prior is around absent, a shape's in the middle of its range."""
    effect = EFFECTS["vehicle"]["stribeck_friction"]
    unknowns, start = effect_unknowns(effect, {"extra_Nm": 1.0, "speed_radps": 0.5})
    by_name = {u.name: u for u in unknowns}
    assert by_name["stribeck_friction.extra_Nm"].start == 0.0
    assert start["stribeck_friction.extra_Nm"] == 1.0
    assert by_name["stribeck_friction.speed_radps"].start == pytest.approx(np.sqrt(0.02 * 0.6))


def test_plausible_range_with_slack_and_sign() -> None:
    """Edges, slack, and the sign of signed ones."""
    assert Plausible(1.0, 2.0).holds(1.0)
    assert not Plausible(1.0, 2.0).holds(2.5)
    assert Plausible(1.0, 2.0).holds(2.5, 0.3)
    assert not Plausible(1.0, 2.0).holds(-1.5)
    assert Plausible(1.0, 2.0, signed=True).holds(-1.5)
    assert Rules().least_fidelity > 0.5


def test_published_tables_hold_a_stiffness_that_is_not_jacking() -> None:
    """One stiffness takes the error from about 16 to 2 per cent; its interval excludes what jacking can give."""
    found = published_gap()
    assert found.error_before > 0.12
    assert found.error_after < 0.025
    assert found.interval[0] < 4.0 < found.interval[1]
    assert found.interval[0] > 1.5
    assert 1.2 < found.l_f < 1.5
    assert 16.0 < found.i_s < 19.0
    assert "jacking alone is ruled out" in found.verdict
