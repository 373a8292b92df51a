"""What the CAN path costs: scores on a virtual motor beside those of the simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.report.page import Report
from experiments.report.style import Look

Record = Mapping[str, Any]


def beside_simulation(report: Report, summary: Record, looks: Mapping[str, Look]) -> None:
    """Text and table from ``rig``: the motor's name, and rows of ``bench_rig.Beside``."""
    rig = summary.get("rig")
    if not rig:
        return
    report.section("The CAN path beside the simulation")
    report.text(
        f"Every score outside this section is that of the stepped virtual motor **{rig['motor']}**: the same plants, "
        "arms, manoeuvres and controllers as in the simulated benchmark, with the drive's frames, wire and sensors in "
        "between. Scored are the true signals of the virtual wheel, judged as in the simulation, not what the rig "
        "measured. The wheel has no cogging and no unbalance, as the simulated one. Sensor noise has the same size "
        "but other values: \"other noise\" is where the simulated score lies in 95 of 100 times when that alone is "
        "drawn anew (a prediction from ten draws); a score of the CAN path inside it may differ by chance. The proof "
        "is that of the simulated plant. A tripped episode counts as unstable."
    )
    report.text(_limited(rig["beside"]))
    report.table(
        ["controller", "causality", "CAN path", "simulated", "other noise", "largest difference", "by noise alone",
         "cases", "unstable", "simulated", "tripped", "limited"],
        [
            [looks[row["controller"]].label, row["causality"], f"{row['score']:.2f}", f"{row['simulated_score']:.2f}",
             "{:.2f} to {:.2f}".format(*row["by_noise"]), f"{row['largest_difference']:.2f}",
             f"{row['largest_by_noise']:.2f}", row["cases"], row["unstable"], row["simulated_unstable"],
             row["tripped"], f"{100.0 * row['limited']:.1f} %"]
            for row in rig["beside"]
        ],
        "Interquartile means in JND; the largest difference of a single case, and the widest that one moves with the "
        "noise alone. Unstable: episodes through the CAN "
        "path, then simulated. Limited: share of time in which the safety layer changed a torque.",
        dense=True,
    )  # fmt: skip
    reasons = dict.fromkeys(
        f"{r['case']['controller']}, {r['case']['causality']}, {r['case']['manoeuvre']}: {r['rig']['ended']}"
        for r in summary["results"]
        if not r["stable"]
    )
    if reasons:
        report.table(["why episodes ended early"], [[reason] for reason in reasons], "", dense=True)


def _limited(rows: Sequence[Record]) -> str:
    most = max(row["limited"] for row in rows)
    if most == 0.0:
        return "The safety layer changed no torque: what is compared is the path, not the limiter."
    return f"The safety layer changed torques in up to {100.0 * most:.1f} % of a controller's time; its score has that."
