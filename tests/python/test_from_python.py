"""Ten lines at a prompt: a stiff ball in a cube, found from surfaces; and a case folder opened."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import palpate
from palpate.core.errors import InputError
from palpate.ui.python.sphere import Sphere

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fixtures"))
from phantoms import write_case

TEN_LINES = """
import palpate

ball = palpate.example_sphere(G=60.0)
found = palpate.identify(**ball, tissue_G=20.0, noise_sd_mm=0.05, element="p1p1")
print(found)
"""


@pytest.fixture(scope="module")
def ball() -> Sphere:
    return palpate.example_sphere(G=60.0)


def test_the_ten_lines_find_the_ball_and_write_nothing(ball: Sphere, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", TEN_LINES], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    first = done.stdout.splitlines()[0]
    assert first.startswith("region_1: G = ") and "95 %" in first
    assert float(first.split("= ")[1].split(" kPa")[0]) == pytest.approx(60.0, rel=0.25)
    assert list(tmp_path.iterdir()) == [] and len(TEN_LINES.strip().splitlines()) <= 10


def test_pyvista_and_arrays_are_the_same_body(ball: Sphere) -> None:
    mesh, after = ball["mesh"], ball["deformed"]
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: mesh.cells}, mesh.points)
    grid.cell_data["region"] = mesh.regions
    used = np.unique(after.faces)
    surface = pv.PolyData.from_regular_faces(after.points[used], np.searchsorted(used, after.faces))
    nodes, wall = ball["driven"]
    found = palpate.identify(
        grid, deformed=surface, fixed=np.flatnonzero(ball["fixed"]), driven=(nodes, (wall.points, wall.faces)),
        tissue_G=40.0, noise_sd_mm=0.05, element="p1p1", starts=1,
    )  # fmt: skip
    # Twice the tissue's modulus, twice the ball's: only their ratio moves anything.
    assert found.G_kpa["region_1"] == pytest.approx(120.0, rel=0.25)
    (row,) = found.table()
    interval = found.interval_kpa["region_1"]
    assert interval is not None and (row["low_kpa"], row["high_kpa"]) == interval
    assert interval[0] < 120.0 < interval[1]
    axes = found.plot()
    assert axes.get_xlabel() == "shear modulus G, kPa" and axes.get_xscale() == "log"


@pytest.mark.parametrize("G", [20.0, 60.0, 200.0])
def test_the_ball_hides_nothing_and_that_is_what_its_diagnosis_says(G: float) -> None:
    gap = palpate.diagnose(**palpate.example_sphere(G=G), tissue_G=20.0, noise_sd_mm=0.05)
    assert gap.record.verdict == "none" and not gap.record.candidates
    assert gap.record.gap.p_value > 0.05


def test_a_diagnosis_from_arrays_starts_from_the_stiffness_that_is_identified(ball: Sphere) -> None:
    gap, found = palpate.diagnose(**ball, noise_sd_mm=0.05), palpate.identify(**ball, noise_sd_mm=0.05)
    without = gap.record.stiffness.without_effect["region_1"]
    assert without.G_kpa == found.G_kpa["region_1"]
    identified = found.regions["region_1"]
    assert (without.sd_ln_G, without.sd_kpa, without.ci95_kpa) == (
        identified.sd_ln_G,
        identified.sd_kpa,
        identified.ci95_kpa,
    )
    assert str(gap).startswith(f"verdict: {gap.record.verdict} (p = ")


def test_one_set_of_arguments_serves_both(ball: Sphere) -> None:
    asked = {**ball, "tissue_G": 20.0, "noise_sd_mm": 0.05, "element": "p1p1", "starts": 1}
    assert palpate.diagnose(**asked).verdict and palpate.identify(**asked).G_kpa
    with pytest.raises(InputError, match="element 'p9' is unknown"):
        palpate.diagnose(**{**asked, "element": "p9"})


def test_the_whole_way_from_two_label_volumes(tmp_path: Path) -> None:
    made = write_case(tmp_path / "made")
    steps: list[str] = []
    case = palpate.analyze(
        made.file("rest.nii.gz"), made.file("deformed.nii.gz"), tmp_path / "case", method="gauss-newton", starts=1,
        element="p1p1", stiffness_map=False, diagnosis=False, progress=lambda share, message: steps.append(message),
    )  # fmt: skip
    assert case.stiffness is not None and set(case.stiffness.G_kpa) == {"prostate_left", "prostate_right"}
    assert case.diagnosis is None and case.folder.file("report/report.html").is_file() and "stiffness found" in steps
    with pytest.raises(InputError, match="is not there"):
        palpate.analyze(tmp_path / "none", tmp_path / "none", tmp_path / "other")


def test_what_cannot_be_posed_is_said(ball: Sphere) -> None:
    with pytest.raises(InputError, match="tissue_G = 0 is not above 0"):
        palpate.identify(**ball, tissue_G=0)
    with pytest.raises(InputError, match="fixed: no outer face"):
        palpate.identify(**{**ball, "fixed": np.zeros(len(ball["mesh"].points), dtype=bool)})
    with pytest.raises(InputError, match="fixed: give a mask of the mesh's"):
        palpate.identify(**{**ball, "fixed": [-1]})
    only_tissue = (ball["mesh"].points, ball["mesh"].cells, np.full(len(ball["mesh"].cells), 3))
    with pytest.raises(InputError, match="no region but 3"):
        palpate.identify(**{**ball, "mesh": only_tissue})
    with pytest.raises(AttributeError, match="no attribute 'guess'"):
        palpate.guess  # noqa: B018


WRONG: list[tuple[dict[str, object], str]] = [
    ({"tissue_G": "20"}, "tissue_G is '20'"),
    ({"tissue_G": np.inf}, "tissue_G = inf is not finite"),
    ({"noise_sd_mm": None}, "noise_sd_mm is None"),
    ({"bounds_kpa": (500, 5)}, "bounds_kpa is \\(500, 5\\); two rising numbers above 0"),
    ({"bounds_kpa": (0, 500)}, "two rising numbers above 0"),
    ({"mesh": "mesh.vtu"}, "mesh: give a pyvista grid, or three arrays"),
    ({"deformed": "a.stl"}, "deformed: give a pyvista surface, or two arrays"),
    ({"driven": ([1], "wall.stl")}, "driven rectum: .*give a|driven rectum: no outer face"),
    ({"fixed": "left"}, "fixed: give a mask"),
    ({"particle": 3}, "particle is unknown; allowed are method"),
]


@pytest.mark.parametrize(("change", "said"), WRONG)
def test_what_is_of_a_wrong_kind_is_said(ball: Sphere, change: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        palpate.identify(**{**ball, **change})  # type: ignore[arg-type]


def test_meshes_and_surfaces_are_checked_as_files_are(ball: Sphere) -> None:
    mesh, after, (_, wall) = ball["mesh"], ball["deformed"], ball["driven"]
    P, C, R = mesh.points, mesh.cells, mesh.regions
    wrong: list[tuple[dict[str, object], str]] = [
        ({"mesh": (P, C)}, "or three arrays"),
        ({"mesh": (P, C, R + 0.5)}, "mesh regions: 1.5 is no whole number"),
        ({"mesh": (P, C, np.where(R == 1, "organ", "tissue"))}, "mesh regions: finite numbers"),
        ({"mesh": (P / 1000.0, C, R)}, "mesh is 0.03 mm across; .* is it in mm"),
        ({"deformed": (after.points / 1000.0, after.faces)}, "deformed is 0.02.* mm across"),
        ({"deformed": (after.points, after.faces + 1)}, "deformed .*closed"),
        ({"deformed": (after.points, after.faces[1:])}, "deformed is not closed: 3 edges"),
        ({"deformed": (after.points, after.faces[:, ::-1])}, "its faces look inwards"),
        ({"deformed": (after.points + 500.0, after.faces)}, "are both in one frame"),
        ({"driven": (ball["fixed"], wall)}, "they cannot be held and moved at once"),
        ({"fixed": np.ones(len(P), dtype=bool)}, "they cannot be held and moved at once"),
    ]
    own = P[C].reshape(-1, 3)
    apart = {"mesh": (own, np.arange(len(own)).reshape(-1, 4), R)}
    for change, said in [*wrong, (apart, "falls into .* pieces that share no point: merge")]:
        with pytest.raises(InputError, match=said):
            palpate.identify(**{**ball, **change})  # type: ignore[arg-type]
    for call in (lambda: palpate.example_sphere(G="60"), lambda: palpate.load(5)):  # type: ignore[arg-type]
        with pytest.raises(InputError, match=r"G is '60'|case is 5"):
            call()


def test_a_case_is_opened(tmp_path: Path) -> None:
    case = palpate.load(write_case(tmp_path / "case").path)
    assert repr(case).startswith("case case: rest labels, deformed labels\nprostate_left: G = 120 kPa, 95 % 100 to 144")
    assert case.stiffness is not None and case.stiffness.G_kpa == {"prostate_left": 120.0, "prostate_right": 40.0}
    assert case.diagnosis is None and case.labels().array.any()
    with pytest.raises(InputError, match="is no folder; give the path of a case folder"):
        palpate.load(tmp_path / "none")
