"""The report of a body on a bench: its page says what diagnosis.json says, with a picture of every state."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bench_case import facts, write

from palpate.case.case_folder import CaseFolder
from palpate.case.steps import diagnose
from palpate.core.errors import InputError
from palpate.core.worker.inline import run_inline
from palpate.ui.pictures.bench_pictures import magnification
from palpate.ui.report import report_step


def test_the_page_of_a_body_shows_states_forces_and_the_research_line(tmp_path: Path) -> None:
    case = CaseFolder(write(tmp_path / "case", facts()))
    with pytest.raises(InputError, match=r"diagnosis.json is not there; run `palpate diagnose` first"):
        report_step.run(case)
    found = diagnose.run(case, do_job=run_inline)
    written = report_step.run(case)
    page = Path(written["html"]).read_text()
    assert "Research use only" in page
    assert found.in_words in page
    assert "disc, z" in page and "-1.100 ± 0.100" in page
    assert [Path(p).name for p in written["pictures"]] == ["state_1.png"]
    assert written["pdf"] is not None and Path(written["pdf"]).stat().st_size > 10_000


def test_arrows_are_magnified_to_what_is_seen_beside_the_body() -> None:
    maps = {
        "points": np.array([[0.0, 0.0, 0.0], [100.0, 10.0, 10.0]]),
        "state_1/residual": np.array([[0.2, np.nan, -0.1]]),
    }
    assert magnification(maps, 1) == 50
    maps["state_1/residual"] *= 1000.0
    assert magnification(maps, 1) == 1
