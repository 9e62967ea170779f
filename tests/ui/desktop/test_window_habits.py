"""The real window on a laptop's screen, by mouse, wheel and keys: nothing is changed by accident, and what is measured is kept."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from map_arrays import map_arrays
from phantoms import CENTRE, map_facts, result, write_case
from x_display import needs_xvfb, x_display

from palpate.case.measured.measurements import read_measurements
from palpate.core.identify.map.region_mean import region_mean

pytestmark = needs_xvfb

HANDS = """
import json, sys
from pathlib import Path
import numpy as np
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor, QCursor, QDesktopServices, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog
from palpate.ui.desktop import style
from palpate.ui.desktop.qt_application import events_for
from palpate.ui.desktop.scripting.commands_script import Driver
from palpate.ui.desktop.scripting.synthetic_input import _pixel
from palpate.ui.desktop.window.application import new_window

folder = Path(sys.argv[2])
window, application = new_window(headless=False)
window.show()
window.resize(1280, 700)
process = events_for(application)
window.activateWindow()
assert QTest.qWaitForWindowActive(window, 5000), "keys go to the active window"
driver = Driver(window, process, folder, "test")
driver.do_open(sys.argv[1])
centre = json.loads(sys.argv[3])
controller = window.controller
view = window.views.slices["axial", "rest"]
left, plain = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
told = {}
controller.look_at(*centre)
process(0.3)

def wheel(widget):
    at = QPointF(widget.rect().center())
    event = QWheelEvent(at, QPointF(widget.mapToGlobal(at.toPoint())), QPoint(0, -120), QPoint(0, -120), Qt.MouseButton.NoButton, plain,
                        Qt.ScrollPhase.NoScrollPhase, False)
    application.sendEvent(widget, event)
    process(0.02)

def drag(first, last, steps=8):
    QTest.mousePress(view, left, plain, first)
    for n in range(1, steps + 1):
        QTest.mouseMove(view, first + (last - first) * (n / steps))
    QTest.mouseRelease(view, left, plain, last)
    process(0.05)

