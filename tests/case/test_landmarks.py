"""Landmark files: every cell is used or refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from palpate.case.landmarks import COLUMNS, read_landmarks
from palpate.core.errors import InputError


def test_decimal_commas_are_refused(tmp_path: Path) -> None:
    """`1,5` for 1.5 moves every number behind it into the next column."""
    path = tmp_path / "points.csv"
    path.write_text(f"{','.join(COLUMNS)}\na,1,5,2,3,4,5,6\n")
    with pytest.raises(InputError, match=r"points\.csv line 2 has 8 cells under 7 columns, '6' under none"):
        read_landmarks(path)


def test_decimal_commas_of_a_bench_bodys_points_are_refused(tmp_path: Path) -> None:
    """The points file of a state need not have all columns."""
    path = tmp_path / "points.csv"
    path.write_text("name,rest_x,rest_y,rest_z,deformed_z\na,1,5,2,3,4\n")
    with pytest.raises(InputError, match=r"points\.csv line 2 has 6 cells under 5 columns, '4' under none"):
        read_landmarks(path, ("deformed_x", "deformed_y"), ("deformed_z",))
