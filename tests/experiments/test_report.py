"""A report opens offline, draws every figure, and shows a user's text as text."""

import re

import numpy as np
import plotly.graph_objects as go
import pytest

from experiments.report.figures import Curve, bode, hysteresis, thin, traces
from experiments.report.page import Report
from experiments.report.style import PALETTE, colour_of, ordered_colours

FREQUENCY = np.geomspace(0.2, 5.0, 40)


def second_order(frequency_Hz):
    s = 2j * np.pi * frequency_Hz
    return 1.0 / (0.1 * s * s + 0.8 * s + 4.0)


def example():
    speeds = ("15 km/h", "60 km/h", "105 km/h")
    measured = [Curve(name, FREQUENCY, second_order(FREQUENCY)) for name in speeds]
    coherence = [Curve(name, FREQUENCY, np.full(40, 0.97)) for name in speeds]
    time = np.linspace(0.0, 5.0, 501)
    angle = np.sin(time)
    report = Report("Example", "one line", {"campaign": "a <b>"})
    report.key_numbers([("0.041 kg m²", "inertia")])
    report.section("Response").text("Measured *and* fitted.\n\n> One run was skipped.")
    report.figure(bode(measured, measured, coherence, unit="rad/(N m)", ordered=True), "FRF")
    report.section("Friction")
    report.figure(hysteresis([Curve("60 km/h", angle, angle)], [Curve("60 km/h", angle, angle)]))
    report.figure(traces({"angle [rad]": [Curve("angle", time, angle)]}), "Over time")
    report.figure(go.Figure(go.Bar(x=["pid", "map"], y=[1.0, 3.0])), "Not by our helpers")
    report.table(["name", "value"], [["<i>", 0.04123456], ["b", None]], "Values")
    return report


def test_every_figure_draws_with_a_clean_console(tmp_path, assert_report_draws):
    assert_report_draws(example().write(tmp_path / "report.html"), figures=4)


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ("<script>console.warn('odd')</script>", "console is not clean"),
        ("<script>throw new Error('boom')</script>", "console is not clean"),
        ('<div class="plotly-graph-div"></div>', "marks drawn"),
        ("", "no figure"),
    ],
)
def test_the_check_sees_what_is_wrong(tmp_path, assert_report_draws, wrong, complaint):
    """The fixture that guards every report must itself be able to fail."""
    path = tmp_path / "bad.html"
    path.write_text(f"<!DOCTYPE html><title>bad</title><p>text</p>{wrong}")
    with pytest.raises(AssertionError, match=complaint):
        assert_report_draws(path)


def test_an_empty_figure_is_not_taken_for_drawn(tmp_path, assert_report_draws):
    """Axes, grid and legend alone are no figure: the curves must be there."""
    figure = hysteresis([Curve("a", [], [])], [Curve("b", [np.nan], [1.0])])
    path = Report("Empty").figure(figure).write(tmp_path / "empty.html")
    with pytest.raises(AssertionError, match="marks drawn"):
        assert_report_draws(path)


def test_the_page_needs_no_network_and_sends_nothing(tmp_path):
    """Catches a script from a CDN, a web font, and plotly's own upload button."""
    page = example().html()
    ours = re.sub(r"<script>/\*\*.*?</script>", "", page, flags=re.DOTALL)
    assert len(ours) < 0.2 * len(page)  # plotly.js itself is out of what is searched below
    assert "http" not in ours
    assert page.count("showSendToCloud: false") == 1
    assert page.count("plotly.js v") == 1


def test_a_users_text_is_shown_not_run():
    report = Report("</title><script>alert(1)</script>")
    report.table(["<b>"], [["<script>alert(2)</script>"]], "<i>")
    report.figure(hysteresis([Curve("</script><script>alert(3)</script>", [0, 1], [0, 1])]))
    page = report.html()
    for number in (1, 2, 3):
        assert f"<script>alert({number})" not in page


def test_the_date_can_be_fixed(monkeypatch):
    """The same inputs can give the same bytes."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    assert "1970-01-01 00:00 UTC" in example().html()
    assert example().html() == example().html()


def test_bode_shows_decibel_and_degrees():
    """|H| = 0.25 at rest is -12.04 dB; far above resonance the phase goes to -180 degrees."""
    frequency = np.geomspace(0.001, 100.0, 500)
    figure = bode(fits=[Curve("a", frequency, second_order(frequency))])
    magnitude, phase = figure.data
    assert magnitude.y[0] == pytest.approx(-12.041, abs=1e-3)
    assert phase.y[0] == pytest.approx(0.0, abs=0.1)
    assert phase.y[-1] == pytest.approx(-180.0, abs=1.0)


def test_a_fit_lies_on_the_branch_of_its_measurement():
    """Phases are known up to whole turns; a fit drawn 360 degrees away would look wrong."""
    delay = np.exp(-2j * np.pi * FREQUENCY * 0.35)
    data, model = second_order(FREQUENCY) * delay, second_order(FREQUENCY[20:]) * delay[20:]
    figure = bode([Curve("a", FREQUENCY, data)], [Curve("a", FREQUENCY[20:], model)])
    measured, fitted = (trace for trace in figure.data if trace.yaxis == "y2")
    np.testing.assert_allclose(fitted.y, measured.y[20:], atol=1e-6)


def test_thinning_keeps_peaks_and_ends():
    x = np.arange(100_000.0)
    y = np.zeros_like(x)
    y[54_321] = 9.0
    y[7] = np.nan
    few_x, few_y = thin(x, y, most=1000)
    assert len(few_x) <= 1002
    assert few_y.max() == 9.0
    assert (few_x[0], few_x[-1]) == (0.0, 99_999.0)


def test_colours_follow_names_and_order():
    assert colour_of(["a", "b", "a"]) == {"a": PALETTE[0], "b": PALETTE[1]}
    assert len(set(ordered_colours(7))) == 7
    assert len(colour_of([str(k) for k in range(12)])) == 12
