"""The report says on which systems it ranks, what it leaves out, and what a policy is."""

import re

from experiments.report.benchmark import make_report
from experiments.report.benchmark_intervals import intervals
from experiments.report.benchmark_scope import subtitle
from experiments.report.style import looks_of
from tests.experiments.made_up_benchmark import SYSTEMS, scored, summary_of

NAMES = ("quiet_law", "policy:runs/0")
RESULTS = scored({NAMES[0]: 0.5, NAMES[1]: 0.6})


def page(**more):
    """Text of the page without scripts and with single spaces."""
    html = make_report({**summary_of(RESULTS), **more}, [], RESULTS).html()
    return re.sub(r"\s+", " ", re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)).replace("\u00a0", " ")


def test_what_is_left_out_and_why_stands_at_the_top():
    """Catches a ranking over a part that reads as one over everything; a run on everything says nothing of it."""
    why = "policy:q is made for SbW impedance alone"
    text = page(left_out=[{"plant": plant, "causality": causality, "why": why} for plant, causality in SYSTEMS[:2]])
    assert f"Left out: EPAS impedance, EPAS admittance ({why})." in text
    assert text.index("Left out") < text.index("comes first")
    assert "All systems. Score" not in text
    plain = page()
    assert "All systems. Score" in plain
    assert "Left out" not in plain


def test_a_policy_is_described_by_its_record():
    record = {"controller": NAMES[1], "plant": "EPAS", "causality": "impedance", "step_ms": 5.0,
              "authority_Nm": 0.5, "least_share": 0.25, "seed": 3, "training_steps": 500_000}  # fmt: skip
    text = page(policies=[{**record, "base": "lqg"}, {**record, "base": None, "seed": None, "training_steps": None}])
    begin = "<b>policy:0</b> in EPAS impedance is a small network that acts every 5 ms and"
    assert f"{begin} corrects lqg by up to 0.5 N m at the motor, learned in 500,000 steps from seed 3." in text
    assert f"{begin} gives the whole torque, up to 0.5 N m at the motor." in text
    assert "small network" not in page()


def test_a_run_on_one_system_has_one_panel_and_names_it():
    one = summary_of([r for r in RESULTS if (r["case"]["plant"], r["case"]["causality"]) == SYSTEMS[2]])
    assert subtitle(one) == "Steer-by-wire, torque tracking (impedance)"
    figure = intervals(one["ranking"], one["systems"], looks_of(NAMES))
    assert [title.text for title in figure.layout.annotations] == ["SbW<br>impedance"]
    every = summary_of(RESULTS)
    assert len(intervals(every["ranking"], every["systems"], looks_of(NAMES)).layout.annotations) == 5
    assert subtitle(every) == "EPAS and steer-by-wire, torque tracking (impedance) and angle tracking (admittance)"


def test_a_label_keeps_what_kind_of_controller_it_is():
    """Catches a policy in runs/0 that is called "0"."""
    labels = [look.label for look in looks_of([NAMES[1], "passivity:a/x.py:L", "a/y.py:L"]).values()]
    assert labels == ["policy:0", "passivity:x.py:L", "y.py:L"]
