"""What a report's sentences, names and numbers say: a stiffer half only where the errors allow, in one way everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from phantoms import affine, agreement, labels, recorded, result

from palpate.case.case_folder import CaseFacts
from palpate.case.missing import AUTOMATIC_CONTOURS
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.slices import stiffness_planes, stiffness_series
from palpate.ui.report.document import Paragraph, Table
from palpate.ui.report.figures import Figures
from palpate.ui.report.quality import without_paths
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import region_words
from palpate.ui.report.stiffness_section import limits, stiffness_section, told
from palpate.ui.report.summary import NOTHING_DETERMINED, WAY_OUT, summary
from palpate.ui.words.number_words import measured, three_figures


def record(found: dict, covariance: np.ndarray | None = None) -> CaseRecord:
    facts = CaseFacts("c", boundary_noise_sd_mm=0.4)
    return CaseRecord(facts, recorded(found), {}, {}, {}, {}, ln_covariance=covariance)


def test_constants_of_mooney_rivlin_are_told_of_it_alone() -> None:
    for law, constants in (("mooney-rivlin", True), ("neo-hookean", False)):
        table, note = stiffness_section(record(result(options={"law": law})), Figures()).blocks[:2]
        assert isinstance(table, Table) and isinstance(note, Paragraph)
        assert ("\u03bc1, kPa" in table.header) == constants and ("\u03bc1" in note.text) == constants
        assert {len(row) for row in table.rows} == {len(table.header)} and (constants or "neo-hookean" in note.text)


def test_summary_names_the_stiffer_half_only_when_the_errors_allow() -> None:
    clear = summary(record(result(120.0, 40.0)))[0]
    assert clear.startswith("The left half of the prostate is 3.0 times as stiff as the right half")
    assert summary(record(result(40.0, 120.0)))[0].startswith("The right half of the prostate is 3.0 times")
    unclear = summary(record(result(42.0, 40.0)))[0]
    assert unclear.startswith("This pair does not show which is stiffer")
    # ln 1.05 over the hypotenuse of two sds of ln 1.2 / 1.96
    assert "The left half of the prostate is the stiffer one with a chance of about 64 %" in unclear


def test_errors_that_go_together_make_the_ratio_surer_than_either() -> None:
    together = np.array([[0.0100, 0.0099], [0.0099, 0.0100]])
    assert summary(record(result(44.0, 40.0)))[0].startswith("This pair does not show")
    assert summary(record(result(44.0, 40.0), together))[0].startswith("The left half of the prostate is 1.1 times")


def test_summary_is_plain_about_what_is_no_measurement() -> None:
    found = result()
    found["parameters"]["prostate_left"].update(G_kpa=500.0, at_bound=True)
    assert any("edge of what was allowed" in s and "no measurement" in s for s in summary(record(found)))
    # By the width of the interval, wherever it lies: [11, 500] is as wide as what was allowed, but for its lower end.
    for ends, untold in (([5.2, 480.0], True), ([11.0, 500.0], True), ([40.0, 500.0], False)):
        found = result()
        found["parameters"]["prostate_right"]["ci95_kpa"] = ends
        assert any("does not determine the stiffness of the right half" in s for s in summary(record(found))) == untold


def test_a_pair_that_tells_nothing_says_why_in_its_second_sentence() -> None:
    found = result()
    for values in found["parameters"].values():
        values["ci95_kpa"] = [5.2, 480.0]
    assert "nothing" not in found["identifiability"]["verdict"]
    without = summary(record(found))
    found["identifiability"]["verdict"] = (
        "nothing can be identified: contours err: they mislead; prostate left: not identifiable"
    )
    assert summary(record(found)) == [NOTHING_DETERMINED, "Contours err: they mislead.", *without[1:]]


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
    doubtful = summary(record(result(agreement=agreement(harmless=False, in_words=words))))
    assert f"Doubtful: {words}." in doubtful
    assert not any(words in s for s in summary(record(result(agreement=agreement(harmless=True, in_words=words)))))


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
    assert three_figures(value) == text


@pytest.mark.parametrize(
    "value, sd, text",
    [(-14.93, 2.41, "\u221214.9 \u00b1 2.4"), (0.0209, 0.0382, "0.021 \u00b1 0.038"), (120.4, 31.0, "120 \u00b1 31")],
)
def test_a_value_is_told_as_far_as_its_deviation_goes(value: float, sd: float, text: str) -> None:
    assert measured(value, sd) == text


def test_a_verdict_is_told_in_the_words_of_the_report_and_nothing_twice() -> None:
    verdict = (
        "prostate left: known within a factor of 1.7 (95 %); prostate right: mu1 is 2 to 98 % of mu1 + mu2 (95 %); "
        "only G = 2 (mu1 + mu2) is identified; all stiffness is relative to the assumed stiffness of the surrounding tissue"
    )
    assert told(verdict, {"prostate_left": 0, "prostate_right": 0}) == [
        "left half of the prostate: known within a factor of 1.7 (95 %)",
        "right half of the prostate: \u03bc1 is 2 to 98 % of \u03bc1 + \u03bc2 (95 %)",
    ]


@pytest.mark.parametrize("path", ["/data/Doe Jane/x.dcm", r"C:\scans\Doe\x.dcm", "/Doe"])
def test_paths_are_left_out_of_notes(path: str) -> None:
    assert without_paths(f"rest: {path} has 33 slices") == "rest: (path) has 33 slices"


def test_one_region_is_told_as_one() -> None:
    found = result()
    del found["parameters"]["prostate_right"]
    assert summary(record(found))[0] == "The shear modulus G of the prostate is 120 kPa (95 % interval 100 to 144)."
    assert "the organ has one value" in limits(record(found)) and "each half has one value" in limits(record(result()))


def test_a_colour_bar_stands_beside_colours_only() -> None:
    volume = labels(affine())
    known, unknown = (
        CaseImages(volume, stiffness_kpa={1: 20.0, 2: 60.0}, undetermined=frozenset(u)) for u in ((1,), (1, 2))
    )
    for draw in (stiffness_planes, stiffness_series):
        assert len(draw(known).axes) == len(draw(unknown).axes) + 1


def test_a_legend_has_the_outlines_that_the_slices_meet() -> None:
    """A bladder above the organ is on sagittal slices, on none of the axial ones through the organ."""
    volume = labels(affine())
    array = volume.array.copy()
    high = np.flatnonzero(np.isin(array, ORGAN_LABELS).any(axis=(0, 1)))[-1]
    array[array == BLADDER] = SURROUNDING_TISSUE
    across = np.argwhere(np.isin(array, ORGAN_LABELS)).mean(axis=0).round().astype(int)
    array[across[0] - 2 : across[0] + 3, across[1] - 2 : across[1] + 3, high + 2 : high + 4] = BLADDER
    images = CaseImages(replace(volume, array=array), stiffness_kpa={1: 20.0, 2: 60.0})

    def listed(figure: Figure) -> set[str]:
        return {text.get_text() for legend in figure.legends for text in legend.get_texts()}

    assert {"organ", "bladder"} <= listed(stiffness_planes(images))
    assert "organ" in listed(stiffness_series(images))
    assert "bladder" not in listed(stiffness_series(images))


def test_what_is_missing_and_that_nothing_is_told_come_first() -> None:
    found = result(120.0, 40.0)
    line = "no rectum is known in either scan, so that its wall does not drive the model"
    found["missing"] = [line]
    assert summary(record(found))[0] == f"Missing: {line}."
    assert summary(record(found))[1].startswith("The left half of the prostate is 3.0 times")
    for region in found["parameters"].values():
        region["ci95_kpa"] = [5.0, 500.0]
    untold = summary(record(found))
    assert untold[:2] == [NOTHING_DETERMINED, f"Missing: {line}."]
    assert not any("intervals assume" in sentence for sentence in untold)


def test_contours_too_rough_to_fit_anything_blame_no_model_and_tell_the_way_out() -> None:
    found = result(120.0, 40.0)
    line = f"{AUTOMATIC_CONTOURS}: the prostate's contours may be off by 2.6 and 4.5 mm"
    found["missing"] = [line]
    found["misfit"].update(rms_mm=25.9, expected_noise_rms_mm=5.2)
    told = summary(record(found))
    assert any("something is left out of the model" in sentence for sentence in told) and WAY_OUT not in told
    for region in found["parameters"].values():
        region["ci95_kpa"] = [5.0, 500.0]
    assert summary(record(found)) == [NOTHING_DETERMINED, f"Missing: {line}.", WAY_OUT]


def test_the_summary_says_which_error_the_intervals_stand_on() -> None:
    stated = summary(record(result(120.0, 40.0)))
    assert "The intervals assume an error of 0.40 mm of each contour, as the case states." in stated
    found = result(120.0, 40.0)
    found["misfit"].update(contour_noise_from="image", contour_noise_sd_mm=2.1)
    found["contour_errors_mm"] = {"rest": {"organ": 1.9, "bladder": 1.1}, "deformed": {"organ": 2.25}}
    estimated = " ".join(summary(replace(record(found), facts=CaseFacts("c"))))
    assert "estimated from the images: prostate 1.9 and 2.2 mm, bladder 1.1 mm rms" in estimated
    assert "if contours repeat to 2.10 mm, estimated from the images" in estimated
