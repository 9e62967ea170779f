"""The first page: a word for how sure by its printed rule, published values with sources, what is missing."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "fixtures"))
from dicom_cases import NAME, NUMBER, pair
from phantoms import affine, result

from palpate.case.case_folder import STATES
from palpate.case.missing import AUTOMATIC_CONTOURS
from palpate.case.surface_errors import write_surface_errors
from palpate.segmentation.surface_error import SurfaceErrors
from palpate.ui.dicom.label_segments import algorithm_types
from palpate.ui.pictures.published_scale import published_scale
from palpate.ui.report import first_page, trust
from palpate.ui.report.conclusions import contour_origins
from palpate.ui.report.document import Bullets, Notice, Paragraph, Picture
from palpate.ui.report.figures import Figures
from palpate.ui.report.record import CaseRecord, read_record
from palpate.ui.report.sections import document


@pytest.fixture
def record(tmp_path: Path) -> CaseRecord:
    case = pair(tmp_path / "case", affine())
    return read_record(case, {"rest": case.labels("rest")})


def with_interval(record: CaseRecord, tmp_path: Path, factor: float, **misfit: float) -> str:
    facts = result()
    for region in facts["parameters"].values():
        region["ci95_kpa"] = [region["G_kpa"] / factor, region["G_kpa"] * factor]
    facts["misfit"] |= misfit
    case = pair(tmp_path / f"case_{factor}_{len(misfit)}", affine(), deformed=False)
    case.write_json("result.json", facts)
    read = read_record(case, {})
    return trust.how_sure(read.regions[0], read)


@pytest.mark.parametrize(
    ("factor", "word"), [(1.1, "high"), (1.24, "high"), (1.4, "moderate"), (2.0, "low"), (60.0, "none")]
)
def test_the_word_follows_the_printed_rule(record: CaseRecord, tmp_path: Path, factor: float, word: str) -> None:
    assert with_interval(record, tmp_path, factor) == word
    assert all(f"{name}:" in trust.SURE_RULE for name in ("high", "moderate", "low", "none"))
    assert all(f"up to {most:g}" in trust.SURE_RULE for most, _ in trust.SURE)


def test_a_misfit_beyond_the_contours_own_error_takes_a_word_away(record: CaseRecord, tmp_path: Path) -> None:
    assert with_interval(record, tmp_path, 1.1, expected_noise_rms_mm=0.2) == "moderate"
    assert with_interval(record, tmp_path, 2.0, expected_noise_rms_mm=0.2) == "low"


def test_scans_volumes_and_values_stand_in_tables_that_name_nobody(record: CaseRecord) -> None:
    scans, found = first_page.scanned(record), first_page.found(record)
    assert scans is not None and [row[0] for row in scans.rows] == ["rest", "deformed"]
    assert scans.header == ("scan", "date", "scanner", "series", "slices", "voxel")
    assert scans.rows[0][4] == "33" and scans.rows[0][5] == "2 \N{MULTIPLICATION SIGN} 1.5 \N{MULTIPLICATION SIGN} 3 mm"
    left, right, whole = found.rows
    assert left[2:] == ("120", "100 to 144", "high") and right[2] == "40.0"
    volumes = [float(row[1].removesuffix(" cc")) for row in (left, right, whole)]
    assert volumes[2] == pytest.approx(volumes[0] + volumes[1], abs=0.11)
    low, high = (float(value) for value in whole[2].split(" to "))
    assert 40.0 < low < high < 120.0
    said = str([scans, found, *trust.missing(record)])
    assert NAME not in said and NUMBER not in said


def test_every_published_value_has_its_source_and_its_modulus() -> None:
    for one in first_page.PUBLISHED:
        assert one.modulus in ("E", "G")
        assert pytest.approx(one.value / 3.0 if one.modulus == "E" else one.value) == one.row.G
        assert one.span is None or one.row.span == pytest.approx([end / 3.0 for end in one.span])
        assert first_page.SOURCES[one.source][1].startswith(("doi:10.", "PMID "))


def test_the_scale_shows_what_was_found_above_what_is_published(record: CaseRecord) -> None:
    rows = first_page.scale_rows(record)
    assert [row.words for row in rows[:2]] == ["here: left half", "here: right half"] and rows[0].G == 120.0
    caption = first_page.scale_caption(rows)
    assert caption.startswith("Found here") and all(where in caption for _, where in first_page.SOURCES.values())
    assert first_page.scale_caption(rows[2:]).startswith("Published"), "of a pair that tells nothing"
    axes = published_scale(rows).axes[0]
    assert [label.get_text() for label in axes.get_yticklabels()] == [row.words for row in rows]
    low, high = axes.get_xlim()
    assert all(low < end < high for row in rows for end in (row.G, *(row.span or ())))
    dots = [line for line in axes.lines if line.get_marker() in ("s", "o")]
    assert [float(line.get_xdata()[0]) for line in dots] == [row.G for row in rows]


def test_what_is_missing_is_told(record: CaseRecord) -> None:
    lines = trust.missing(record)
    assert any("Diagnose has not been run" in line for line in lines) and any("assumed" in line for line in lines)
    assert any("go together: assumed, 7 mm" in line for line in lines) and any("G = 20 kPa" in line for line in lines)


def test_the_first_page_is_a_sentence_a_box_and_a_picture(tmp_path: Path) -> None:
    """What is missing stands in the box, once."""
    lines = ["no rectum is known in either scan", f"{AUTOMATIC_CONTOURS}: those of both scans were found automatically"]
    case = pair(tmp_path / "case", affine())
    case.write_json("result.json", result(missing=lines))
    found = {"organs": {"prostate": {"method": "auto"}}}
    record = replace(read_record(case, {}), segmentation={"states": {"rest": found, "deformed": found}})
    picture = Picture(tmp_path / "x.png", "", "")
    first, second = document(record, Figures({"stiffness_planes": picture}), "today", "1").sections[:2]
    sentence, box, shown = first.blocks
    assert isinstance(sentence, Paragraph) and sentence.text.startswith("The left half of the prostate is 3.0 times")
    assert isinstance(box, Notice) and box.text.endswith("Missing: no rectum is known in either scan.")
    assert AUTOMATIC_CONTOURS not in box.text and shown == picture
    assert [line for block in second.blocks if isinstance(block, Bullets) for line in block.items if line == lines[1]]


def test_what_a_person_corrected_in_the_window_is_theirs_and_nothing_else(tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine())
    found = {"organs": {name: {"method": "auto", "confidence": 0.9} for name in ("prostate", "bladder")}}
    case.write_json("segmentation.json", {"states": {"rest": found, "deformed": found}})
    one = SurfaceErrors(np.zeros((1, 3)), np.ones(1), 1.0)
    labels = {state: case.labels(state) for state in STATES}
    write_surface_errors(case, {state: {"prostate": one, "bladder": one} for state in STATES}, (), labels)
    before = read_record(case, {})
    assert trust.unchecked(before) and contour_origins(before)["deformed"] == "found automatically"
    array = labels["deformed"].array.copy()
    array[tuple(np.argwhere(array == 1)[0])] = 3
    case.write_labels("deformed", labels["deformed"].with_array(array))
    after = read_record(case, {})
    assert not trust.unchecked(after) and trust.how_sure(after.regions[0], after) == "high"
    assert contour_origins(after) == {
        "rest": "found automatically",
        "deformed": "found automatically, corrected by hand",
    }
    assert after.segmentation["states"]["deformed"]["organs"]["bladder"]["method"] == "auto"
    assert algorithm_types(case, "deformed")["prostate_left"] == "SEMIAUTOMATIC"


@pytest.mark.parametrize(("method", "word"), [("auto", "low"), ("six points", "low"), ("user", "high")])
def test_unchecked_automatic_contours_give_low(record: CaseRecord, method: str, word: str) -> None:
    organs = {"organs": {"prostate": {"method": method, "confidence": 0.9, "volume_cc": 30.0}}}
    told = replace(record, segmentation={"states": {"rest": organs, "deformed": organs}})
    assert trust.how_sure(record.regions[0], record) == "high", "labels that came with the case"
    assert trust.how_sure(record.regions[0], told) == word
    box = trust.trust_box(told).text.splitlines()
    assert box[0] == f"How sure, left half: {word} (95 % interval within a factor of 1.20)."
    assert ("nobody has checked them" in box[-1]) == (word == "low")
    assert any("found automatically" in line for line in trust.missing(told)) == (word == "low")
