"""What is typed on the first page stays as it is typed; the window fits the screen, and is again where it was."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

TYPED = """
import json, sys
from PySide6.QtCore import QSize, Qt
from PySide6.QtTest import QTest
from palpate.ui.desktop.window.application import new_window

window, application = new_window(headless=True)
from palpate.ui.desktop.window import geometry
window.show()
field = window.page.fields["rest"]
QTest.keyClicks(field, "/data//scans/rest/")
QTest.keyClick(field, Qt.Key.Key_Left)
QTest.keyClicks(field, " ")
told = {"text": field.text(), "path": str(window.page.pair.rest), "sizes": []}
window.page.refresh()
told["shown"] = field.text()
for room in (QSize(1280, 690), QSize(3840, 2130)):
    told["sizes"].append(geometry.first_size(room).toTuple())
least = window.minimumSizeHint()
told["least"] = [least.width(), least.height()]
window.resize(780, 700)  # the screen of this platform is 800 x 800
geometry.remember(window)
window.shut()
other, _ = new_window(headless=True)
geometry.restore(other)
told["again"] = other.size().toTuple()
other.shut()
sys.stdout.write(json.dumps(told))
"""


def test_a_path_can_be_typed_and_the_window_is_as_it_was_left(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", TYPED],
        env=os.environ | {"PALPATE_SETTINGS": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    told = json.loads(done.stdout)
    assert told["text"] == "/data//scans/rest /" and told["path"] == "/data/scans/rest "
    assert told["shown"] == "/data/scans/rest "
    (small, large) = told["sizes"]
    assert small[0] <= 1280 and small[1] <= 690 and large == [1500, 940]
    assert told["least"][0] <= small[0] and told["least"][1] <= small[1], "it must not be cut off by a laptop's screen"
    assert told["again"] == [780, 700]


STILL = """
import json, sys, time
from palpate.ui.desktop.qt_application import events_for
from palpate.ui.desktop.session.jobs import JobState
from palpate.ui.desktop.window.application import new_window

window, application = new_window(headless=True)
process = events_for(application)
window.show()
window.stack.setCurrentIndex(1)
tops, fronts = [], []
def look():
    window.controller.notify("job")
    process(0.05)
    tops.append([window.results.y(), window.tabs.y()])
    fronts.append(window.tabs.tabText(window.tabs.currentIndex()))
look()
state = JobState("Stiffness", time.monotonic(), step="identify", step_began=time.monotonic(), step_fraction=0.2, message="plain model")
window.controller.jobs.state = state
look()
state.message, state.step_fraction = "reduced model: 12 full solves, error at most 2.5 % of the largest displacement", 0.5
look()
state.swarm.hear({"iteration": 1, "best": 3.0, "particles": [[20.0, 60.0], [30.0, 50.0]]})
look()
state.outcome = "done"
look()
window.results.words.setText("<br>".join(["a line of a result"] * 12))
look()
window.controller.show(surest_factor=1.5)
look()
window.controller.jobs.state = None
look()
window.shut()
sys.stdout.write(json.dumps([tops, fronts]))
"""


def test_panels_stay_where_they_are_whatever_a_step_tells(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", STILL],
        env=os.environ | {"PALPATE_SETTINGS": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    (first, *others), fronts = json.loads(done.stdout)
    assert all(place == first for place in others), (first, others)
    assert fronts == ["View", "Search", "Search", "Search", "View", "View", "View", "View"], (
        "the tab of before comes back"
    )
