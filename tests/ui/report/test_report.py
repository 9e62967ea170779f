"""What a report says, and what it never says."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from phantoms import result, write_case
from pypdf import PdfReader

from palpate.case.case_folder import CaseFolder
from palpate.case.rigid_offset import RigidOffset
from palpate.core.errors import InputError
from palpate.ui.report import declaration as program
from palpate.ui.report import report_step

# Not "4711" alone: a sum of a file in hexadecimal digits holds it by chance.
IDENTITY = ("Doe", "Jane", "4711-", "XYZ")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    """A reported case of a patient with a name, notes with paths in them, and no surfaces."""
    found = result(notes=["read from /data/Doe Jane/scan 1/x.dcm today"])
    case = write_case(tmp_path_factory.mktemp("Doe_Jane") / "case", found, ct=True)
    case.write_json("import.json", {"case": str(case.path), "notes": [f"rest: {case.path}/rest_ct has 33 slices"]})
    report_step.run(case)
    return case


@pytest.fixture(scope="module")
def html(case: CaseFolder) -> str:
    return case.file("report/report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def pages(case: CaseFolder) -> list[str]:
    return [page.extract_text() for page in PdfReader(case.file("report/report.pdf")).pages]


def test_every_page_says_research_use_only(pages: list[str], html: str) -> None:
    assert len(pages) >= 2
    assert all("Research use only" in page and "not for diagnosis" in page for page in pages)
    assert "Research use only" in html


def test_no_identity_of_the_patient_anywhere(case: CaseFolder, pages: list[str], html: str) -> None:
    text = (
        "\n".join(pages) + re.sub(r"base64,[^\"]*", "", html) + str(PdfReader(case.file("report/report.pdf")).metadata)
    )
    assert not [name for name in IDENTITY if name in text]
    assert "33 slices" in text, "the note itself is there, its path is not"
    assert not [name for name in IDENTITY for path in case.file("report").iterdir() if name in path.name]


def test_page_needs_nothing_else(html: str) -> None:
    sources = re.findall(r'(?:src|href)="([^"]*)"', html)
    assert len(sources) >= 4
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert base64.b64decode(sources[0].partition(",")[2])[:4] == b"\x89PNG"
    assert "http" not in re.sub(r"base64,[^\"]*", "", html)
    assert html.count("<img") == len(re.findall(r'alt="[^"]{20,}"', html)), "every picture is told in words"


def test_a_hostile_case_name_stays_text(html: str) -> None:
    assert "asymmetric &lt;case&gt; &amp; co" in html


def test_table_holds_the_figures_and_the_meaning_of_kpa(pages: list[str], html: str) -> None:
    text = re.sub(r"\s+", " ", " ".join(pages))
    for expected in ("120", "100 to 144", "12.0", "30.0", "33.3 to 48.0", "0.41 mm", "0.83 mm", "1.40 mm", "seed 7"):
        assert expected in text and expected in html, expected
    assert "G = 2 (\u03bc1 + \u03bc2)" in text and "ab" * 6 in html


def test_pictures_are_listed_and_a_second_run_does_nothing(case: CaseFolder) -> None:
    before = case.file("report/report.html").stat().st_mtime_ns
    written = report_step.run(case)
    assert {Path(p).stem for p in written["pictures"]} == {
        "published", "stiffness_planes", "stiffness_series", "deformation_planes",
    }  # fmt: skip
    assert case.file("report/report.html").stat().st_mtime_ns == before


def test_a_report_of_another_program_and_one_with_a_gap_are_made_again(
    case: CaseFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = case.file("report/report.html")
    monkeypatch.setattr(report_step, "REPORT", replace(report_step.REPORT, program=lambda: "another"))
    times = [page.stat().st_mtime_ns]
    report_step.run(case)
    times.append(page.stat().st_mtime_ns)
    case.write_json("report/missing.json", ["the 3D view, because a library was missing then"])
    assert report_step.run(case)["missing"] == [] and times[0] < times[1] < page.stat().st_mtime_ns


def test_any_change_of_what_draws_the_report_is_another_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("words/label_words.py", "pictures/slices.py", "report/page.html"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("as it was")
    monkeypatch.setattr(program, "_UI", tmp_path)
    marks = {program.drawn_by.__wrapped__()}
    for name in ("words/label_words.py", "pictures/slices.py", "report/page.html"):
        (tmp_path / name).write_text("changed")
        marks.add(program.drawn_by.__wrapped__())
    assert len(marks) == 4
    (tmp_path / "report/__pycache__").mkdir()
    assert program.drawn_by.__wrapped__() in marks


def test_simulated_data_say_so_on_every_page(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", other={"simulated": True, "simulated_note": "second state by finite elements"})
    report_step.run(case)
    pages = [page.extract_text() for page in PdfReader(case.file("report/report.pdf")).pages]
    assert all("Simulated data: second state by finite elements" in page for page in pages)
    assert "Simulated data" in case.file("report/report.html").read_text(encoding="utf-8")


def test_a_case_without_a_result_says_what_to_run(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    case.remove("result.json")
    with pytest.raises(InputError, match=r"result\.json is not there; run `palpate identify` first"):
        report_step.run(case)
    case.file("deformed.nii.gz").rename(tmp_path / "away")
    with pytest.raises(
        InputError, match=r"is not there; it contains only the scan at rest: `palpate plan` works on it"
    ):
        report_step.run(case)
    (tmp_path / "away").rename(case.file("deformed.nii.gz"))
    case.write_json("result.json", {"parameters": {}})
    with pytest.raises(InputError, match=r"has no identifiability; run `palpate identify` again"):
        report_step.run(case)


def test_the_first_page_says_what_it_does_not_tell(pages: list[str]) -> None:
    page = re.sub(r"\s+", " ", pages[0])
    assert "How sure, left half" in page and "Figure 1. Slices through the organ" in page, (
        "one sentence, one box, one picture"
    )
    first = re.sub(r"\s+", " ", pages[1])
    assert "What this does not show: stiffness in absolute terms" in first
    assert "Figure 2. Found here" in first and "doi:10.1186/s43055-021-00679-8" in first, "published values beside"
    assert "Young's modulus" in first and "Left and right are the patient's" in first


def test_a_deformed_scan_that_lay_elsewhere_is_drawn_on_its_bones(tmp_path: Path) -> None:
    """As `mesh` found it (`laid_elsewhere`)."""
    case = write_case(tmp_path / "case", result())
    given = case.labels("deformed").affine
    np.testing.assert_array_equal(report_step.labels_in_rest_frame(case)["deformed"].affine, given)
    back = np.eye(4)
    back[:3, 3] = [4.0, -3.0, 2.0]
    case.write_json("mesh.json", {"laid_elsewhere": RigidOffset(back, 5.4, 0.0).to_dict()})
    shown = report_step.labels_in_rest_frame(case)
    np.testing.assert_allclose(shown["deformed"].affine, back @ given)
    np.testing.assert_array_equal(shown["rest"].affine, case.labels("rest").affine)
