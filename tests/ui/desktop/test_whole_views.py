"""One view alone, the 3D view too; a saved picture has the scale of its colours; the right button magnifies in 3D."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from phantoms import write_case

LOOK = """
import json, sys
from pathlib import Path
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from palpate.ui.desktop.qt_application import events_for
from palpate.ui.desktop.scripting.commands_script import Driver
from palpate.ui.desktop.window.application import new_window

window, application = new_window(headless=True)
window.show()
process = events_for(application)
driver = Driver(window, process, Path(sys.argv[2]), "test")
driver.do_open(sys.argv[1])
views = window.views
told = {"views": views.width()}
for overlay in ("none", "stiffness"):
    driver.do_show("overlay", overlay)
    process(0.1)
    told[overlay] = window.picture().width()
    told[f"{overlay} views"] = views.width()
shown = lambda: [view.accessibleName() for view in (*views.slices.values(), views.solid) if view.isVisible()]
solid, left, right = views.solid, Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton
QTest.mouseDClick(solid, left)
told["alone"] = shown()
QTest.mouseDClick(solid, left)
told["again"] = shown()
before = (solid.zoom, solid.azimuth)
QTest.mousePress(solid, right, pos=QPoint(60, 90))
QTest.mouseMove(solid, QPoint(60, 60))
QTest.mouseRelease(solid, right, pos=QPoint(60, 60))
told["zoom"] = [solid.zoom / before[0], solid.azimuth - before[1]]
window.hide(); window.shut()
print(json.dumps(told))
"""


def test_the_3d_view_alone_and_a_picture_with_its_scale(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", ct=True)
    done = subprocess.run(
        [sys.executable, "-c", LOOK, str(case.path), str(tmp_path)],
        env=os.environ | {"PALPATE_SETTINGS": str(tmp_path / "s")}, capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["none"] == told["none views"], "no colours, no scale"
    assert told["stiffness"] > told["stiffness views"] + 50, "the scale stands beside the views"
    assert told["alone"] == ["3D view"] and len(told["again"]) == 4
    factor, turned = told["zoom"]
    assert factor > 1.1 and turned == 0.0
