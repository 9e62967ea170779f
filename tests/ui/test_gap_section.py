"""The report's page on the gap: its words, figures and maps, and nothing where a case was not diagnosed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from phantoms import result, write_case

from palpate.segmentation.case import CaseFolder
from palpate.ui.pictures.gap_pictures import VIEWS
from palpate.ui.report.gap_section import gap_section
from palpate.ui.report.report_step import ReportOptions, run


def diagnosis(verdict: str) -> dict[str, Any]:
    """In the form of diagnosis.json."""
    stiffness = {"prostate_left": {"G_kpa": 40.0, "sd_kpa": 9.0}, "prostate_right": {"G_kpa": 20.0, "sd_kpa": 4.0}}
    parameter = {"value": 1.25, "sd": 0.13, "unit": "mm"}
    row = {"effect": "contour_bias", "probability": 0.97, "cv_gain_mm": 0.8, "parameters": {"offset": parameter}}
    shrinkage = {
        "held_out_rms_before_mm": 1.4, "held_out_rms_after_mm": 0.6, "noise_corrected_fraction": 0.83,
        "ci95": [0.7, 0.92], "ceiling_fraction": 0.5, "effect": "contour_bias",
    }  # fmt: skip
    found = verdict != "none"
    return {
        "gap": {"rms_mm": 1.4, "p95_mm": 2.5, "noise_floor_mm": 0.5, "p_value": 1e-7 if found else 0.6},
        "where": {"map": "diagnose/gap_maps.npz", "blur_mm": 14.0},
        "verdict": verdict, "in_words": "A sentence for a clinician.", "ranking": [row], "flags": ["left: at its bound"],
        "shrinkage": shrinkage if found else None, "next_measurement": "draw it again" if found else None,
        "stiffness": {"without_effect": stiffness, "with_effect": stiffness if found else None},
    }  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    case = write_case(tmp_path_factory.mktemp("gap") / "case", result())
    rng = np.random.default_rng(0)
    normals = rng.standard_normal((200, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    maps = {"points": 15.0 * normals, "normals": normals, "standardised": rng.standard_normal(200),
            "nodes": 20.0 * rng.standard_normal((150, 3)), "force_kpa_per_mm": 0.1 * rng.standard_normal((150, 3))}  # fmt: skip
    case.write_json("diagnosis.json", diagnosis("contour_bias"))
    case.file("diagnose").mkdir()
    case.write_npz("diagnose/gap_maps.npz", **maps)
    run(case, ReportOptions(pdf=False))
    return case


def test_the_page_says_verdict_figures_and_what_to_measure(case: CaseFolder) -> None:
    page = case.file("report/report.html").read_text()
    for text in ("What the model leaves out", "A sentence for a clinician.", "contour bias", "83 %", "70 to 92 %",
                 "draw it again", "below 0.001", "left: at its bound"):  # fmt: skip
        assert text in page, text
    assert case.has("report/gap_residual.png")
    assert case.has("report/gap_force.png")


def test_without_a_gap_there_is_neither_force_nor_ranking() -> None:
    section = gap_section(diagnosis("none"), {})
    kinds = [type(block).__name__ for block in section.blocks]
    assert kinds == ["Paragraph", "Table", "Bullets"]


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
