"""The second set of small inputs rebuilt from public bug reports, row by row: table in wild2_README.md beside the archive.

W stands for the unpacked archive, C for a new case folder, B for a copy of the row's body.
"""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from palpate.case.case_folder import CaseFolder
from palpate.imaging.contours.nifti_labels import read_labels
from palpate.imaging.surfaces.surface_files import read_closed_surface
from palpate.ui.cli import main as cli

TOP = Path(__file__).resolve().parents[3]
PAIR = "import W/pair/rest W/pair/deformed -o C"
SURFACE = "import --surfaces W/V18/rest_lps.stl"
DRAWN = "import W/base/ct -o C --rest-labels"
# Row, command, what the one line says.
REFUSED: tuple[tuple[str, str, str], ...] = (
    ("V1", "batch W/V1/table.csv -o C", "unknown column 'rest_label'; is 'rest_labels' meant"),
    ("V2a", "batch W/V2/a.csv -o C", "line 2 has 4 cells under 3 columns"),
    ("V2b", "batch W/V2/b.csv -o C", "line 2 has 4 cells under 3 columns, 'May/ct' under none"),
    ("V4", f"{PAIR} --landmarks W/V4/points.csv", "line 2 has 8 cells under 7 columns"),
    ("V6/a", "diagnose B --no-image", r"states\[0\].load is unknown; allowed are .*loads"),
    ("V6/b", "diagnose B --no-image", r"states\[0\].point_sd_mm is unknown; allowed are .*points_sd_mm"),
    ("V6/c", "diagnose B --no-image", r"supports\[0\].plane_pont is unknown; allowed are plane_point"),
    ("V7/body", "diagnose B --no-image", "plane_normal is .* and has no length"),
    ("V8/body", "diagnose B --no-image", "gravity is .* of length at most 20"),
    ("V9/a", "diagnose B --no-image", "density_kg_m3 is 1.07; it must be a density in kg/m3"),
    ("V9/b", "diagnose B --no-image", "density_kg_m3 is 1.07e-09; it must be a density in kg/m3"),
    ("V10/body", "diagnose B --no-image", "which prescribe 0 mm and -1 mm along z; correct one of them"),
    ("V11/a", f"{DRAWN} W/V11/a.dcm", r"only PeriProstatic \('peri' is not known\); give --roi prostate=NAME"),
    ("V11/b", f"{DRAWN} W/V11/b.dcm", "only Prostate_SemVes .*; give --roi prostate=NAME"),
    ("V11/c", f"{DRAWN} W/V11/c.dcm", "only zProstate .*; give --roi prostate=NAME"),
    ("V11/d", f"{DRAWN} W/V11/d.dcm", "only Rectum_Ant .*; give --roi rectum=NAME"),
    ("V11c/a", f"{DRAWN} W/V11c/a.dcm", "only Anti-Bladder .*; give --roi bladder=NAME"),
    ("V11c/b", f"{DRAWN} W/V11c/b.dcm", "only Bladder_Contrast .*; give --roi bladder=NAME"),
    ("V12", f"{DRAWN} W/V12/a.dcm", r"only Prostate \(its type is PTV\); give --roi prostate=NAME"),
    ("V14", f"{DRAWN} W/V14/a.dcm", "two contours 0.6 mm apart on a slice, nearer than pixels of 2.0 mm can show"),
    ("V15", "import W/V15/ct -o C", "no voxel is air at -1000 HU, .*RescaleSlope wrong"),
    ("V23", "import W/V23/scan W/pair/deformed -o W/V23/scan/case", "lies inside the scan .*, whose slices it would join"),
    ("C3/body", "diagnose B --no-image", r"body\.vtu is no STL, OBJ or PLY file; save the surface"),
    ("M1a", "import W/M1/a -o C", r"\(JPEG XL JPEG Recompression\); .* export the series uncompressed"),
    ("M1b", "import W/M1/b -o C", r"\(JPEG XL\); .* export the series uncompressed"),
    ("M5", f"{SURFACE} W/M5/body.obj -o C", "has a face that names vertex 0, but OBJ counts from 1"),
    ("M7 folder", f"{SURFACE} W/M7/folder.stl -o C", r"folder\.stl is a folder; give the file"),
    ("M7 far", f"{SURFACE} W/M7/far.stl -o C", r"has 1 of its 642 points far off, up to 1e\+30 mm"),
    ("M9", "batch W/M9/table.csv -o C", "results.csv is the name of the table of results; use another"),
)  # fmt: skip
ALL = {1: 448, 5: 224, 6: 124}
# Row, command, label -> voxels as imported, a note.
READ: tuple[tuple[str, str, dict[int, int], str], ...] = (
    ("V11c/c", f"{DRAWN} W/V11c/c.dcm", ALL, "not used: Femur_L_Metal"),
    ("V12c", f"{DRAWN} W/V12c/a.dcm", ALL, "prostate is prostate gland; not used: Prostate"),
    ("M7 cm", f"{DRAWN} W/M7/s.seg.nrrd", ALL, "states its place in units of 10 mm and was scaled to mm"),
    ("base", f"{DRAWN} W/base/rs.dcm", ALL, "prostate is"),
)
# Row and argument, what each of its cases says.
SCRIPTS: tuple[tuple[str, str, str], ...] = (
    ("V20", "from_1", "deformed is no closed surface of a body: .*; are its points counted from 0"),
    ("V21", "half", "mesh regions: 1.5 is no whole number"),
    ("V22", "same_nodes", "they cannot be held and moved at once"),
    ("V22", "all_held", "they cannot be held and moved at once"),
    ("C4", "swapped", r"bounds_kpa is \(500, 5\); two rising numbers above 0"),
    ("C5", "region_names", "mesh regions: finite numbers of shape"),
    ("C5", "tissue_text", "tissue_G is '20'; it must be a number above 0"),
    ("C5", "noise_text", "noise_sd_mm is '0.05'; it must be a number above 0"),
    ("C5", "mesh_path", "mesh: give a pyvista grid, or three arrays"),
    ("C5", "two_arrays", "mesh: give a pyvista grid, or three arrays"),
    ("M2", "a", "the mesh falls into 2 pieces that share no point: merge the 53 points"),
    ("M2", "b", "the mesh falls into 480 pieces that share no point: merge the 1815 points"),
    ("M3", "metres", r"mesh is 0\.03 mm across; .*: is it in mm"),
    ("M4", "bounds_zero", r"bounds_kpa is \(0, 500\); two rising numbers above 0"),
    ("M4", "tissue_inf", "tissue_G = inf is not finite"),
)


