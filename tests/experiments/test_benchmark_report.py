"""The benchmark's report says what its numbers say, holds every case, and bears the absence of every block."""

import json
import re
from contextlib import nullcontext

import pytest

from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.measures import JND_DB, JND_DEG
from experiments.metrics import BAND_HZ
from experiments.report import benchmark_figures, benchmark_scores
from experiments.report.benchmark import make_report
from experiments.report.benchmark_cases import browser_data
from experiments.report.benchmark_causality import sentence
from experiments.report.benchmark_robustness_map import robustness_map
from experiments.report.page import Report
from experiments.report.style import looks_of
from tests.experiments.made_up_benchmark import (
    DRAWS,
    MANOEUVRES,
    SPEEDS_KMH,
    SYSTEMS,
    assessment,
    exhibits,
    plot_of,
    proof,
    scored,
    summary_of,
)

GOOD, BAD = "quiet_law", "loud_law"


def proven(growth=-1.0, reference_growth=-2.0):
    """Both controllers everywhere; BAD grows by ``growth`` at EPAS impedance, 30 km/h."""
    places = {
        name: [assessment(*system, speed) for system in SYSTEMS for speed in SPEEDS_KMH] for name in (GOOD, BAD)
    }
    places[BAD][0] = assessment(*SYSTEMS[0], SPEEDS_KMH[0], growth, reference_growth)
    return proof(places)


def page(results, proof_of_it=None, **more):
    """Text of the page without scripts and with single spaces."""
    html = make_report({**summary_of(results, proof_of_it), **more}, exhibits((GOOD, BAD)), results).html()
    return re.sub(r"\s+", " ", re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)).replace("\u00a0", " ")


def test_an_unsafe_controller_is_named_unsafe_with_count_and_worst_place():
    """Catches praise of a law that wins by score and is unstable somewhere."""
    results = scored({GOOD: 0.8, BAD: 0.4})
    text = page(results, proven(growth=12.3))
    assert f"<b>{BAD}</b> is unsafe: unstable at 1 of 8 places of the proof; worst: EPAS impedance, 30 km/h" in text
    assert "grows by 12.3 1/s at 7.5 Hz. By score alone it would stand at rank 1." in text
    assert f"<b>{GOOD}</b> comes first" in text
    assert "<b>1 of 2</b><span>controllers are safe" in text
    calm = page(results, proven())
    assert "unsafe: unstable" not in calm
    assert f"<b>{BAD}</b> comes first" in calm


def test_unstable_episodes_count_and_the_places_of_an_unstable_reference_do_not():
    results = scored({GOOD: 0.8, BAD: 0.9}, unstable={(BAD, 30.0)})
    episodes = len(SYSTEMS) * len(MANOEUVRES) * DRAWS
    text = page(results, proven())
    assert f"is unsafe: unstable in {episodes} episodes; worst: EPAS impedance, 30 km/h, frequency_response" in text
    own = page(scored({GOOD: 0.8, BAD: 0.9}), proven(growth=3.0, reference_growth=0.2))
    assert "is unsafe" not in own
    assert "stable at 7 places (unstable at 1 where the reference itself is)" in own
    assert "The reference itself, perfectly tracked, is unstable at 1 places" in own


@pytest.mark.parametrize(
    ("jnd", "said"),
    [
        ({GOOD: 0.4, BAD: 0.8}, ("less than a driver begins to notice", "No other safe controller reaches rank 1")),
        ({GOOD: 2.0, BAD: 4.0}, ("more than a driver begins to notice", "is 2.00 times as far")),
        ({GOOD: 0.5}, ("It was the only one scored.",)),
    ],
)
def test_how_sure_the_first_place_is_follows_from_the_numbers(jnd, said):
    text = page(scored(jnd), proven())
    for words in said:
        assert words in text


def test_a_first_place_that_the_draws_decide_is_called_uncertain():
    """One law is better in the first draw, the other in the second: resampling draws turns them round."""
    results = scored({GOOD: 0.5, BAD: 0.5})
    for result in results:
        if result["case"]["controller"] == BAD:
            factor = 1.01 if result["case"]["draw"] == 0 else 1.0 / 1.01
            result["scores"] = {k: v and factor * v for k, v in result["scores"].items()}
    text = page(results, proven())
    assert "That is not certain: within 95 % of the resamplings" in text
    assert "(0.50 JND, best in" in text
    assert "EPAS impedance (not certain)" in text


def test_a_controller_without_a_proof_is_not_called_safe():
    """Standing.safe only says that nothing was found, which is little where nobody looked."""
    text = page(scored({GOOD: 0.5, BAD: 0.6}), proof({GOOD: [assessment(*SYSTEMS[0], 75.0)]}))
    assert f"No linear proof of stability: <b>{BAD}</b>." in text
    assert '<b class="open">not proven</b>: no unstable episode' in text


