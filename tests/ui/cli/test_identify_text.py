"""What a person reads of an identification."""

from __future__ import annotations

from pathlib import Path

from diagnoses import diagnosis
from phantoms import agreement, recorded, result

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.files.json_types import typed
from palpate.ui.cli.commands import diagnose
from palpate.ui.cli.commands.identify import text_of


def test_the_console_says_what_the_pair_tells(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "case", CaseFacts("made-up"))
    found = result()
    found["identifiability"]["verdict"] = (
        "nothing can be identified: the second scan shows the same as the first; no more"
    )
    lines = text_of(case, recorded(found))
    assert "says    nothing can be identified: the second scan shows the same as the first" in lines
    assert "says    no more" in lines


def test_the_console_doubts_a_stiffness_on_which_the_searches_differ(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "case", CaseFacts("made-up"))
    words = "swarm and Gauss-Newton end at different stiffnesses (prostate left 20 and 60 kPa)"
    assert f"doubt   {words}" in text_of(case, recorded(result(agreement=agreement(harmless=False, in_words=words))))
    assert not any(
        words in line for line in text_of(case, recorded(result(agreement=agreement(harmless=True, in_words=words))))
    )


def test_a_contour_that_was_carried_over_has_no_error_of_one_contour_on_the_console(tmp_path: Path) -> None:
    case, found = (
        CaseFolder.create(tmp_path / "case", CaseFacts("made-up")),
        result(contour_errors_mm={"rest": {"organ": 0.8}}),
    )
    assert "noise   the prostate's contours are one, carried over by the images" in text_of(case, recorded(found))
    found["misfit"]["contour_noise_sd_mm"] = 0.8
    assert "noise   0.80 mm of the prostate's contours, estimated from the images" in text_of(case, recorded(found))


def test_an_alarm_on_the_console_says_that_it_may_be_a_false_one(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "case", CaseFacts("made-up"))
    texts = {
        verdict: " ".join(diagnose.text_of(case, typed(diagnosis(verdict), DiagnosisRecord, "a test")))
        for verdict in ("none", "ambiguous")
    }
    assert "docs/gap.md" in texts["ambiguous"] and "docs/gap.md" not in texts["none"]
