"""measurements.json: written, read back, and refused where it is damaged."""

from __future__ import annotations

from pathlib import Path

import pytest
from phantoms import write_case

from palpate.case.measured.measurements import FILE, Measurement, read_measurements, write_measurements
from palpate.core.errors import InputError


def test_measurements_come_back_and_leave_no_file_when_all_are_gone(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    assert read_measurements(case) == ()
    kept = (
        Measurement("A", "distance", "axial", ((0.0, 0.0, 1.0), (3.0, 4.0, 1.0))),
        Measurement("B", "region", "coronal", ((0.0, 2.0, 0.0), (9.0, 2.0, 0.0), (0.0, 2.0, 9.0))),
    )
    write_measurements(case, kept)
    assert read_measurements(case) == kept
    write_measurements(case, ())
    assert not case.has(FILE)


@pytest.mark.parametrize(
    "text",
    [
        '{"measurements": [{"name": "A", "kind": "distance", "plane": "axial", "points": [[0, 0, 0]]}]}',
        '{"measurements": [{"name": "A", "kind": "depth", "plane": "axial", "points": []}]}',
        '{"measurements": 3}',
        "no json",
    ],
)
def test_a_damaged_file_is_named(tmp_path: Path, text: str) -> None:
    case = write_case(tmp_path / "case")
    case.write_text(FILE, text)
    with pytest.raises(InputError, match=FILE):
        read_measurements(case)
