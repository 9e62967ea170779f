"""The real window on a real X display: a person's afternoon with it, kill included. Screenshots stay in pytest's folder."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from desktop_pair import write_pair
from PIL import Image
from x_display import needs_xvfb, x_display

from palpate.case.case_folder import CaseFolder
from palpate.simulate.phantom import phantom
from palpate.ui.cli.signals import descendants

X, Y, Z = (float(c) for c in phantom.prostate_centroid())

pytestmark = [needs_xvfb, pytest.mark.nightly]


# A laptop's screen at 150 %, and a large one.
LAPTOP, LARGE = "1280x720", "3840x2160"


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Folders of the scans at rest and deformed."""
    return write_pair(tmp_path_factory.mktemp("scans"))


@contextmanager
def screen(folder: Path, size: str) -> Iterator[None]:
    """A display of a size, and settings of the window's own under a folder."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("PALPATE_SETTINGS", str(folder / "settings"))
        with x_display(folder, size, monkeypatch):
            yield


def window(folder: Path, script: str, name: str) -> subprocess.Popen[str]:
    path = folder / name
    path.write_text(script)
    return subprocess.Popen([sys.executable, "-m", "palpate.ui.cli", "open", "--script", str(path), "--json"],
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip


def events_of(process: subprocess.Popen[str]) -> list[dict[str, Any]]:
    out, err = process.communicate(timeout=1800)
    if "no window can be opened" in out:
        pytest.skip("Qt's X11 libraries are not on this machine: " + json.loads(out)["error"])
    assert process.returncode == 0, out[-800:] + err[-2000:]
    events: list[dict[str, Any]] = json.loads(out)["events"]
    return events


def _runs(process: int) -> bool:
    """Whether a process is there and not only its remains, which wait for their parent."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def started(rest: Path, deformed: Path, case: Path) -> str:
    """Opens both scans, points, and cancels a step."""
    return f"""
    open {rest} {deformed} {case}
    resize 1400 900
    pause 0.2
    show tool seed
    crosshair {X} {Y} {Z}
    click axial {X} {Y} {Z}
    click coronal {X + 1} {Y} {Z}
    expect seeds 1
    screenshot shots/1_seed.png
    press Segment
    until 0.02 180
    pause 0.3
    stalls
    press Cancel
    wait 60
    expect job cancelled
    screenshot shots/2_cancelled.png
    """


SEGMENTED = """
    press Segment
    wait 1500
    expect job done
    stalls
    """

# Corrects, saves, corrects again, and closes.
CORRECTED = f"""
    screenshot shots/3_segmented.png
    show tool brush
    show radius_mm 5
    drag axial {X + 18} {Y} {Z} {X + 24} {Y + 6} {Z}
    expect unsaved true
    screenshot shots/4_brush.png
    undo
    expect unsaved false
    drag axial {X} {Y + 20} {Z} {X + 8} {Y + 20} {Z}
    save
    expect unsaved false
    drag axial {X - 18} {Y} {Z} {X - 24} {Y} {Z}
    expect unsaved true
    """


def taken_back(case: Path) -> str:
    """Opens a case that was corrected and closed, and takes all of it back: the labels are those that were segmented."""
    return f"""
    open {case}
    resize 1400 900
    pause 0.2
    crosshair {X} {Y} {Z}
    expect unsaved true
    undo
    expect unsaved false
    undo
    expect unsaved true
    save
    expect unsaved false
    """


def second(case: Path) -> str:
    """Takes back and makes again what was not saved, corrects more, and stays open."""
    return f"""
    open {case}
    expect unsaved true
    undo
    expect unsaved false
    redo
    show tool brush
    show label 5
    drag axial {X} {Y - 25} {Z} {X + 5} {Y - 25} {Z}
    screenshot shots/5_before_kill.png
    pause 300
    """


def third(case: Path) -> str:
    """Saves what is back, looks at both scans, and takes it back."""
    return f"""
    open {case}
    expect unsaved true
    crosshair {X} {Y} {Z}
    screenshot shots/6_reopened.png
    save
    expect unsaved false
    press Both
    press Blend
    screenshot shots/7_blend.png
    undo
    undo
    undo
    expect unsaved true
    """


def kill_when_there(process: subprocess.Popen[str], shot: Path) -> None:
    """Kills a window once it has written a picture; nothing that it started may outlive it."""
    end = time.monotonic() + 120
    while not shot.exists() and process.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.1)
    children = descendants(process.pid)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.communicate()
    assert children
    end = time.monotonic() + 5.0
    while any(map(_runs, children)):
        assert time.monotonic() < end, "a process outlived the window"
        time.sleep(0.02)


def cancelled_in_time(events: list[dict[str, Any]]) -> None:
    """A step ran, was cancelled, and ended within a second."""
    assert any(e["command"] == "press" and e["job"] == "running" and e["line"] > 14 for e in events)
    seconds = next(e["cancel_seconds"] for e in events if e["job"] == "cancelled")
    assert seconds <= 1.0
    print("longest stalls, ms:", [e["longest_stall_ms"] for e in events if "longest_stall_ms" in e], "cancel:", seconds)


def killed_and_reopened(folder: Path, case: Path) -> None:
    """The first window was closed with unsaved corrections; the second is killed with more of them; the third has them all."""
    labels = CaseFolder(case).labels("rest")
    kill_when_there(window(folder, second(case), "second.txt"), folder / "shots" / "5_before_kill.png")
    assert np.array_equal(CaseFolder(case).labels("rest").array, labels.array)

    last = events_of(window(folder, third(case), "third.txt"))
    saved = CaseFolder(case).labels("rest")
    new = (saved.array != labels.array).sum()
    assert new > 50 and last[-1]["unsaved"]
    shots = sorted((folder / "shots").iterdir())
    assert len(shots) == 7
    for path in shots:
        assert np.asarray(Image.open(path).convert("L")).std() > 20, f"{path} is blank"


@pytest.fixture(scope="module")
def closed(scans: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the case that a window on the laptop's screen segmented, corrected and closed, and that case's copy."""
    folder = tmp_path_factory.mktemp("laptop")
    with screen(folder, LAPTOP):
        script = started(*scans, folder / "case") + SEGMENTED + CORRECTED
        events = events_of(window(folder, script, "first.txt"))
    cancelled_in_time(events)
    shutil.copytree(folder / "case", folder / "copy")
    return folder


def test_an_afternoon_with_the_window(closed: Path) -> None:
    with screen(closed, LAPTOP):
        killed_and_reopened(closed, closed / "case")


def test_the_same_on_a_large_screen(scans: tuple[Path, Path], closed: Path, tmp_path: Path) -> None:
    """All that depends on the screen. Segment is cancelled; corrected is a copy of what it made on the other screen."""
    case = tmp_path / "case"
    shutil.copytree(closed / "copy", case)
    with screen(tmp_path, LARGE):
        cancelled_in_time(events_of(window(tmp_path, started(*scans, tmp_path / "other"), "first.txt")))
        events_of(window(tmp_path, taken_back(case) + CORRECTED, "corrected.txt"))
        killed_and_reopened(tmp_path, case)
