"""Draw the README's picture from a finished demo: python -m experiments.readme_picture DEMO PICTURE.png."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from experiments.report.style import PALETTE, REFERENCE
from identification.campaign import read_campaign
from steer_env.plants import Reference
from steer_env.units import from_kmh, to_deg

SPEED_KMH = 75.0
SIZE, DPI = (10.5, 3.4), 110


def main(demo: Path, picture: Path) -> None:
    """Three panels: measured, identified, rendered."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=SIZE, dpi=DPI, layout="constrained")
    _measured(axes[0], demo)
    _identified(axes[1], demo)
    _rendered(axes[2], demo)
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    figure.savefig(picture)


def _measured(axis: Any, demo: Path) -> None:
    runs = read_campaign(demo / "campaign").select("steady_state")[SPEED_KMH]
    for run in runs:
        angle, torque = run.channels["pinion_angle_rad"], run.channels["torsion_bar_torque_Nm"]
        axis.plot(np.degrees(angle), torque, ".", markersize=1.5, color="#7B8794")
    axis.set_title("1  measured: a car in slow corners", fontsize=10)
    axis.set_xlabel("pinion angle / deg", fontsize=9)
    axis.set_ylabel("torsion-bar torque / N m", fontsize=9)


def _identified(axis: Any, demo: Path) -> None:
    reference = Reference.load(demo / "identified" / "reference.json")
    frequency = np.geomspace(0.2, 5.0, 200)
    for row, colour in zip(reference.file.rows, PALETTE, strict=False):
        system = reference.to_statespace(from_kmh(row.speed_kmh))
        gain = to_deg(1.0) * np.abs(system(2j * np.pi * frequency)[0, 0])
        axis.loglog(frequency, gain, color=colour, label=f"{row.speed_kmh:.0f} km/h")
    axis.set_title("2  identified: its haptic reference", fontsize=10)
    axis.set_xlabel("frequency / Hz", fontsize=9)
    axis.set_ylabel("angle per torque / deg per N m", fontsize=9)
    axis.minorticks_off()
    axis.set_xticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
    axis.set_yticks([3, 5, 10, 20, 40], ["3", "5", "10", "20", "40"])
    axis.legend(fontsize=8)


def _rendered(axis: Any, demo: Path) -> None:
    for name, colour in (("open_loop_map", PALETTE[0]), ("pid", PALETTE[1])):
        (path,) = (demo / "benchmark" / "cases").glob(f"EPAS_impedance_075_steady_state_relaxed_{name}-*.json")
        plot = json.loads(path.read_text("utf-8"))["plot"]
        if name == "pid":
            axis.plot(
                plot["reference_angle_deg"], plot["reference_torque_Nm"], "--", color=REFERENCE, label="reference"
            )
        axis.plot(plot["achieved_angle_deg"], plot["achieved_torque_Nm"], color=colour, label=name)
    axis.set_title("3  rendered: another wheel feels like it", fontsize=10)
    axis.set_xlabel("pinion angle / deg", fontsize=9)
    axis.set_ylabel("torsion-bar torque / N m", fontsize=9)
    axis.legend(fontsize=8)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
