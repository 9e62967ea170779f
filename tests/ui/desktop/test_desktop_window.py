"""The window itself without a screen, driven by a script: pictures that are not blank, sides that are right, stalls that are short."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from phantoms import CENTRE, MARKER, affine, marked_ct, write_case
from PIL import Image

from palpate.core.arrays import LabelArray
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.ui.cli import main as cli

REFERENCES = """
import sys
from PySide6.QtCore import QPointF
from PySide6.QtGui import QImage, QPainter
image = QImage(20, 20, QImage.Format.Format_RGB32)
painter = QPainter(image)
before = sys.getrefcount(None)
for _ in range(1000):
    painter.drawPoint(QPointF(1.0, 1.0))
lost = before - sys.getrefcount(None)
painter.end()
sys.exit(lost > 100)
"""


def play(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Events of a script, run in a process of its own: Qt allows one application in a process."""
    monkeypatch.setenv("PALPATE_SETTINGS", str(folder / "settings"))
    path = folder / "script.txt"
    path.write_text(script)
    command = [sys.executable, "-m", "palpate.ui.cli", "open", "--headless", "--script", str(path), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=False)
    assert done.returncode == 0, done.stdout[-800:] + done.stderr[-2000:]
    events: list[dict[str, Any]] = json.loads(done.stdout)["events"]
    return events


def picture(path: str) -> LabelArray:
    return np.asarray(Image.open(path).convert("RGB"))


def part(whole: LabelArray, top: bool, left: bool) -> LabelArray:
    """One of the four views, of a window of 1300 x 900 with its step bar above and panels at the right."""
    rows = slice(60, 460) if top else slice(480, 860)
    return whole[rows, slice(10, 420) if left else slice(440, 840)]


def test_no_outline_is_drawn_where_the_scan_has_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scan is 24 of the labels' 33 slices high; the rectum goes through all of them."""
    case = write_case(tmp_path / "case")
    whole = marked_ct(affine())
    who = SeriesIdentity("1", "X^Y", "s", "r", "f", 1, "study", "CT", "drawn by a test")
    write_ct_series(case.file("rest_ct"), whole.with_array(whole.array[:, :, :24]), who, compress=False)
    x, y, z = (float(c) for c in CENTRE + [0.0, 27.0, 0.0])
    events = play(
        tmp_path,
        f"""
        open {case.path}
        resize 1300 900
        show overlay none
        show mode rest
        crosshair {x} {y} {z}
        wait 60
        screenshot view.png
        """,
        monkeypatch,
    )
    (path,) = (event["file"] for event in events if "file" in event)
    view = part(picture(path), top=False, left=True).astype(int)  # coronal
    purple = (view[..., 0] - view[..., 1] > 50) & (view[..., 2] - view[..., 1] > 20)
    scan = (abs(view - 102) < 12).all(axis=2).mean(axis=1) > 0.3
    rows = np.flatnonzero(purple.any(axis=1))
    assert len(rows) > 50 and scan[rows.min() + 2 : rows.max() - 1].mean() > 0.97
    assert not scan[: rows.min() - 3].any() and rows.min() > 20, "above it there is nothing at all"


def test_qt_does_not_eat_the_references_to_none() -> None:
    """PySide6 6.12.0 does on Python 3.11, and the program dies after a minute."""
    done = subprocess.run(
        [sys.executable, "-c", REFERENCES], env=os.environ | {"QT_QPA_PLATFORM": "offscreen"}, check=False
    )
    assert done.returncode == 0


def left_and_right(case: Path) -> str:
    """Marker, stiffness, mask, labels and both scans of a case, each as a picture."""
    x, y, z = (float(c) for c in MARKER)
    ox, oy, oz = (float(c) for c in CENTRE)
    return f"""
    open {case}
    resize 1300 900
    show outlines off
    show overlay none
    crosshair {x} {y} {z}
    crosshair {x + 30} {y + 30} {z}
    stalls
    screenshot marker.png
    show overlay stiffness
    show outlines on
    crosshair {ox + 6} {oy} {oz}
    screenshot stiffness.png
    show surest_factor 1.1
    screenshot masked.png
    show overlay labels
    seed prostate {ox + 6} {oy} {oz}
    brush bladder 5 {ox + 6} {oy} {oz}
    expect unsaved true
    screenshot painted.png
    undo
    expect unsaved false
    show tool angle
    click axial {ox + 20} {oy} {oz}
    click axial {ox} {oy} {oz}
    click axial {ox} {oy - 20} {oz}
    show overlay none
    screenshot angle.png
    show overlay labels
    show mode "side by side"
    screenshot both.png
    show mode blend
    screenshot blend.png
    stalls
    expect seeds 1
    """


