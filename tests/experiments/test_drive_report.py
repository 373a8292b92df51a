"""The report of a drive says what the fit found, in one file."""

from pathlib import Path

from experiments.report.drive import write_drive_report
from identification.campaign import read_campaign
from identification.drive import DriveModel
from tests.identification.synthetic_drive import drive, write_drive_campaign


def test_report_holds_the_numbers_and_four_figures(tmp_path: Path) -> None:
    """Catches a table of other numbers than the fit's, a lost figure, a half-written page."""
    campaign = read_campaign(write_drive_campaign(tmp_path / "campaign", drive(2, seconds=100.0)))
    model = DriveModel(speed_knots=3).fit(campaign)
    page = write_drive_report(campaign, model, tmp_path / "report.html")
    html = page.read_text("utf-8")
    assert f"{model.params_['friction_level_Nm']:.2f} N m" in html
    for name in ("Loops", "Parameters", "What to trust", "Traces", "without friction"):
        assert name in html
    assert html.count("Figure ") >= 3
    assert ">nan<" not in html.lower()
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["report.html"]
