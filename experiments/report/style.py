"""How our figures look: colours that colour-blind readers can tell apart, engineering axes."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import plotly.graph_objects as go
from plotly.colors import sample_colorscale

# Okabe and Ito's palette (2008), ordered so that the first ones differ most; its yellow is too
# faint on white and left out. Behind it three that stay apart from all of these in simulated
# protanopia and deuteranopia (Machado 2009).
PALETTE = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#4D4D4D", "#802000", "#2A00E0", "#9CB259",
)  # fmt: skip
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "x", "cross", "star", "triangle-down", "pentagon", "hexagon")
INK, GRID, MUTED = "#1F2933", "#E4E7EB", "#616E7C"
REFERENCE = INK  # the reference that others are compared with: always this, dashed
FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif'
DATA = "#7B8794"  # measured dots where one fit lies over them
DOT_SIZE, LINE_WIDTH = 4.5, 2.0


def ordered_colours(count: int) -> list[str]:
    """Colours for an ordered quantity (speeds, ascending): dark to light, even in grey print."""
    if count < 2:
        return [PALETTE[0]][:count]
    return sample_colorscale("Viridis", [0.88 * k / (count - 1) for k in range(count)])


def colour_of(names: Sequence[str], ordered: bool = False) -> dict[str, str]:
    """One colour per distinct name, in order of appearance."""
    distinct = list(dict.fromkeys(names))
    if ordered or len(distinct) > len(PALETTE):
        return dict(zip(distinct, ordered_colours(len(distinct)), strict=True))
    return dict(zip(distinct, PALETTE, strict=False))


class Look(NamedTuple):
    """How one of many things that are compared is drawn: label, colour and, for those who cannot tell it, symbol."""

    label: str
    colour: str
    symbol: str


def looks_of(names: Sequence[str]) -> dict[str, Look]:
    """A look per distinct name, in order of appearance; of a path only its last part (and "policy:") is the label."""
    colours = colour_of(names)
    ends = [re.sub(r"^((?:\w{2,}:)*).*/", r"\1", name) for name in colours]
    return {
        name: Look(end if ends.count(end) == 1 else name, colour, SYMBOLS[k % len(SYMBOLS)])
        for k, ((name, colour), end) in enumerate(zip(colours.items(), ends, strict=True))
    }


def _axis() -> dict[str, object]:
    return {
        "showline": True,
        "linecolor": MUTED,
        "mirror": True,
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": MUTED,
        "gridcolor": GRID,
        "zeroline": False,
        "automargin": True,
        "title": {"standoff": 8, "font": {"size": 13}},
        "exponentformat": "power",
    }


TEMPLATE = go.layout.Template(
    layout={
        "font": {"family": FONT, "size": 12.5, "color": INK},
        "colorway": list(PALETTE),
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "white",
        "margin": {"l": 64, "r": 16, "t": 40, "b": 52},
        "xaxis": _axis(),
        "yaxis": _axis(),
        "hoverlabel": {"font": {"family": FONT, "size": 12}},
        "legend": {"font": {"size": 12}, "itemwidth": 34},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "#9AA5B1", "activecolor": PALETTE[0]},
        "bargap": 0.25,
    }
)