def test_the_window_shows_the_case_with_the_patients_left_on_the_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = write_case(tmp_path / "case", ct=True)
    events = play(tmp_path, left_and_right(case.path), monkeypatch)
    shots = {Path(e["file"]).stem: picture(e["file"]) for e in events if "file" in e}
    assert all(shot.std() > 20 for shot in shots.values())

    marker = part(shots["marker"], top=True, left=True)
    bright = np.argwhere(marker.min(axis=2) > 250)
    # The bright ball lies to the patient's left and in front: right of the middle and above it.
    ball = np.median(bright[(bright[:, 0] > 40) & (bright[:, 0] < 360)], axis=0)
    assert ball[1] > marker.shape[1] / 2 and ball[0] < marker.shape[0] / 2

    solid = part(shots["stiffness"], top=True, left=False)
    assert solid.std() > 15, "the 3D view is blank"
    axial = part(shots["stiffness"], top=True, left=True).astype(int)
    green = np.argwhere((axial[..., 1] > 150) & (axial[..., 1] - axial[..., 2] > 60))
    teal = np.argwhere((axial[..., 2] - axial[..., 0] > 40) & (np.abs(axial[..., 1] - axial[..., 2]) < 40))
    # 120 kPa in the left half against 40 in the right: on the colour bar green above teal, on the screen right of it.
    assert len(green) > 3000 and len(teal) > 3000 and green[:, 1].mean() > teal[:, 1].mean() + 40
    assert np.abs(shots["masked"].astype(int) - shots["stiffness"]).sum() > 1e5
    measured = part(shots["angle"], top=True, left=True).astype(int)
    assert ((measured[..., 0] > 230) & (abs(measured[..., 1] - 216) < 20) & (measured[..., 2] < 110)).sum() > 150, (
        "no angle"
    )
    changed = np.abs(shots["painted"].astype(int) - shots["stiffness"]).sum(axis=2) > 60
    assert part(changed, top=True, left=True).any()


def test_two_scans_are_shown_in_one_frame_and_a_script_that_fails_names_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    case = write_case(tmp_path / "case", ct=True)
    moved = np.eye(4)
    moved[:3, 3] = (4.0, -6.0, 3.0)
    scan = case.ct("rest")
    who = SeriesIdentity("4711-XYZ", "Doe^Jane", "s", "d", "g", 2, "study", "CT pelvis", "drawn by a test")
    write_ct_series(case.file("deformed_ct"), scan.moved(np.linalg.inv(moved)), who, compress=False)
    case.write_json("alignment.json", {"deformed_to_rest": moved, "residual_mm": 0.1})
    script = f"""
    open {case.path}
    resize 1300 900
    show overlay none
    show outlines off
    crosshair 20 50 {MARKER[2]}
    screenshot rest.png
    show mode deformed
    screenshot deformed.png
    """
    events = play(tmp_path, script, monkeypatch)
    rest, deformed = (part(picture(e["file"]), True, True)[40:].astype(int) for e in events if "file" in e)
    assert np.abs(rest - deformed).mean() < 4.0, "the deformed scan is not shown in the rest frame"

    bad = tmp_path / "bad.txt"
    bad.write_text(f"open {case.path}\nexpect unsaved true\n")
    monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))
    done = subprocess.run([sys.executable, "-m", "palpate.ui.cli", "open", "--headless", "--script", str(bad), "--json"],
                          capture_output=True, text=True, timeout=120, check=False)  # fmt: skip
    assert done.returncode == 3 and f"palpate: {bad}, line 2: unsaved is false, not true" in done.stderr
    told = json.loads(done.stdout)
    assert told["exit_code"] == 3 and [e["command"] for e in told["events"]] == ["open"] and told["events"][0]["case"]


def test_a_brush_paints_what_is_shown_and_a_small_window_is_as_small_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = write_case(tmp_path / "case", other={"simulated": True})
    x, y, z = (float(c) for c in CENTRE)
    before = {state: case.labels(state).array for state in ("rest", "deformed")}
    script = f"""
    open {case.path}
    wait 100
    expect labels deformed,rest
    expect simulated true
    expect steps.identify blocked
    show mode deformed
    brush bladder 5 {x} {y} {z}
    save
    show mode "side by side"
    resize 900 600
    screenshot small.png
    """
    events = play(tmp_path, script, monkeypatch)
    assert next(e for e in events if e["command"] == "wait")["solid_settled"]
    assert np.array_equal(case.labels("rest").array, before["rest"])
    assert (case.labels("deformed").array == 5).any()
    shot = picture(next(e["file"] for e in events if "file" in e))
    assert shot.shape[:2] == (600, 900)


def test_usage(tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert cli.main(["open", "--headless"]) == 2
    assert "--headless needs --script FILE" in capfd.readouterr().err
    assert cli.main(["open", "--headless", "--script", str(tmp_path / "none.txt")]) == 3
    assert "not a readable script" in capfd.readouterr().err
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    if sys.platform.startswith("linux"):
        assert cli.main(["open"]) == 3
        assert "there is no display" in capfd.readouterr().err
