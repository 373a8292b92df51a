"""What an environment shows: the wheel, and the last seconds against the reference."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

from steer_env.units import to_deg, to_kmh

WINDOW = 4.0  # s shown
EVERY = 10  # periods between two kept points
SIZE = (9.6, 4.8)  # inches at 100 dpi
TRUE, IDEAL = "#0072B2", "#D55E00"  # Okabe-Ito blue and vermilion


class Viewer:
    """Draws with matplotlib; a window only where ``window`` asks for one."""

    def __init__(self, causality: str, window: bool) -> None:
        self.impedance = causality == "impedance"
        self.window = window
        self.restart()
        if window:
            import matplotlib.pyplot as plt

            plt.ion()
            self.figure = plt.figure(figsize=SIZE, dpi=100)
        else:
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure

            self.figure = Figure(figsize=SIZE, dpi=100)
            FigureCanvasAgg(self.figure)
        self._build()

    def restart(self) -> None:
        """Forget the traces: a new episode."""
        self.points: deque[tuple[float, float, float, float, float]] = deque(maxlen=int(WINDOW * 1000 / EVERY))
        self.count = 0
        self.latest: dict[str, Any] = {}

    def record(self, info: dict[str, Any]) -> None:
        """Take one period's info; redraws a window at its frame rate."""
        self.latest = info
        if self.count % EVERY == 0:
            self.points.append(
                (
                    info["time"],
                    info["torsion_bar_torque"],
                    to_deg(info["pinion_angle"]),
                    info["reference"] if self.impedance else to_deg(info["reference"]),
                    info["command"],
                )
            )
        self.count += 1
        if self.window and self.count % 40 == 0:
            self.draw()

    def draw(self) -> NDArray[np.uint8]:
        """The picture as [h, w, 3]."""
        angle = float(self.latest.get("steering_angle", 0.0))
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        for line, spoke in zip(self.spokes, self.spoke_shapes, strict=True):
            line.set_data(*(turn @ spoke))
        self.caption.set_text(
            f"{to_deg(angle):+.1f} deg   {to_kmh(float(self.latest.get('speed', 0.0))):.0f} km/h"
            f"   t = {float(self.latest.get('time', 0.0)):.2f} s"
        )
        if self.points:
            self._draw_traces(np.array(self.points).T)
        self.figure.canvas.draw()
        if self.window:
            self.figure.canvas.flush_events()
            return np.zeros((0, 0, 3), np.uint8)
        image = np.asarray(self.figure.canvas.buffer_rgba())[:, :, :3]  # type: ignore[attr-defined]
        return np.ascontiguousarray(image)

    def close(self) -> None:
        """Close the window, if any."""
        if self.window:
            import matplotlib.pyplot as plt

            plt.close(self.figure)

    def _draw_traces(self, data: NDArray[np.float64]) -> None:
        time, torque, angle, reference, command = data
        values = {"torque": torque, "angle": angle, "command": command}
        values["ideal"] = reference
        for name, line in self.lines.items():
            line.set_data(time, values[name])
        end = max(float(time[-1]), WINDOW)
        followed = torque if self.impedance else angle
        spans = (
            np.concatenate([followed, reference]),
            angle if self.impedance else torque,
            command,
        )
        for axes, span in zip(self.axes, spans, strict=True):
            axes.set_xlim(end - WINDOW, end)
            reach = max(1.1 * float(np.abs(span).max()), 1.0)
            axes.set_ylim(-reach, reach)

    def _build(self) -> None:
        grid = self.figure.add_gridspec(3, 2, width_ratios=[1, 2], left=0.02, right=0.98, top=0.94, bottom=0.1)
        wheel = self.figure.add_subplot(grid[:, 0])
        wheel.set_aspect("equal")
        wheel.set_axis_off()
        wheel.set_xlim(-1.2, 1.2)
        wheel.set_ylim(-1.5, 1.2)
        wheel.add_patch(matplotlib.patches.Circle((0, 0), 1.0, fill=False, linewidth=9, color="#333333"))
        wheel.add_patch(matplotlib.patches.Circle((0, 0), 0.22, color="#333333"))
        self.spoke_shapes = [np.array([[0.0, math.cos(a)], [0.0, math.sin(a)]]) for a in (0.0, math.pi, -math.pi / 2)]
        self.spoke_shapes.append(np.array([[0.0, 0.0], [0.94, 1.06]]))
        colours = ["#333333"] * 3 + [IDEAL]
        self.spokes = [wheel.plot([], [], color=c, linewidth=7, solid_capstyle="butt")[0] for c in colours]
        self.caption = wheel.text(0, -1.4, "", ha="center", fontsize=11)
        grid.update(hspace=0.3)
        self.axes = [self.figure.add_subplot(grid[k, 1]) for k in range(3)]
        for axes in self.axes[:2]:
            axes.tick_params(labelbottom=False)
        followed, other = ("torque", "angle") if self.impedance else ("angle", "torque")
        units = {"torque": "torsion-bar torque / N m", "angle": "pinion angle / deg"}
        self.lines = {
            "ideal": self.axes[0].plot([], [], color=IDEAL, linestyle="--", label="reference")[0],
            followed: self.axes[0].plot([], [], color=TRUE, label="plant")[0],
            other: self.axes[1].plot([], [], color=TRUE)[0],
            "command": self.axes[2].plot([], [], color="#555555")[0],
        }
        for axes, label in zip(self.axes, (units[followed], units[other], "motor command / N m"), strict=True):
            axes.set_title(label, fontsize=9, loc="left", pad=3)
            axes.tick_params(labelsize=8)
            axes.grid(alpha=0.3)
        self.axes[0].legend(loc="upper right", fontsize=8, ncols=2)
        self.axes[2].set_xlabel("time / s", fontsize=9)
