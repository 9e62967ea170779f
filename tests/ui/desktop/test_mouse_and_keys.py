"""Habits of 3D Slicer and ITK-SNAP in the window, by real mouse and key events, and the menu and the page that tell them."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from phantoms import CENTRE, MARKER, write_case

from palpate.ui.desktop.window.help_page import ROWS

TOP = Path(__file__).resolve().parents[3]
HANDS = """
import json, sys
from pathlib import Path
import numpy as np
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from palpate.ui.desktop.qt_application import events_for
from palpate.ui.desktop.scripting.commands_script import Driver
from palpate.ui.desktop.scripting.synthetic_input import _pixel
from palpate.ui.desktop.window.application import new_window

window, application = new_window(headless=True)
window.show()
process = events_for(application)
driver = Driver(window, process, Path(sys.argv[2]), "test")
driver.do_open(sys.argv[1])
centre, marker = json.loads(sys.argv[3])
controller, display = window.controller, window.controller.display
view = window.views.slices["axial", "rest"]
left, right, control = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton, Qt.KeyboardModifier.ControlModifier
plain = Qt.KeyboardModifier.NoModifier
told = {}

def drag(button, first, last, modifier=plain):
    QTest.mousePress(view, button, modifier, first)
    QTest.mouseMove(view, last)
    QTest.mouseRelease(view, button, modifier, last)
    process(0.02)

def count(label):
    return int((controller.labels("rest").array == label).sum())

def at(point):
    controller.look_at(*point)
    process(0.02)
    return _pixel(view, tuple(point))

here = at(centre)
before = view.viewport.mm_per_pixel
drag(right, here, here - QPoint(0, 60))
told["zoom"] = before / view.viewport.mm_per_pixel
QTest.keyClick(window, "3")
told["tool"] = display.tool
radius = display.radius_mm
QTest.keyClick(window, Qt.Key.Key_Plus)
told["wider"] = display.radius_mm / radius
QTest.keyClick(window, Qt.Key.Key_Minus)
told["back"] = display.radius_mm / radius
controller.show(label=5)
start = count(5)
here = at(centre)
QTest.mouseClick(view, left, plain, here)
told["painted"] = count(5) - start
QTest.mouseClick(view, left, control, here)
told["erased"] = count(5) - start
controller.show(paint_low_hu=500.0, radius_mm=12.0)
QTest.mouseClick(view, left, plain, here)
told["water"] = count(5) - start
edge = at([marker[0] + 9.0, marker[1], marker[2]])
QTest.mouseClick(view, left, plain, edge)
ct, labels = controller.ct("rest"), controller.labels("rest")
inside = labels.to_lps(np.argwhere(labels.array == 5).astype(float))
painted = inside[np.linalg.norm(inside - marker, axis=1) < 14.0]
told["marker"] = [len(painted), float(ct.array[tuple(np.rint(ct.to_index(painted)).astype(int).T)].min()) if len(painted) else None]
QTest.keyClick(window, "6")
here = at(centre)
drag(left, here, here + QPoint(50, 0))
process(0.05)
told["ruler"] = [float(np.linalg.norm(np.subtract(*controller.measuring.kept[-1].points))), 50 * view.viewport.mm_per_pixel]
z = display.crosshair[2]
view.setFocus()
QTest.keyClick(view, Qt.Key.Key_PageUp)
told["page"] = display.crosshair[2] - z
told["menus"] = {menu.title().replace("&", ""): [a.text() for a in menu.actions() if a.text()]
                 for menu in (action.menu() for action in window.menuBar().actions())}
window.hide(); window.shut()
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("hands")
    case = write_case(folder / "case", ct=True)
    places = json.dumps([[float(x) for x in CENTRE], [float(x) for x in MARKER]])
    done = subprocess.run(
        [sys.executable, "-c", HANDS, str(case.path), str(folder), places],
        env=os.environ | {"PALPATE_SETTINGS": str(folder / "s")}, capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def test_a_right_drag_magnifies_and_page_up_goes_towards_the_head(told: dict[str, Any]) -> None:
    assert told["zoom"] == pytest.approx(2.0**0.5, rel=0.02)
    assert told["page"] > 0.0


def test_keys_choose_the_tool_and_the_brush_s_size(told: dict[str, Any]) -> None:
    assert told["tool"] == "brush" and told["wider"] > 1.1 and told["back"] == pytest.approx(1.0)


def test_a_modifier_turns_the_brush_into_an_eraser(told: dict[str, Any]) -> None:
    assert told["painted"] > 0 and told["erased"] == 0


def test_a_threshold_keeps_the_brush_to_its_hounsfield_units(told: dict[str, Any]) -> None:
    count, least = told["marker"]
    assert told["water"] == 0, "water lies below the threshold"
    assert count > 0 and least >= 500.0


def test_the_ruler_measures_what_was_dragged(told: dict[str, Any]) -> None:
    length, dragged = told["ruler"]
    assert length == pytest.approx(dragged, rel=0.02)


def test_the_menu_has_what_a_person_looks_for(told: dict[str, Any]) -> None:
    file = " | ".join(told["menus"]["File"])
    for words in (
        "Open scans",
        "Open recent",
        "Open the finished sample",
        "Run the sample",
        "Export",
        "Report",
        "Save picture",
    ):
        assert words in file
    assert any("About" in entry for entry in told["menus"]["Help"]) and "Mouse and keys" in told["menus"]["Help"]


def test_the_page_on_f1_is_that_of_the_documentation() -> None:
    page = (TOP / "docs" / "desktop.md").read_text(encoding="utf-8")
    table = dict(re.findall(r"^\| (.+?) \| (.+?) \|$", page.replace("*", ""), re.MULTILINE))
    for key, what in ROWS:
        assert what in table[key], key
