"""Draw the picture of docs/rig.md from a recorded bench: python -m experiments.rig_picture CAMPAIGN PICTURE.png."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np

from experiments.readme_picture import DPI, SIZE
from experiments.report.style import DATA, PALETTE
from identification.campaign import read_campaign
from identification.rig import RigFit

SHOWN = (2.0, 6.0)  # s of the sweep


def main(campaign: Path, picture: Path) -> None:
    """Held-out torque over time, and the friction loop."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    read = read_campaign(campaign)
    fit = RigFit().fit(read)
    held = [run for run in read.runs if run.role == "validate"]
    sweep = next(run for run in reversed(held) if run.manoeuvre == "torque_sweep")
    sine = next(run for run in reversed(held) if run.manoeuvre == "steady_state")
    figure, (left, right) = plt.subplots(1, 2, figsize=SIZE, dpi=DPI, layout="constrained")

    part = fit.components(sweep)
    shown = (part["time"] >= SHOWN[0]) & (part["time"] <= SHOWN[1])
    left.plot(part["time"][shown], part["measured"][shown], color=DATA, linewidth=3.0, label="commanded")
    label = "J q'' + b q' + friction"
    left.plot(part["time"][shown], part["model"][shown], color=PALETTE[1], linewidth=1.2, label=label)
    left.set_title("a sweep that was held out", fontsize=10)
    left.set_xlabel("time / s", fontsize=9)

    part = fit.components(sine)
    angle = sine.channels["motor_angle_rad"]
    rest = part["measured"] - part["model"] + part["friction"]
    for values, colour, width, label in (
        (rest, DATA, 1.0, "what inertia and damping leave"), (part["friction"], PALETTE[1], 1.5, "Dahl friction"),
    ):  # fmt: skip
        right.plot(angle, np.where(part["sliding"], values, np.nan), color=colour, linewidth=width, label=label)
    right.set_title("a slow sine that was held out: friction", fontsize=10)
    right.set_xlabel("angle / rad", fontsize=9)
    for axis in (left, right):
        axis.set_ylabel("torque / N m", fontsize=9)
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    left.margins(y=0.2)  # room for the legend
    left.legend(fontsize=8, loc="upper right", ncols=2)
    right.legend(fontsize=8, loc="center")
    figure.savefig(picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
