"""What a case lacks is said before its results."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from phantoms import recorded, result

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.missing import AUTOMATIC_CONTOURS, CARRIED_BY_IMAGES, CARRIED_OVER, at_bounds, missing_structures
from palpate.case.surface_errors import write_surface_errors
from palpate.imaging.volume import Volume
from palpate.segmentation.surface_error import SurfaceErrors


def labels(*, rectum: bool = True, bladder: bool = True, cut: bool = False) -> Volume:
    array = np.full((20, 20, 20), 3, dtype=np.uint8)
    array[8:12, 8:12, 0 if cut else 6 : 12] = 1
    array[8:12, 8:12, 13:17] = 5 if bladder else 3
    array[8:12, 14:18, :] = 6 if rectum else 3
    return Volume(array, np.diag([2.0, 2.0, 2.0, 1.0]))


def made(folder: Path, rest: Volume, deformed: Volume) -> CaseFolder:
    case = CaseFolder.create(folder / "case", CaseFacts("c"))
    case.write_labels("rest", rest)
    case.write_labels("deformed", deformed)
    return case


def test_a_whole_case_lacks_nothing(tmp_path: Path) -> None:
    assert missing_structures(made(tmp_path, labels(), labels())) == []


@pytest.mark.parametrize("name", ["rectum", "bladder"])
def test_a_wall_that_a_scan_does_not_show(tmp_path: Path, name: str) -> None:
    without = labels(**{name: False})
    (line,) = missing_structures(made(tmp_path, labels(), without))
    assert line.startswith(f"no {name} is known in the deformed scan")
    (line,) = missing_structures(made(tmp_path, without, without))
    assert line.startswith(f"no {name} is known in either scan")


def test_a_wall_that_has_no_surface_is_none(tmp_path: Path) -> None:
    case = made(tmp_path, labels(), labels())
    case.write_json("mesh.json", {"surface_faces": {"rest_rectum": 9, "deformed_rectum": 9, "rest_bladder": 9}})
    (line,) = missing_structures(case)
    assert line.startswith("no bladder is known in the deformed scan")


def test_an_organ_that_is_cut_off(tmp_path: Path) -> None:
    (line,) = missing_structures(made(tmp_path, labels(cut=True), labels()))
    assert line == "the prostate reaches the end of the scan at rest: part of it may not be seen"


def test_contours_that_were_carried_over(tmp_path: Path) -> None:
    case = made(tmp_path, labels(), labels())
    errors = {"deformed": {"prostate": SurfaceErrors(np.zeros((1, 3)), np.ones(1), 1.0)}}
    write_surface_errors(case, errors, ["prostate"])
    assert missing_structures(case) == [CARRIED_OVER]
    assert missing_structures(case, image=True) == [CARRIED_BY_IMAGES]


def test_contours_that_nobody_drew(tmp_path: Path) -> None:
    case = made(tmp_path, labels(), labels())
    one = SurfaceErrors(np.zeros((1, 3)), np.full(1, 1.4), 1.0)
    write_surface_errors(case, {"deformed": {"prostate": one}})
    (alone,), (beside,) = missing_structures(case), missing_structures(case, image=True)
    assert alone.startswith(
        f"{AUTOMATIC_CONTOURS}: those of the deformed scan were found automatically, and may be off by 1.4 mm"
    )
    assert "hardly show it" in alone and "comes from the images" in beside
    write_surface_errors(case, {state: {"prostate": one} for state in ("rest", "deformed")})
    (both,) = missing_structures(case, image=True)
    assert "those of both scans were found automatically, and may be off by 1.4 mm and 1.4 mm" in both
    write_surface_errors(case, {state: {"prostate": one} for state in ("rest", "deformed")}, ["prostate"])
    (carried,) = missing_structures(case, image=True)
    assert (
        "those of the scan at rest were found automatically and carried over to the other, and may be off by 1.4 mm rms"
        in carried
    )


def test_a_bound_is_no_measurement() -> None:
    found = result()
    found["parameters"]["prostate_left"].update(G_kpa=500.0, at_bound=True)
    (line,) = at_bounds(recorded(found).parameters)
    assert "prostate left" in line and "no measurement" in line


def test_one_scan_alone_is_not_judged(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "case", CaseFacts("c"))
    case.write_labels("rest", labels(rectum=False))
    assert missing_structures(case) == []
