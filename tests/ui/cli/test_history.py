"""The record of commands in a case: what was asked for, and no path, which may hold a patient's name."""

from __future__ import annotations

from pathlib import Path

import pytest
from phantoms import write_case

from palpate.case import history
from palpate.core.errors import ConvergenceError, InputError
from palpate.ui.cli import main as cli
from palpate.ui.cli.steps import record, recorded


def test_history_holds_options_and_no_paths(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    line = ["import", "/scans/Doe^Jane/rest", "/scans/Doe^Jane/full", "-o", str(case.path), "--seed", "4", "--no-align"]
    record(case, cli.arguments([*line, "--rest-labels", "/scans/Doe^Jane/rs.dcm"]), 12.34)
    (entry,) = case.read_json(history.FILE)["commands"]
    assert entry["command"] == "import" and entry["seconds"] == 12.3
    assert "--no-align" in entry["options"] and "--seed 4" in entry["options"]
    assert "Doe" not in case.file(history.FILE).read_text()


def test_history_keeps_the_last_hundred_and_only_what_ended_well(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    args = cli.arguments(["report", str(case.path)])
    for seconds in range(103):
        record(case, args, float(seconds))
    with pytest.raises(ConvergenceError, match="no"), recorded(case, args):
        raise ConvergenceError("no")
    kept = case.read_json(history.FILE)["commands"]
    assert len(kept) == 100 and kept[-1]["seconds"] == 102.0


def test_a_case_that_cannot_be_written_is_told_before_the_step_starts(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    case.path.chmod(0o555)
    ran = []
    with (
        pytest.raises(InputError, match=r"case cannot be written \(the place is read-only\); copy the case"),
        recorded(case, cli.arguments(["mesh", str(case.path)])),
    ):
        ran.append("mesh")
    case.path.chmod(0o755)
    assert ran == [] and not case.has(history.FILE)