def test_the_band_of_one_jnd_is_drawn():
    chirps = [r for r in scored({GOOD: 1.0}) if "ratio_dB" in r["plot"] and r["case"]["speed_kmh"] == 75.0]
    curves = [benchmark_figures.deviation_of(result) for result in chirps]
    figure = benchmark_figures.deviations(curves, JND_DB, JND_DEG, BAND_HZ)
    bands = {(shape.y0, shape.y1) for shape in figure.layout.shapes}
    assert bands == {(-JND_DB, JND_DB), (-JND_DEG, JND_DEG)}
    assert pytest.approx(1.21, abs=0.01) == JND_DB
    text = page(scored({GOOD: 0.5, BAD: 0.6}))
    assert "Band: one JND, 1.2 dB and 8.6 deg" in text


def test_a_response_that_explodes_does_not_flatten_the_others():
    wild = scored({GOOD: 1.0, BAD: 60.0})
    curves = [benchmark_figures.deviation_of(result) for result in wild if "ratio_dB" in result["plot"]]
    figure = benchmark_figures.deviations(curves, JND_DB, JND_DEG, BAND_HZ)
    assert figure.layout.yaxis.range[1] == pytest.approx(benchmark_figures.SHOWN_BANDS * JND_DB)


def test_the_browser_holds_every_case_with_its_scores():
    """Catches a case lost, a draw swapped, a score other than the ranking's."""
    results = scored({GOOD: 0.5, BAD: 0.6}, unstable={(BAD, 30.0)})
    data = json.loads(json.dumps(browser_data(results, looks_of([BAD, GOOD]))))
    assert data["choices"]["controller"] == [BAD, GOOD]
    assert sum(len(case["draws"]) for case in data["cases"].values()) == len(results)
    fields = {k: data["choices"][k] for k in data["fields"]}
    for result in results:
        case = result["case"]
        values = (case["controller"], f"{case['plant']} {case['causality']}", case["speed_kmh"], case["manoeuvre"])
        place = zip(fields.values(), (*values, case["arm"]), strict=True)
        found = data["cases"][".".join(str(options.index(value)) for options, value in place)]
        draw = found["draws"][case["draw"]]
        if not result["stable"]:
            assert draw == {"stopped_s": 1.25}
            assert "plot" not in found
            continue
        assert draw["values"][0] == pytest.approx(case_score(result, Protocol.load()), rel=1e-2)
        assert len(draw["values"]) == len(data["metrics"][case["manoeuvre"]])
        if case["manoeuvre"] == "steady_state":
            names = [metric["name"] for metric in data["metrics"]["steady_state"]]
            assert draw["values"][names.index("torque_hysteresis")] == [1.25, 1.5]
    assert data["cases"][data["first"]]["plot"]


def test_the_browsers_curves_are_the_plots():
    """Rounding may take a part of the range in 400, no more; times are even and kept by their ends."""
    [first] = [r for r in scored({GOOD: 0.123456}) if r["case"]["manoeuvre"] == "release" and r["plot"]][:1]
    data = browser_data([first], looks_of([GOOD]))
    [case] = data["cases"].values()
    plot = plot_of("release", 0.123456)
    assert case["plot"]["time_s"] == [0.0, 1.5]
    assert case["plot"]["unit"] == "N m"
    assert case["plot"]["achieved"] == pytest.approx(plot["achieved"], abs=0.123456 / 400)


@pytest.mark.parametrize("block", ["ranking", "systems", "verdicts", "gates", "assessments", "confirmations", "limits"])
def test_every_block_may_be_absent(block):
    results = scored({GOOD: 0.5, BAD: 0.6})
    summary = summary_of(results, proven(growth=2.0))
    del summary[block]
    assert "Every case" in make_report(summary, exhibits((GOOD, BAD)), results).html()


def test_exhibits_alone_and_nothing_at_all_make_a_page():
    """The demo has exhibits only, no gates and no proof."""
    shown = exhibits((GOOD, "open_loop_map"))
    text = make_report(summary_of(shown), shown, []).html()
    assert "No test case was driven" in text
    assert "safe:" not in text
    assert "How this was found" in make_report({}, [], []).html()


@pytest.mark.parametrize(
    ("factor", "said"),
    [(2.0, "Impedance is nearer to the reference on both"), (0.5, "Admittance is"), (1.01, "Neither is clearly")],
)
def test_which_causality_is_nearer_follows_from_the_pairs(factor, said):
    results = [r for r in scored({GOOD: 1.0, BAD: 1.5}, causality_factor=factor) if r["case"]["plant"] == "SbW"]
    text = sentence("SbW", results)
    assert said in text
    share = 100 if factor > 1.0 else 0
    assert f"impedance is nearer in {share} % of {2 * len(SPEEDS_KMH) * len(MANOEUVRES) * DRAWS} pairs" in text
    for result in results:  # now the two yardsticks disagree
        if "frf_jnd" in result["scores"] and factor == 2.0 and result["case"]["causality"] == "admittance":
            result["scores"]["frf_jnd"] = 0.1
    if factor == 2.0:
        assert "disagree: impedance is nearer in felt torque, admittance is nearer in freq" in sentence("SbW", results)


