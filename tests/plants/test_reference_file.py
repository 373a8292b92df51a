"""The reference file: what is written is read, and the shipped file holds the paper's tables."""

from pathlib import Path

import pytest

from steer_env.plants.reference_file import (
    ReferenceFile,
    published,
    read_reference,
    write_reference,
)


@pytest.fixture
def annotated() -> ReferenceFile:
    """The published reference with standard errors, paper-method values and relaxed slip."""
    reference = published()
    n = len(reference.rows)
    std = tuple({"J_ref": 0.001 * (i + 1), "c_pin_off": 0.25} for i in range(n))
    frf = tuple({"b_ref": 1.4, "k_gain": 2.0} if i % 2 else {} for i in range(n))
    return ReferenceFile(
        reference.vehicle,
        reference.rows,
        "relaxed",
        std,
        frf,
        reference.extrapolated,
        {"campaign": "Probe ü"},
    )


def test_round_trip_keeps_every_number(annotated: ReferenceFile, tmp_path: Path) -> None:
    """Catches a key written under one name and read under another, and rounding on the way."""
    write_reference(tmp_path / "reference.json", annotated)
    assert read_reference(tmp_path / "reference.json") == annotated


def test_equal_references_give_equal_bytes_in_any_row_order(
    annotated: ReferenceFile, tmp_path: Path
) -> None:
    """Catches a writer that follows the order of a dict or of the rows it was handed."""
    backwards = ReferenceFile(
        annotated.vehicle,
        annotated.rows[::-1],
        annotated.slip,
        tuple(dict(reversed(row.items())) for row in annotated.std[::-1]),
        annotated.frf[::-1],
        annotated.extrapolated[::-1],
        annotated.provenance,
    )
    write_reference(tmp_path / "a.json", annotated)
    write_reference(tmp_path / "b.json", backwards)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_unknown_standard_error_is_left_out(annotated: ReferenceFile, tmp_path: Path) -> None:
    """Catches a NaN in the file, which JSON does not know and our own reader refuses."""
    annotated.std[0]["n_t"] = float("nan")
    write_reference(tmp_path / "reference.json", annotated)
    assert "n_t" not in read_reference(tmp_path / "reference.json").std[0]


def test_writer_refuses_a_value_that_is_not_finite_and_writes_nothing(
    annotated: ReferenceFile, tmp_path: Path
) -> None:
    """Catches a fit that failed and would ship NaN parameters."""
    rows = (annotated.rows[0]._replace(J_ref=float("nan")), *annotated.rows[1:])
    broken = ReferenceFile(
        annotated.vehicle,
        rows,
        annotated.slip,
        annotated.std,
        annotated.frf,
        annotated.extrapolated,
        {},
    )
    with pytest.raises(ValueError, match="JSON"):
        write_reference(tmp_path / "reference.json", broken)
    assert list(tmp_path.iterdir()) == []


def test_shipped_file_is_the_published_tables() -> None:
    """Golden values from Tables 2 and 3 of Chugh et al. (2019), one per column."""
    reference = published()
    rows = {row.speed_kmh: row for row in reference.rows}
    assert list(rows) == [15, 30, 45, 60, 75, 90, 105]
    assert reference.slip == "kinematic"  # Eq. 10 as printed
    assert rows[105].J_ref == 0.0512
    assert rows[15].b_ref == -1.242
    assert rows[90].k_gain == 2.475
    assert rows[15].n_t == 0.1594
    assert (rows[60].sigma_f, rows[60].sigma_r) == (0.3061, 0.3223)
    assert (rows[75].C_f, rows[75].C_r) == (138080, 159010)
    assert rows[30].J_z == 3020
    assert (rows[45].c_pin_on, rows[45].c_pin_off, rows[45].M_fric_C) == (18.765, 1.735, 2.113)
    assert rows[15].c_pin_off == 0


def test_shipped_file_flags_what_the_paper_does_not_give() -> None:
    """Catches our own numbers being passed off as published ones."""
    reference = published()
    assert reference.extrapolated[0] == ("M_fric_C", "c_fric", "sigma_assist")
    assert set(reference.extrapolated[1:]) == {("c_fric", "sigma_assist")}
    assert reference.rows[0].M_fric_C == pytest.approx(1.64, abs=0.005)


def test_front_axle_share_of_set_R() -> None:
    """Set R carries 54.1 % of the weight in front; catches l_f and l_r swapped."""
    vehicle = published().vehicle
    share = vehicle.cg_to_rear_axle / (vehicle.cg_to_front_axle + vehicle.cg_to_rear_axle)
    assert share == pytest.approx(0.541, abs=5e-4)
