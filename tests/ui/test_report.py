"""What a report says, and what it never says."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
import pytest
from phantoms import result, write_case
from pypdf import PdfReader

from palpate.core.errors import InputError
from palpate.segmentation.case import CaseFacts, CaseFolder
from palpate.ui.report import report_step
from palpate.ui.report.quality import without_paths
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import number, region_words
from palpate.ui.report.summary import summary

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
    assert "G = 2 (\u03bc1 + \u03bc2)" in text and "ab" * 32 in html


def test_pictures_are_listed_and_a_second_run_does_nothing(case: CaseFolder) -> None:
    before = case.file("report/report.html").stat().st_mtime_ns
    written = report_step.run(case)
    assert {Path(p).stem for p in written["pictures"]} == {
        "stiffness_planes", "stiffness_series", "deformation_planes", "convergence",
    }  # fmt: skip
    assert case.file("report/report.html").stat().st_mtime_ns == before


def test_simulated_data_say_so_on_every_page(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", other={"simulated": True, "simulated_note": "second state by finite elements"})
    report_step.run(case)
    pages = [page.extract_text() for page in PdfReader(case.file("report/report.pdf")).pages]
    assert all("Simulated data: second state by finite elements" in page for page in pages)
    assert "Simulated data" in case.file("report/report.html").read_text(encoding="utf-8")


def test_a_case_without_a_result_says_what_to_run(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    case.remove("result.json")
    with pytest.raises(InputError, match=r"result\.json is not there; run the step that writes it"):
        report_step.run(case)
    case.write_json("result.json", {"parameters": {}})
    with pytest.raises(InputError, match=r"has no identifiability; run `palpate identify` again"):
        report_step.run(case)


def record(found: dict, covariance: np.ndarray | None = None) -> CaseRecord:
    facts = CaseFacts("c", boundary_noise_sd_mm=0.4)
    return CaseRecord(facts, found, {}, {}, {}, {}, ln_covariance=covariance)


def test_summary_names_the_stiffer_half_only_when_the_errors_allow() -> None:
    clear = summary(record(result(120.0, 40.0)))[0]
    assert clear.startswith("The left half of the prostate is 3.0 times as stiff as the right half")
    assert summary(record(result(40.0, 120.0)))[0].startswith("The right half of the prostate is 3.0 times")
    assert summary(record(result(42.0, 40.0)))[0].startswith("This pair does not tell which is stiffer")


def test_errors_that_go_together_make_the_ratio_surer_than_either() -> None:
    together = np.array([[0.0100, 0.0099], [0.0099, 0.0100]])
    assert summary(record(result(44.0, 40.0)))[0].startswith("This pair does not tell")
    assert summary(record(result(44.0, 40.0), together))[0].startswith("The left half of the prostate is 1.1 times")


def test_summary_is_plain_about_what_is_no_measurement() -> None:
    found = result()
    found["parameters"]["prostate_left"].update(G_kpa=500.0, at_bound=True)
    assert any("edge of what was allowed" in s and "no measurement" in s for s in summary(record(found)))
    found = result()
    found["parameters"]["prostate_right"]["ci95_kpa"] = [5.2, 480.0]
    assert any("does not tell the stiffness of the right half" in s for s in summary(record(found)))


def test_summary_weighs_the_misfit_against_the_noise() -> None:
    good, bad = result(), result()
    bad["misfit"]["rms_mm"] = 1.9
    assert (
        "contours' own error explains (0.57 mm expected if contours repeat to 0.40 mm, as the case"
        in summary(record(good))[-1]
    )
    assert "something is left out of the model" in summary(record(bad))[-1]


def test_summary_doubts_a_stiffness_on_which_the_searches_differ() -> None:
    words = "swarm and Gauss-Newton end at different stiffnesses (20 and 60 kPa)"
    doubtful = summary(record(result(agreement={"harmless": False, "in_words": words})))
    assert f"Doubtful: {words}." in doubtful
    assert not any(words in s for s in summary(record(result(agreement={"harmless": True, "in_words": words}))))


@pytest.mark.parametrize(
    "name, alone, words",
    [
        ("prostate_left", False, "left half of the prostate"),
        ("prostate_left", True, "prostate"),
        ("surrounding_tissue", True, "surrounding tissue"),
    ],
)
def test_regions_are_called_what_people_call_them(name: str, alone: bool, words: str) -> None:
    assert region_words(name, alone) == words


@pytest.mark.parametrize("value, text", [(148.26, "148"), (62.44, "62.4"), (7.3, "7.30"), (0.0, "0"), (1234.5, "1234")])
def test_three_figures(value: float, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize("path", ["/data/Doe Jane/x.dcm", r"C:\scans\Doe\x.dcm", "/Doe"])
def test_paths_are_left_out_of_notes(path: str) -> None:
    assert without_paths(f"rest: {path} has 33 slices") == "rest: (path) has 33 slices"
