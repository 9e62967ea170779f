"""A real body whose cause is known: a silicone beam that hangs under its own weight, diagnosed by a model without gravity."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from silicone_beam import make_case

from palpate.case.bench.body import body_problem
from palpate.case.case_folder import CaseFolder
from palpate.case.stated_files import is_body
from palpate.core.diagnose.bench_bodies.diagnose import diagnose_body
from palpate.core.diagnose.effects import library
from palpate.core.files.json_types import plain

DATA = Path(__file__).parents[3] / "shared" / "data" / "silicone_beam"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason=f"{DATA} is not there")
# Some of the library, for speed: with two effects alone their pair would have a tenth of the prior to itself.
EFFECTS = {k: library()[k] for k in ("gravity_change", "compressible_organ", "volume_change", "bone_motion")}


def diagnosed(folder: Path, *states: str) -> dict[str, Any]:
    case = CaseFolder(make_case(DATA, folder, states) if states else make_case(DATA, folder))
    assert is_body(case)
    return plain(diagnose_body(body_problem(case), EFFECTS, "beam")[0])


@needs_data
def test_three_states_name_gravity_and_predict_the_state_left_out(tmp_path: Path) -> None:
    found = diagnosed(tmp_path / "beam")
    assert found["verdict"] == "gravity_change"
    by_name = {row["name"]: row for row in found["states"]}
    assert by_name["gravity"]["held_out_before_mm"] > 5.0
    assert by_name["gravity"]["held_out_after_mm"] < 1.0
    found_gravity = found["ranking"][0]["parameters"]["change"]
    assert found_gravity["value"] == pytest.approx(9.81, rel=0.15)
    assert 3.0 * found["stiffness"]["with_effect"]["body"]["G_kpa"] == pytest.approx(264.0, rel=0.1)  # its authors' E
    assert found["remainder"]["rms_mm"]["load101"] > 1.0
    assert found["remainder"]["cause"] is None


@needs_data
def test_one_loaded_state_cannot_tell_and_asks_for_a_further_load(tmp_path: Path) -> None:
    found = diagnosed(tmp_path / "beam", "load52")
    assert found["verdict"] == "ambiguous"
    assert "gravity_change" in found["candidates"]
    assert "a further load" in found["next_measurement"]
