"""A report: one HTML file that opens anywhere, offline, and prints."""

import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup, escape
from plotly.offline import get_plotlyjs

from experiments.report.style import TEMPLATE
from steer_env import __version__, atomic

_MARKDOWN = MarkdownIt("commonmark", {"html": True}).enable("table")
DEFAULT_HEIGHT = 420  # px of a figure that names none


class Report:
    """Collects blocks in reading order; write() makes the page.

    Args:
        title: heading of the page.
        subtitle: one line below it.
        provenance: what a reader needs to make the page again (campaign, seed ...), name to value.
            Version and date are added.
    """

    def __init__(
        self, title: str, subtitle: str = "", provenance: Mapping[str, object] | None = None
    ) -> None:
        self.title, self.subtitle = title, subtitle
        self.provenance = {str(key): str(value) for key, value in (provenance or {}).items()}
        self._blocks: list[dict[str, Any]] = []
        self._figures: list[str] = []
        self._tables = 0
        self._browser = ""
        self._sections: list[tuple[str, str]] = []

    def section(self, heading: str) -> "Report":
        """Begin a section; it appears in the table of contents."""
        slug = re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-") or "section"
        anchor = f"{slug}-{len(self._sections) + 1}"
        self._sections.append((anchor, heading))
        return self._add("section", anchor=anchor, heading=heading)

    def text(self, html_or_markdown: str) -> "Report":
        """Add text. It is trusted: pass what a user wrote through html.escape first.

        A quotation ("> ...") is drawn as a remark that the reader should not miss.
        """
        return self._add("text", html=Markup(_MARKDOWN.render(html_or_markdown)))

    def key_numbers(self, numbers: Sequence[tuple[str, str]]) -> "Report":
        """Add a row of (value with unit, what it is): the answer at a glance."""
        return self._add("key_numbers", numbers=list(numbers))

    def table(
        self, columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str = "", dense: bool = False
    ) -> "Report":
        """Add a table; columns of numbers stand to the right, floats get four digits, None a dash.

        Cells and captions are text: markup in them is shown, unless it is a markupsafe.Markup. A ``dense``
        table has many columns or rows; its lines break in the last column only.
        """
        numeric = [all(_is_number(row[k]) for row in rows) for k in range(len(columns))]
        cells = [[_cell(value) for value in row] for row in rows]
        self._tables += 1
        return self._add(
            "table",
            columns=list(columns),
            numeric=numeric,
            rows=cells,
            caption=caption,
            dense=dense,
            number=self._tables,
        )

    def figure(self, figure: go.Figure, caption: str = "") -> "Report":
        """Add a plotly figure in house style; its height is kept, its width follows the page."""
        content = json.loads(figure.to_json())
        layout = content["layout"]
        layout.pop("template", None)  # the page holds ours once
        layout.pop("width", None)
        layout.setdefault("height", DEFAULT_HEIGHT)
        self._figures.append(_for_script(content))
        return self._add(
            "figure", number=len(self._figures), height=layout["height"], caption=caption
        )

    def case_browser(self, data: Mapping[str, Any]) -> "Report":
        """Add a browser of single cases (case_browser.js says what it reads); one per page, left out in print."""
        self._browser = _for_script(data)
        return self._add("case_browser", fields=list(data["fields"]))

    def html(self) -> str:
        """The page as text."""
        environment = Environment(
            loader=PackageLoader("experiments.report", "."),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        return environment.get_template("page.html").render(
            title=self.title,
            subtitle=self.subtitle,
            provenance={"steer-env": __version__, "date": _date(), **self.provenance},
            sections=self._sections,
            blocks=self._blocks,
            figures=[Markup(figure) for figure in self._figures],
            template=Markup(_for_script(TEMPLATE.to_plotly_json())),
            browser=Markup(self._browser),
            plotly_js=Markup(get_plotlyjs()) if self._figures or self._browser else "",
        )

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the page to path, whole or not at all."""
        atomic.write_text(path, self.html())
        return Path(path)

    def _add(self, kind: str, **content: Any) -> "Report":
        self._blocks.append({"kind": kind, **content})
        return self


def _for_script(content: object) -> str:
    """JSON that may stand inside a script element: no text in it can end the element."""
    return json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")


def _date() -> str:
    """Now, or the moment that a reproducible build fixes."""
    fixed = os.environ.get("SOURCE_DATE_EPOCH")
    moment = datetime.fromtimestamp(int(fixed), UTC) if fixed else datetime.now(UTC)
    return moment.strftime("%Y-%m-%d %H:%M UTC")


def _is_number(value: object) -> bool:
    if value is None or isinstance(value, int | float):
        return True
    return bool(re.fullmatch(r"[\s\d.,eE+\-−–±×·≥^%()/]*", str(value)))


def _cell(value: object) -> Markup:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return Markup("–")
    if isinstance(value, float):
        return escape(f"{value:.4g}".replace("-", "−"))
    return escape(value)
