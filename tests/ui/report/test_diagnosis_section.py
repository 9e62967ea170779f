"""The report's page on the gap: its words, figures and maps, and nothing where a case was not diagnosed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from diagnoses import diagnosis
from phantoms import recorded, result, write_case

from palpate.case.case_folder import CaseFacts, CaseFolder
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord, FittedStiffnessRecord
from palpate.core.files.json_types import typed
from palpate.ui.pictures.gap_pictures import VIEWS
from palpate.ui.pictures.images import CaseImages
from palpate.ui.report.document import Notice, Paragraph, Table
from palpate.ui.report.gap_section import gap_pictures, gap_section, ranking_table, stiffness_interval
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.report_step import ReportOptions, run
from palpate.ui.report.summary import summary


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    case = write_case(tmp_path_factory.mktemp("gap") / "case", result())
    rng = np.random.default_rng(0)
    normals = rng.standard_normal((200, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    maps = {"points": 15.0 * normals, "normals": normals, "standardised": rng.standard_normal(200),
            "nodes": 20.0 * rng.standard_normal((150, 3)), "force_kpa_per_mm": 0.1 * rng.standard_normal((150, 3))}  # fmt: skip
    missed = 0.3 * rng.standard_normal((80, 3))
    around = {"places": 20.0 * rng.standard_normal((80, 3)), "residual_mm": missed, "standardised": missed / 0.2}
    case.write_json("diagnosis.json", diagnosis("contour_bias"))
    case.file("diagnose").mkdir()
    case.write_npz("diagnose/gap_maps.npz", **maps, **{f"motion/{key}": values for key, values in around.items()})
    run(case, ReportOptions(pdf=False))
    return case


def test_an_interval_is_the_one_that_the_diagnosis_gives() -> None:
    """The Summary shows the same one, which is not normal."""
    assert stiffness_interval(FittedStiffnessRecord(13.4, 4.73, 0.4, (5.92, 24.4))) == "13.4 (5.92 to 24.4)"
    low, high = (13.4 / np.exp(1.96 * 0.4), 13.4 * np.exp(1.96 * 0.4))
    told = stiffness_interval(FittedStiffnessRecord(13.4, 13.4 * float(np.sinh(0.4)), 0.4))
    assert told == f"13.4 ({low:.2f} to {high:.1f})"


def test_the_page_says_verdict_figures_and_what_to_measure(case: CaseFolder) -> None:
    page = case.file("report/report.html").read_text()
    for text in ("What the model leaves out", "A sentence for a clinician.", "contour bias", "83 %", "70 to 92 %",
                 "draw it again", "below 0.001", "left: at its bound"):  # fmt: skip
        assert text in page, text
    assert case.has("report/gap_residual.png")
    assert case.has("report/gap_force.png")
    assert case.has("report/gap_motion.png") and "arrows 5 times as long as the difference" in page


def test_a_diagnosis_without_a_gap_has_no_second_map_of_the_misfit(case: CaseFolder, tmp_path: Path) -> None:
    images = CaseImages(case.labels("rest"))
    case.write_json("diagnosis.json", diagnosis("none"))
    try:
        assert gap_pictures(case, images, tmp_path) == {}
    finally:
        case.write_json("diagnosis.json", diagnosis("contour_bias"))


def test_a_stiffness_that_may_be_quoted_is_not_called_one_not_to_quote(case: CaseFolder) -> None:
    page = case.file("report/report.html").read_text()
    assert "quote that one if you believe the cause" in page and "not the one to quote" not in page
    assert "Stiffness without the effect and with it" in page


def test_a_gain_that_rounds_to_nothing_has_no_sign() -> None:
    found = diagnosed("contour_bias").diagnosis
    assert found is not None
    lost = msgspec.structs.replace(
        found, ranking=[msgspec.structs.replace(row, cv_gain_mm=-0.001) for row in found.ranking]
    )
    gains = [row[2] for row in ranking_table(lost).rows]
    assert gains and set(gains) == {"0.00"}


def test_without_a_gap_there_is_neither_force_nor_ranking() -> None:
    section = gap_section(diagnosed("none"), {})
    kinds = [type(block).__name__ for block in section.blocks]
    assert kinds == ["Paragraph", "Table", "Bullets"]


def test_the_page_says_what_a_diagnosis_stands_on_and_when_the_stiffness_does_not() -> None:
    record = diagnosed("none")
    assert record.diagnosis is not None
    for image, other in ((True, False), (False, True)):
        said = replace(
            record,
            result=recorded(result(options={"image": image})),
            diagnosis=msgspec.structs.replace(record.diagnosis, image=image),
        )
        (table,) = (block for block in gap_section(said, {}).blocks if isinstance(block, Table))
        assert ("data", "contours and images" if image else "contours alone") in table.rows
        assert not [block for block in gap_section(said, {}).blocks if isinstance(block, Notice)]
        beside = replace(said, result=recorded(result(options={"image": other})))
        (notice,) = (block for block in gap_section(beside, {}).blocks if isinstance(block, Notice))
        assert "run `palpate diagnose` again" in notice.text


def diagnosed(verdict: str, **stiffness: float) -> CaseRecord:
    """A record whose contours are taken to repeat to 0.4 mm, with a diagnosis. stiffness : G without the effect, kPa."""
    found = diagnosis(verdict)
    for name, G in stiffness.items():
        found["stiffness"]["without_effect"][name] = {"G_kpa": G, "sd_kpa": 0.2 * G}
    return CaseRecord(
        CaseFacts("c", boundary_noise_sd_mm=0.4),
        recorded(),
        {},
        {},
        {},
        {},
        diagnosis=typed(found, DiagnosisRecord, "a test's diagnosis.json"),
    )


def texts(record: CaseRecord) -> str:
    return " ".join(block.text for block in gap_section(record, {}).blocks if isinstance(block, Paragraph))


def test_summary_and_page_do_not_contradict_each_other() -> None:
    """The misfit is within what stated noise leaves, and the diagnosis sees a gap: both are said, each with its noise."""
    record = diagnosed("ambiguous")
    assert record.diagnosis is not None
    record.diagnosis.candidates[:] = ["inclusion", "unmodelled_load", "prestress"]
    misfit, told = summary(record)[-2:]
    assert "explains" not in misfit and "no larger than the contours' own error would make it (0.57 mm" in misfit
    assert "found a gap (1.40 mm rms where noise would leave 0.50 mm, p below 0.001), its cause not settled" in told
    assert "(perhaps inclusion, unmodelled load or prestress)" in told and "may differ from the sentence before" in told


def test_a_gap_no_larger_than_noise_is_called_a_pattern() -> None:
    record = diagnosed("ambiguous")
    assert record.diagnosis is not None
    small = msgspec.structs.replace(record.diagnosis.gap, rms_mm=0.4)
    record = replace(record, diagnosis=msgspec.structs.replace(record.diagnosis, gap=small))
    told = summary(record)[-1]
    assert "found a pattern that noise would seldom make (0.40 mm rms where noise would leave 0.50 mm" in told


def test_a_pair_without_a_gap_says_so_and_one_without_a_diagnosis_nothing() -> None:
    assert "found nothing that the model leaves out (p = 0.6)" in summary(diagnosed("none"))[-1]
    assert not any("diagnosis" in s for s in summary(replace(diagnosed("none"), diagnosis=None)))


def test_a_small_p_value_beside_no_gap_stands_with_the_probability_of_none() -> None:
    record = diagnosed("none")
    assert record.diagnosis is not None
    gap = msgspec.structs.replace(record.diagnosis.gap, p_value=0.013)
    weighed = msgspec.structs.replace(record.diagnosis, gap=gap, posterior={"none": 0.84, "inclusion": 0.16})
    told = summary(replace(record, diagnosis=weighed))[-1]
    assert "found nothing that the model leaves out (p = 0.013; probability of nothing 0.84)" in told


@pytest.mark.parametrize(
    ("p", "nothing", "grey"), [(0.013, 0.84, True), (0.2, 0.3, True), (0.2, 0.84, False), (0.2, 0.5, False)]
)
def test_where_p_value_and_probability_disagree_the_diagnosis_speaks_for_itself(
    p: float, nothing: float, grey: bool
) -> None:
    record = diagnosed("none")
    assert record.diagnosis is not None
    found = msgspec.structs.replace(
        record.diagnosis,
        gap=msgspec.structs.replace(record.diagnosis.gap, p_value=p),
        posterior={"none": nothing, "inclusion": 1.0 - nothing},
        in_words="Yet there is more to say.",
    )
    record = replace(record, diagnosis=found)
    assert ("Yet there is more to say." in texts(record)) == grey
    assert ("as well as their noise allows" in texts(record)) != grey
    (table,) = (block for block in gap_section(record, {}).blocks if isinstance(block, Table))
    assert ("probability that nothing is left out", f"{nothing:.2f}") in table.rows


def test_no_gap_beside_a_stiffness_at_its_bound_says_how_little_that_is() -> None:
    record = diagnosed("none")
    assert record.diagnosis is not None
    assert "little" not in summary(record)[-1]
    asked = msgspec.structs.replace(record.diagnosis, next_measurement="a deformed scan that moves the organ farther")
    told = summary(replace(record, diagnosis=asked))[-1]
    assert (
        "found nothing that the model leaves out (p = 0.6), which says little where a stiffness ends at its bound"
        in told
    )


def test_an_alarm_says_that_it_may_be_a_false_one() -> None:
    assert "docs/gap.md" in texts(diagnosed("ambiguous")) and "docs/gap.md" in texts(diagnosed("inclusion"))
    assert "docs/gap.md" not in texts(diagnosed("none"))


def test_one_stiffness_and_where_two_were_found_otherwise_it_is_said() -> None:
    near, far = (diagnosed("inclusion", prostate_left=120.0, prostate_right=G) for G in (40.0, 80.0))
    assert "is the Summary's: one fit gives both" in texts(near)
    assert "is not the Summary's, which was found with other options" in texts(far)
    assert not any("trust" in sentence for sentence in summary(far))
    (table,) = (b for b in gap_section(near, {}).blocks if isinstance(b, Table) and b.header[0] == "region")
    assert table.rows[0][:2] == ("left half of the prostate", "120 (81.3 to 177)")


def test_a_case_without_a_diagnosis_has_no_such_page(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", result())
    run(case, ReportOptions(pdf=False))
    assert "What the model leaves out" not in case.file("report/report.html").read_text()


def test_the_organ_is_seen_from_its_own_sides() -> None:
    """The viewer's up is superior; his right is his line of sight times up."""
    for view in VIEWS:
        sight = np.zeros(3)
        sight[view.towards[0]] = -view.towards[1]
        right = np.cross(sight, [0.0, 0.0, 1.0])
        axis, sign = view.across
        assert right[axis] == sign, view.name
        assert view.right == {(0, 1): "L", (0, -1): "R", (1, 1): "P", (1, -1): "A"}[(axis, sign)]
