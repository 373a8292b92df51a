"""Fixtures that several folders share."""

import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1280,1600",
    "--enable-logging=stderr",
    "--virtual-time-budget=30000",
    "--dump-dom",
)


@pytest.fixture
def assert_report_draws(tmp_path):
    """A function (path, figures=None) that opens a page and fails unless everything in it drew.

    figures: how many the page must have; None: at least one. Skips where no browser is installed.
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip(f"no browser to open the report in (looked for {', '.join(BROWSERS)})")

    def check(path: Path, figures: int | None = None) -> None:
        command = [browser, *FLAGS, f"--user-data-dir={tmp_path / 'browser'}", path.as_uri()]
        done = subprocess.run(
            command, capture_output=True, text=True, encoding="utf-8", timeout=180, check=True
        )
        said = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
        assert not said, "the console is not clean:\n" + "\n".join(said)
        drawn = _figures_in(done.stdout)
        if figures is None:
            assert drawn, "no figure in the page"
        else:
            assert len(drawn) == figures
        assert all(marks > 0 for marks in drawn), f"marks drawn per figure: {drawn}"

    return check


class _Figures(HTMLParser):
    """Counts, per .plotly-graph-div, the paths and images that stand for data.

    They lie in the trace layers (class "mlayer"); axes, grid and legend lie outside of those.
    """

    VOID = frozenset(("area", "br", "col", "hr", "img", "input", "link", "meta", "wbr"))
    NESTING = ("plotly-graph-div", "main-svg", "mlayer")

    def __init__(self) -> None:
        super().__init__()
        self.marks: list[int] = []
        self._open: list[str | None] = []  # which level of NESTING each open element is

    def handle_starttag(self, tag, attributes):
        if tag in self.VOID:
            return
        values = dict(attributes)
        classes = (values.get("class") or "").split()
        level = next((name for name in self.NESTING if name in classes), None)
        self._open.append(level)
        if level == "plotly-graph-div":
            self.marks.append(0)
        if (values.get("d") or values.get("xlink:href")) and set(self.NESTING) <= set(self._open):
            self.marks[-1] += 1

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            self._open.pop()


def _figures_in(dom: str) -> list[int]:
    """Marks drawn in each figure of the page."""
    parser = _Figures()
    parser.feed(re.sub(r"<script\b.*?</script>", "", dom, flags=re.DOTALL))
    return parser.marks
