"""The window on a small and on a large screen: nothing that a person needs is off it, and the picture grows with the window."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from phantoms import write_case
from PIL import Image
from x_display import needs_xvfb, x_display

pytestmark = needs_xvfb

# Opens a case on the display, and tells where every step, Cancel and the results are.
LOOK = """
import json, sys
from pathlib import Path
from palpate.ui.desktop.qt_application import events_for
from palpate.ui.desktop.scripting.commands_script import Driver
from palpate.ui.desktop.window.application import new_window
window, application = new_window(False)
window.show()
process = events_for(application)
driver = Driver(window, process, Path(sys.argv[2]), "test")
driver.do_open(sys.argv[1])
driver.do_show("overlay", "stiffness")
screen = application.primaryScreen().availableGeometry()
parts = {name: window.steps.button(name) for name in ("import", "segment", "mesh", "identify", "diagnose", "report")}
parts |= {"cancel": window.job.stop, "results": window.results.words, "look": window.tabs.tabBar()}
def places():
    return {name: [*part.mapToGlobal(part.rect().topLeft()).toTuple(), *part.mapToGlobal(part.rect().bottomRight()).toTuple()]
            for name, part in parts.items()}
def half(view):
    return view.viewport.mm_per_pixel * min(view.width(), view.height())
first, seen = places(), half(next(window.views.visible_slices()))
shot = driver.do_screenshot("first.png")["file"]
window.showMaximized(); window.resize(screen.width(), screen.height()); process(0.3)
told = {"screen": [screen.width(), screen.height()], "first": first, "whole": places(), "shots": [shot],
        "seen_mm": [seen, half(next(window.views.visible_slices()))]}
told["shots"].append(driver.do_screenshot("whole.png")["file"])
window.hide(); window.shut()
print(json.dumps(told))
"""


@pytest.mark.parametrize("size", ["1280x720", pytest.param("3840x2160", marks=pytest.mark.nightly)])
def test_everything_is_on_the_screen(size: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))
    case = write_case(tmp_path / "case", ct=True)
    with x_display(tmp_path, size, monkeypatch):
        done = subprocess.run([sys.executable, "-c", LOOK, str(case.path), str(tmp_path)], capture_output=True, text=True,
                              timeout=240, check=False)  # fmt: skip
    if "no window can be opened" in done.stderr:
        pytest.skip("Qt's X11 libraries are not on this machine")
    assert done.returncode == 0, done.stderr[-2000:]
    told = json.loads(done.stdout.splitlines()[-1])
    width, height = told["screen"]
    assert [width, height] == [int(n) for n in size.split("x")]
    for when in ("first", "whole"):
        for name, (left, top, right, bottom) in told[when].items():
            assert 0 <= left < right <= width and 0 <= top < bottom <= height, f"{name} is off the screen: {when}"
    small, large = told["seen_mm"]
    assert small == pytest.approx(large, rel=0.15), "a larger window shows the same, larger"
    for path in told["shots"]:
        assert np.asarray(Image.open(path).convert("L")).std() > 20
