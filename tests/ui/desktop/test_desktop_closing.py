"""Closing with unsaved corrections asks; dropped folders open. In a process of its own: Qt allows one application in each."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from phantoms import CENTRE, write_case

from palpate.case.case_folder import CaseFolder

CLOSING = """
import json, sys, time
from pathlib import Path
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtWidgets import QMessageBox
from palpate.ui.desktop.window import application
from palpate.ui.desktop.panels.charts import SwarmChart
from palpate.ui.desktop.session.jobs import Swarm
from palpate.ui.desktop.window.questions import may_close

case, scans, centre = Path(sys.argv[1]), [Path(p) for p in sys.argv[2].split(",")], json.loads(sys.argv[3])
window, qt = application.new_window(headless=True)
window.show()
controller, told = window.controller, {}

def spin():
    while controller.reader.running or controller.jobs.running:
        qt.processEvents()
        time.sleep(0.005)
    qt.processEvents()

def drop(paths):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(p)) for p in paths])
    window.dropEvent(QDropEvent(QPointF(5, 5), Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier))

drop(scans)
told["pair"] = [window.page.pair.rest.name, window.page.pair.deformed.name, window.page.go.isEnabled()]
drop([case])
spin()
told["opened"] = controller.case is not None and window.stack.currentIndex() == 1

def paint(label):
    controller.show(tool="brush", label=label, radius_mm=5.0)
    controller.editing.begin("rest", None, tuple(centre))
    controller.editing.end()

asked = []
def answer(button):
    def question(*arguments, **more):
        asked.append(arguments[2])
        return button
    QMessageBox.question = question

buttons = QMessageBox.StandardButton
paint(5)
answer(buttons.Cancel)
told["stays"] = not window.close() and controller.case.corrections.unsaved
answer(buttons.Save)
told["saves"] = may_close(window, controller) and not controller.case.corrections.unsaved
controller.case.flush()
paint(6)
answer(buttons.Discard)
told["closes"] = window.close() and controller.case is None
told["asked"] = asked

chart = SwarmChart()
chart.resize(320, 160)
blank = chart.grab().toImage()
chart.show_swarm(Swarm([1, 2, 3], [9.0, 4.0, 3.9], [[10.0, 40.0], [12.0, 30.0]]), (5.0, 500.0))
told["chart"] = chart.grab().toImage() != blank
print(json.dumps(told))
"""


def test_closing_asks_and_dropping_opens(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    before = case.labels("rest").array
    scans = [tmp_path / "filled_rectum_deformed", tmp_path / "at_rest"]
    for scan in scans:
        scan.mkdir()
    at = [float(CENTRE[0]) + 6.0, float(CENTRE[1]), float(CENTRE[2])]
    done = subprocess.run(
        [sys.executable, "-c", CLOSING, str(case.path), ",".join(map(str, scans)), json.dumps(at)],
        capture_output=True, text=True, timeout=120, check=False, env=os.environ | {"PALPATE_SETTINGS": str(tmp_path / "s")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["pair"] == ["at_rest", "filled_rectum_deformed", True]
    assert all(told[name] for name in ("opened", "stays", "saves", "closes", "chart"))
    assert told["asked"] == ["Save the corrected labels before closing?"] * 3
    after = CaseFolder(case.path).labels("rest").array
    assert (after == 5).any() and ((after == 6) == (before == 6)).all()  # the first was saved, the second given up