def corner():
    image = view.grab().toImage()
    wanted, found = QColor(style.WARN), 0
    for x in range(image.width() // 2, image.width()):
        for y in range(0, 22):
            there = image.pixelColor(x, y)
            found += max(abs(there.red() - wanted.red()), abs(there.green() - wanted.green()), abs(there.blue() - wanted.blue())) < 40
    return found

def tab():
    return window.tabs.tabText(window.tabs.currentIndex())

# The wheel over controls that have no focus.
view.setFocus()
before = controller.display.to_dict()
for panel, controls in ((window.edit, (window.edit.label, window.edit.seed, window.edit.radius, window.edit.low)),
                        (window.display, (window.display.preset, window.display.opacity, window.display.scale))):
    window.tabs.setCurrentWidget(panel)
    process(0.05)
    for control in controls:
        wheel(control)
wheel(window.tabs.tabBar())
told["wheel"] = [controller.display.to_dict() == before, tab()]
# A label that is chosen does not choose the brush.
window.edit.label.setCurrentIndex(4)
window.edit.label.textActivated.emit(window.edit.label.currentText())
told["label"] = [controller.display.label, controller.display.tool]

# The tool in force.
told["corner"] = [corner()]
controller.show(overlay="map")
QTest.keyClick(window, "3")
process(0.1)
told["brush"] = [controller.display.tool, tab(), controller.display.overlay]
told["corner"].append(corner())
window.tabs.setCurrentWidget(window.display)
process(0.05)
told["left"] = controller.display.tool
told["corner"].append(corner())
driver.do_screenshot("labels.png")

# Double click, F, Page Up.
here = view.rect().center()
mm = view.viewport.mm_per_pixel * min(view.width(), view.height())
QTest.mouseDClick(view, left, plain, here)
process(0.3)
told["alone"] = [view.width() / window.views.width(), view.height() / window.views.height(),
                 view.viewport.mm_per_pixel * min(view.width(), view.height()) / mm]
driver.do_screenshot("alone.png")
QTest.mouseDClick(view, left, plain, view.rect().center())
process(0.2)
told["again"] = [sum(1 for _ in window.views.visible_slices()), view.viewport.mm_per_pixel * min(view.width(), view.height()) / mm]
controller.look_at(centre[0] + 40.0, centre[1] - 40.0, centre[2] + 40.0)
view.viewport.centre = np.array(centre) + 80.0
QTest.keyClick(window, "F")
process(0.05)
at = np.array(controller.display.crosshair)
told["organ"] = [int(driver.controller.labels("rest").array[tuple(np.rint(controller.labels("rest").to_index(at[None])[0]).astype(int))]),
                 float(np.linalg.norm(view.viewport.centre - centre))]
window.display.opacity.setFocus()
QCursor.setPos(window.display.opacity.mapToGlobal(QPoint(5, 5)))
process(0.1)
z, value = controller.display.crosshair[2], window.display.opacity.value()
QTest.keyClick(window.display.opacity, Qt.Key.Key_PageUp)
process(0.05)
told["page"] = [controller.display.crosshair[2] - z, window.display.opacity.value() - value]

# Nothing jumps when a result becomes out of date.
kind = type(controller)
kept = kind.out_of_date
places = []
for reason in ("", "the labels of the scan at rest, by which it was made, have been changed since by a person with the brush"):
    kind.out_of_date = lambda self, command, why=reason: why
    controller.notify("steps")
    process(0.2)
    places.append([window.results.y(), window.results.height(), window.tabs.mapTo(window, QPoint(0, 0)).y()])
told["jump"] = [places, window.results.old.text()]
driver.do_screenshot("out_of_date.png")
kind.out_of_date = kept
controller.notify("steps")

# A dialogue that is cancelled, a page that cannot be opened, a case that is open already.
window.page.pair.rest_labels = Path("kept.nii.gz")
QFileDialog.getOpenFileName = staticmethod(lambda *_: ("", ""))
window.page._choose("rest_labels")
told["cancelled"] = str(window.page.pair.rest_labels)
QDesktopServices.openUrl = staticmethod(lambda url: False)
(controller.case.folder.file("report")).mkdir(exist_ok=True)
controller.case.folder.file("report/report.html").write_text("a report")
window.open_report()
told["page said"] = controller.said
window.page.open_case(Path(sys.argv[1]))
told["twice"] = [controller.said, controller.case is not None, window.page.problem.text()]

# Measuring: an ellipse by E on the left half, a ruler, an angle.
controller.look_at(*centre)
QTest.keyClick(window, "E")
process(0.1)
told["measure"] = [controller.display.tool, tab(), controller.display.overlay]
first, last = (_pixel(view, (centre[0] + dx, centre[1] + dy, centre[2])) for dx, dy in ((3.0, -6.0), (13.0, 6.0)))
drag(first, last)
QTest.keyClick(window, "6")
drag(here, here + QPoint(40, 0))
QTest.keyClick(window, "7")
for dx, dy in ((40, 0), (0, 0), (0, 40)):
    QTest.mouseClick(view, left, plain, here + QPoint(dx, dy))
process(0.1)
told["kept"] = [[one.kind, *controller.measuring.value_words(one)] for one in controller.measuring.kept]
told["listed"] = window.measure.list.count()
driver.do_screenshot("measured.png")
QTest.keyClick(window, "6")
QTest.mouseDClick(view, left, plain, here)
process(0.2)
told["alone by the ruler"] = [view.width() / window.views.width(), len(controller.measuring.kept)]
QTest.mouseDClick(view, left, plain, view.rect().center())
process(0.2)
window.measure.list.setCurrentRow(2)
window.measure.delete.click()
told["deleted"] = [one.kind for one in controller.measuring.kept]

# Lasso and polygon paint the slice within, and one undo takes it back.
controller.show(label=5, mode="rest")
count = lambda: int((controller.labels("rest").array == 5).sum())
start, counts = count(), []
QTest.keyClick(window, "8")
a, b, c = (_pixel(view, (centre[0] + dx, centre[1] + dy, centre[2])) for dx, dy in ((-20.0, -20.0), (20.0, -20.0), (0.0, 20.0)))
QTest.mousePress(view, left, plain, a)
for pixel in (b, c):
    QTest.mouseMove(view, pixel)
QTest.mouseRelease(view, left, plain, c)
process(0.05)
counts.append(count() - start)
controller.editing.undo()
counts.append(count() - start)
QTest.keyClick(window, "9")
for pixel in (a, b):
    QTest.mouseClick(view, left, plain, pixel)
    QTest.qWait(500)
QTest.mouseClick(view, left, plain, c)
QTest.mouseDClick(view, left, plain, c)
process(0.05)
counts.append(count() - start)
told["outlined"] = counts

# Labels that are hidden, scales and colours.
controller.show(tool="look", overlay="labels")
process(0.1)
shown = view.grab().toImage()
window.display.labels.shown[5].setChecked(False)
process(0.1)
told["hidden"] = [controller.display.opacity_of(5), view.grab().toImage() != shown]
controller.show(scale="0 to 200 kPa", colours="turbo", overlay="stiffness")
told["scale"] = [controller.scale.low, controller.scale.high, controller.scale.colours]
driver.do_screenshot("scale.png")
controller.case.flush()

from palpate.ui.desktop.window.statistics_page import StatisticsPage
page = StatisticsPage(window, controller)
page.show()
process(0.1)
page.grab().save(str(folder / "statistics.png"))
page.write(folder / "statistics.csv")
page.close()
window.hide(); window.shut()
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("habits")


@pytest.fixture(scope="module")
def told(folder: Path) -> dict[str, Any]:
    case = write_case(folder / "case", result(stiffness_map=map_facts()), ct=True)
    case.write_npz("identify/stiffness_map.npz", **map_arrays(True))
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("PALPATE_SETTINGS", str(folder / "settings"))
        with x_display(folder, "1280x720", monkeypatch):
            done = subprocess.run(
                [sys.executable, "-c", HANDS, str(case.path), str(folder), json.dumps([float(x) for x in CENTRE])],
                capture_output=True, text=True, timeout=400, check=False,
            )  # fmt: skip
    if "no window can be opened" in done.stderr:
        pytest.skip("Qt's X11 libraries are not on this machine")
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def test_the_wheel_over_the_panel_changes_nothing(told: dict[str, Any]) -> None:
    assert told["wheel"] == [True, "View"]


def test_a_chosen_label_does_not_choose_the_brush(told: dict[str, Any]) -> None:
    assert told["label"] == [5, "look"]


def test_the_tool_in_force_is_seen_and_left_with_its_tab(told: dict[str, Any]) -> None:
    assert told["brush"] == ["brush", "Correct", "labels"], "painted labels must be seen"
    assert told["left"] == "look"
    none, some, again = told["corner"]
    assert none == again == 0 and some > 20


def test_a_double_click_gives_a_view_all_the_room(told: dict[str, Any]) -> None:
    wide, high, seen = told["alone"]
    assert wide > 0.95 and high > 0.95 and seen == pytest.approx(1.0, rel=0.02)
    assert told["again"][0] == 3 and told["again"][1] == pytest.approx(1.0, rel=0.02)
    assert told["alone by the ruler"][0] > 0.95 and told["alone by the ruler"][1] == 3, "and nothing is measured"


def test_f_goes_to_the_organ_and_page_up_works_wherever_the_focus_is(told: dict[str, Any]) -> None:
    label, away = told["organ"]
    assert label in (1, 2) and away < 4.0
    assert told["page"] == [pytest.approx(3.0), 0]


def test_nothing_jumps_when_a_result_becomes_out_of_date(told: dict[str, Any]) -> None:
    (before, after), words = told["jump"]
    assert before == after and "ut of date" in words


def test_what_cannot_be_done_is_told(told: dict[str, Any]) -> None:
    assert told["cancelled"] == "kept.nii.gz"
    assert "report.html" in told["page said"] and "no program" in told["page said"]
    said, is_open, problem = told["twice"]
    assert "open already" in said and is_open and not problem


def test_measurements_are_kept_with_the_case(told: dict[str, Any], folder: Path) -> None:
    assert told["measure"] == ["ellipse", "Measure", "map"]
    kinds = [one[0] for one in told["kept"]]
    assert kinds == ["ellipse", "distance", "angle"] and told["listed"] == 3
    ellipse, _, angle = told["kept"]
    assert ellipse[1].startswith("G = ") and ellipse[2].startswith("95 % ") and ellipse[3].startswith("E = ")
    area = float(ellipse[4].split()[0])
    assert area == pytest.approx(np.pi * 5.0 * 6.0, rel=0.05) and angle[1] == "90.0\N{DEGREE SIGN}"
    assert told["deleted"] == ["ellipse", "distance"]
    from palpate.case.case_folder import CaseFolder

    found = read_measurements(CaseFolder(folder / "case"))
    assert [one.kind for one in found] == ["ellipse", "distance"]
    # The mean is that of the map at the ellipse's place.
    middle = np.array(found[0].points).mean(axis=0)
    at = region_mean(map_arrays(True), middle[None]).G_kpa
    assert at is not None and float(ellipse[1].split()[2]) == pytest.approx(at, rel=0.1)


def test_lasso_and_polygon_label_a_slice(told: dict[str, Any]) -> None:
    lasso, undone, polygon = told["outlined"]
    expected = 0.5 * 40.0 * 40.0 / (2.0 * 1.5)  # the triangle's area over a voxel's
    assert undone == 0 and lasso == pytest.approx(expected, rel=0.1) and polygon == pytest.approx(expected, rel=0.1)


def test_labels_hide_and_scales_are_the_same_for_every_patient(told: dict[str, Any]) -> None:
    assert told["hidden"] == [0.0, True]
    assert told["scale"] == [0.0, 200.0, "turbo"]


def test_statistics_are_written_with_their_histograms(told: dict[str, Any], folder: Path) -> None:
    rows = (folder / "statistics.csv").read_text().splitlines()
    assert rows[0].startswith("scan,label,volume_cc") and any(row.startswith("rest,prostate_left,") for row in rows)
    bins = [row.split(",") for row in (folder / "statistics_histograms.csv").read_text().splitlines()[1:]]
    organ = [row for row in bins if row[:3] == ["rest", "prostate_left", "G"]]
    assert organ and sum(int(row[6]) for row in organ) > 100
