"""The study of label grids: labels stay where they are, and answers are compared in their own standard deviations."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from phantoms import result, write_case

from palpate.case.case_folder import CaseFolder
from palpate.imaging.volume import Volume
from palpate.validate.label_grids import GRIDS, grid_rows, label_grids, on_grid, table_text


def ball() -> Volume:
    matrix = np.diag([1.2, 1.2, 2.0, 1.0])
    matrix[:3, 3] = [-30.0, 10.0, 5.0]
    places = np.indices((40, 40, 24)).reshape(3, -1).T @ matrix[:3, :3].T + matrix[:3, 3]
    inside = np.linalg.norm(places - [-6.0, 34.0, 28.0], axis=1) < 15.0
    return Volume(inside.reshape(40, 40, 24).astype(np.uint8), matrix)


def centre_and_cc(labels: Volume) -> tuple[np.ndarray, float]:
    places = labels.to_lps(np.argwhere(labels.array).astype(float))
    return places.mean(axis=0), len(places) * float(np.prod(labels.spacing)) / 1000.0


@pytest.mark.parametrize("name", GRIDS)
def test_labels_stay_where_they_are_on_every_grid(name: str) -> None:
    given = ball()
    made = on_grid(given, *GRIDS[name])
    (centre, cc), (expected, volume) = centre_and_cc(made), centre_and_cc(given)
    np.testing.assert_allclose(centre, expected, atol=0.65)  # half a voxel, by ties
    assert cc == pytest.approx(volume, rel=0.03)
    if name == "scan":
        np.testing.assert_array_equal(made.array, given.array)


def identified(folder: Path, left: float) -> CaseFolder:
    found: dict[str, Any] = result(left)
    found["parameters"]["prostate_left"]["ci95_kpa"] = [left / np.exp(0.196), left * np.exp(0.196)]
    found["parameters"]["prostate_right"]["ci95_kpa"] = [30.0, 50.0]
    return write_case(folder, found)


def test_answers_are_compared_in_their_own_standard_deviations(tmp_path: Path) -> None:
    G = {"a": 20.0, "b": 20.0 * np.exp(0.3), "c": 20.0 * np.exp(0.0)}
    rows = [row for row in grid_rows({k: identified(tmp_path / k, v) for k, v in G.items()}) if "left" in row["region"]]
    np.testing.assert_allclose([row["sd_ln_G"] for row in rows], 0.1)
    np.testing.assert_allclose([row["from_mean"] for row in rows], [-1.0, 2.0, -1.0])


def test_the_study_runs_the_program_once_a_grid_and_says_where_it_had_no_answer(tmp_path: Path) -> None:
    case = write_case(tmp_path / "pair", result(), ct=True)
    shutil.copytree(case.file("rest_ct"), case.file("deformed_ct"))
    asked: list[tuple[str, ...]] = []

    def command(at: Path, words: tuple[str, ...]) -> None:
        asked.append(words)
        if words[0] == "import":
            assert Path(words[1]).is_dir() and (at / words[words.index("--rest-labels") + 1]).is_file()
        if words[0] == "identify" and at.name != "1_mm":
            write_case(at / "case", result())

    found = label_grids([case.path], tmp_path / "study", command)
    assert found["failed"] == ["pair: 1 mm"] and len(found["rows"]) == 8 and found["within"] == 8
    assert [words[0] for words in asked] == ["import", "segment", "mesh", "identify"] * len(GRIDS)
    assert "no answer: pair: 1 mm" in table_text(found) and json.loads(json.dumps(found)) is not None
    asked.clear()
    label_grids([case.path], tmp_path / "study", command)
    assert len(asked) == 4  # what is there is not made again