def test_limit_and_cost_are_shown_when_there():
    record = {"plant": "EPAS", "causality": "impedance", "speed_kmh": 75.0, "arm": "relaxed", "limit_jnd": 0.2,
              "reached": {GOOD: 0.5, BAD: None}}  # fmt: skip
    cost = {GOOD: {"p50_us": 1.5, "p999_us": 20.0}}
    results = scored({GOOD: 0.5, BAD: 0.6})
    text = page(results, limit=[record, {**record, "arm": "tense", "limit_jnd": 1.25}], step_cost=cost)
    assert "No controller could come nearer than 1 JND at 1 of 2 places." in text
    assert "1.45 (0.40–2.50)" in text
    assert "unstable at 2 of 2" in text
    assert f"<strong>{GOOD}</strong> is nearest to the limit: 1.45 times" in text
    worse = [{**record, "arm": arm, "reached": {GOOD: 0.5, BAD: None if k else 0.3}} for k, arm in enumerate("abc")]
    assert f"<strong>{GOOD}</strong> is nearest" in page(results, limit=worse)  # not the one stable in a third of them
    assert re.search(r"1\.50</td>\s*<td[^>]*>20\.00</td>\s*<td[^>]*>2\.00</td>", text)
    assert "Distance to the limit" not in page(results)


def test_the_robustness_map_tells_the_controllers_fault_from_the_references():
    faulty, own = proven(growth=9.0), proven(growth=9.0, reference_growth=0.4)
    looks = looks_of([GOOD, BAD])
    words = {
        name: [word for trace in robustness_map(found["assessments"], looks).data for row in trace.text for word in row]
        for name, found in (("faulty", faulty), ("own", own))
    }
    assert "+9.0" in words["faulty"]
    assert "+9.0" not in words["own"]
    assert "+0.40" in words["own"]  # in the row of the reference
    assert "+0.40" not in words["faulty"]


def test_a_heat_map_cell_is_the_interquartile_mean_of_its_cases():
    results = scored({GOOD: 1.0}, unstable={(GOOD, 30.0)})
    assert benchmark_scores.cell_of(results).score == pytest.approx(5.5, abs=0.3)  # half at 1 JND, half at 10
    assert benchmark_scores.cell_of(results).unstable == len(results) // 2
    panels = {("", ""): benchmark_scores.by_speed_and_arm(results)}
    [trace] = benchmark_scores.score_maps(panels, [GOOD], looks_of([GOOD])).data
    assert trace.z[0][0] == 1.0  # log10 of 10 JND
    assert trace.z[0][1] == pytest.approx(0.0, abs=0.01)  # 1 JND is the middle of the scale
    assert trace.text[0][0] == "10×"


def test_ten_controllers_have_ten_looks():
    looks = looks_of([*map(str, range(9)), "some/where/own.py:Law"])
    assert len({look.colour for look in looks.values()}) == len({look.symbol for look in looks.values()}) == 10
    assert looks["some/where/own.py:Law"].label == "own.py:Law"
    assert looks_of(["a/x.py:L", "b/x.py:L"])["a/x.py:L"].label == "a/x.py:L"


SELECT = """<script>
const form = document.querySelector("#case-browser form");
const graph = document.querySelector("#case-browser .plotly-graph-div");
form.elements.manoeuvre.value = 2;
form.elements.system.value = 3;
form.elements.speed.value = 0;
form.elements.manoeuvre.dispatchEvent(new Event("change", { bubbles: true }));
const said = document.querySelector("#case-browser figcaption").textContent;
if (!said.includes("WANTED")) console.error("caption: " + said);
if (graph.data.length !== 6) console.error("curves: " + graph.data.length);
if (document.querySelectorAll("#case-browser tbody tr").length < 3) console.error("no table");
</script></body>"""


def test_the_page_draws_with_a_clean_console(tmp_path, assert_report_draws):
    results = scored({GOOD: 0.5, BAD: 0.6})
    report = make_report(summary_of(results, proven(growth=2.0)), exhibits((GOOD, BAD)), results)
    assert_report_draws(report.write(tmp_path / "report.html"))


@pytest.mark.parametrize(
    ("wanted", "complaint"), [("SbW admittance, 30 km/h, release", ""), ("another case", "caption")]
)
def test_a_selection_draws(tmp_path, assert_report_draws, wanted, complaint):
    """A choice in the browser redraws signal, reference and error of two controllers; the check itself can fail."""
    html = Report("Cases").case_browser(browser_data(scored({GOOD: 0.5, BAD: 0.6}), looks_of([GOOD, BAD]))).html()
    path = tmp_path / "report.html"
    path.write_text(html.replace("</body>", SELECT.replace("WANTED", wanted)), "utf-8")
    with pytest.raises(AssertionError, match=complaint) if complaint else nullcontext():
        assert_report_draws(path, figures=1)