def words(command: str, row: str, wild2: Path, folder: Path) -> list[str]:
    """The words of a command; the row's body is copied first."""
    if " B " in command:
        shutil.copytree(wild2 / row, folder / "body")
    places = {"W": str(wild2), "C": str(folder / "case"), "B": str(folder / "body")}
    return [re.sub(r"^[WCB](?=/|$)", lambda at: places[at.group()], word) for word in command.split()]


@pytest.mark.parametrize(("row", "command", "line"), REFUSED, ids=[row for row, *_ in REFUSED])
def test_rows_that_are_refused(
    row: str, command: str, line: str, wild2: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    if row == "V23":
        shutil.copytree(wild2 / "pair" / "rest", wild2 / "V23" / "scan", dirs_exist_ok=True)
    assert cli.main([*words(command, row, wild2, tmp_path), "--quiet"]) == 3
    told = capfd.readouterr()
    assert re.search(line, told.err), told.err
    assert told.err.startswith("palpate: ") and told.err.count("\n") == 1 and told.out == ""
    assert row == "M9" or not (tmp_path / "case").exists()
    assert not (wild2 / "V23" / "scan" / "case").exists()


@pytest.mark.parametrize(("row", "command", "voxels", "note"), READ, ids=[row for row, *_ in READ])
def test_rows_that_are_read(
    row: str, command: str, voxels: dict[int, int], note: str, wild2: Path, tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    assert cli.main(words(command, row, wild2, tmp_path)) == 0
    assert note in capfd.readouterr().out
    found = read_labels(tmp_path / "case" / "rest_user.nii.gz").array
    assert {int(v): int((found == v).sum()) for v in np.unique(found) if v} == voxels


@pytest.mark.parametrize("row", ["V16/a", "V16/b"])
def test_metal_stays_metal(row: str, wild2: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", str(wild2 / row), "-o", str(tmp_path / "case")]) == 0
    told = capfd.readouterr().out
    assert "within the body (metal) were set to that limit" in told and "padding" not in told
    array = CaseFolder(tmp_path / "case").ct("rest").array
    assert int((array == 31000).sum()) == 728 == int((array > 3000).sum())


def test_surfaces_that_state_a_space_or_a_unit(wild2: Path) -> None:
    rest, deformed = (read_closed_surface(wild2 / "V18" / f"{name}.stl") for name in ("rest", "deformed"))
    lps = read_closed_surface(wild2 / "V18" / "rest_lps.stl")
    np.testing.assert_allclose(rest.surface.points, lps.surface.points, atol=1e-4)
    points = deformed.surface.points
    np.testing.assert_allclose(0.5 * (points.min(axis=0) + points.max(axis=0))[:2], (11.2, -5.6), atol=0.05)
    for one in (rest, deformed):
        assert one.notes == ("the file states SPACE=RAS: its points were turned to LPS",)
    for name in ("rest", "deformed"):
        read = read_closed_surface(wild2 / "V19" / f"{name}.obj")
        assert read.surface.enclosed_volume == pytest.approx(30700.0, rel=0.01)
        assert "'1 unit = 10.000000 mm': its lengths were multiplied by 10" in read.notes[0]


@pytest.mark.parametrize("row", sorted({row for row, *_ in SCRIPTS}))
def test_rows_in_python(
    row: str, wild2: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    asked = {name: line for of, name, line in SCRIPTS if of == row}
    for argument in sorted(asked) if row == "M2" else [""]:
        monkeypatch.setattr(sys, "argv", ["case.py", *argument.split()])
        runpy.run_path(str(wild2 / row / "case.py"), run_name="__main__")
    said = [line.split(" | ", 2) for line in capfd.readouterr().out.splitlines()]
    assert [name for name, *_ in said] == list(asked)
    for name, kind, text in said:
        assert kind == "InputError" and re.search(asked[name], text), (name, text)


def test_every_row_is_among_them(wild2: Path) -> None:
    here = Path(__file__).read_text(encoding="utf-8")
    rows = sorted(folder.name for folder in wild2.iterdir() if folder.is_dir() and folder.name not in ("base", "pair"))
    assert len(rows) >= 34 and [row for row in rows if not re.search(rf'"{row}("|[/ abc])', here)] == []


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script")
def test_a_closed_standard_output(wild2: Path) -> None:
    done = subprocess.run(
        ["sh", str(wild2 / "C1" / "run.sh")], cwd=TOP, capture_output=True, text=True, check=True, timeout=300
    )
    assert "plain: status 0" in done.stderr and "--json --quiet: status 0" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="a file system whose names are UTF-8")
def test_a_name_that_is_not_utf_8(wild2: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / os.fsdecode(b"caf\xe9")  # what the script of the row "C2" does
    folder.mkdir()
    assert cli.main(["import", str(wild2 / "base" / "ct"), "-o", str(folder / "case"), "--quiet"]) == 3
    assert "is a name that is not UTF-8" in capfd.readouterr().err and list(folder.iterdir()) == []


@pytest.mark.nightly
@pytest.mark.parametrize("change", [("90", "1", "-250"), ("120", "0.8", "0")])
def test_a_cone_beam_scan_whose_hu_are_off(
    change: tuple[str, ...], wild2: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    make = [sys.executable, str(wild2 / "M8" / "make.py"), str(tmp_path / "scan"), *change]
    subprocess.run(make, cwd=TOP, check=True, timeout=120)
    command = ["import", str(TOP / "sample_dicom" / "rest"), str(tmp_path / "scan"), "-o", str(tmp_path / "case")]
    assert cli.main(command) == 0
    told = capfd.readouterr().out
    assert "deformed: the HU are off: soft tissue lies at" in told and "look at the alignment" not in told
