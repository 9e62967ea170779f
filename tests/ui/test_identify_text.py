"""What a person reads of an identification."""

from __future__ import annotations

from pathlib import Path

from phantoms import result

from palpate.segmentation.case import CaseFolder
from palpate.segmentation.case_facts import CaseFacts
from palpate.ui.cli.identify import text_of


def test_the_console_says_what_the_pair_tells(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "case", CaseFacts("made-up"))
    found = result()
    found["identifiability"]["verdict"] = (
        "nothing can be identified: the second scan shows the same as the first; no more"
    )
    lines = text_of(case, found)
    assert "says    nothing can be identified: the second scan shows the same as the first" in lines
    assert "says    no more" in lines
