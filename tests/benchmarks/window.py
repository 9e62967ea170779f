"""How long the window takes to show two scans of 512 x 512 x 150, to scroll, and to answer while a case is identified.

    .venv/bin/python tests/benchmarks/window.py            # opening and scrolling
    .venv/bin/python tests/benchmarks/window.py CASE       # and the stalls while CASE (meshed, as the demo leaves it) is identified

Prints one JSON object. Without a screen; set QT_QPA_PLATFORM to use one. Let nothing else run meanwhile.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from scipy import ndimage

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from palpate.imaging.dicom.series import read_series
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume
from palpate.ui.cli.signals import descendants
from palpate.ui.desktop.window import application

TOP = Path(__file__).parents[2]
SHAPE = (512, 512, 150)
_SECONDS = 300.0


def write_large_pair(folder: Path) -> None:
    """The sample pair's scans, magnified in memory to the size of a hospital's."""
    for number, state in enumerate(("rest", "deformed"), start=1):
        scan, _ = read_series(TOP / "sample_dicom" / state)
        factors = np.array(SHAPE) / scan.array.shape
        large = ndimage.zoom(scan.array, factors, order=1).astype(np.int16)
        affine = scan.affine @ np.diag([*(1.0 / factors), 1.0])
        who = SeriesIdentity(
            "large", "Large^Scan", "1.2.3", f"1.2.3.{number}", f"1.2.3.9{number}", number, "study", "CT", "made"
        )
        write_ct_series(folder / state, Volume(large, affine), who, compress=False)


class Memory(threading.Thread):
    """peak_mb : most that this process and its children held at once, shared pages counted once."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.peak_mb = 0.0
        self.start()

    def run(self) -> None:
        while True:
            self.peak_mb = max(self.peak_mb, sum(_held_mb(p) for p in (os.getpid(), *descendants(os.getpid()))))
            time.sleep(0.25)


def _held_mb(process: int) -> float:
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024.0 for line in lines if line.startswith("Pss:")), 0.0)


def opening(window: Any, handle: Callable[[], None], folder: Path) -> dict[str, Any]:
    """Seconds till both scans are shown, and milliseconds a slice while scrolling."""
    memory, began = Memory(), time.perf_counter()
    window.controller.open_pair(folder / "rest", folder / "deformed", folder / "case")
    window.stack.setCurrentIndex(1)
    window.responsiveness.reset()
    _until(lambda: len(window.controller.scans) == 2, handle)
    handle()
    told: dict[str, Any] = {"shown_seconds": time.perf_counter() - began, "stall_ms": window.responsiveness.longest_ms}
    _until(lambda: window.controller.case is not None, handle)
    told |= {"case_seconds": time.perf_counter() - began, "peak_mb": memory.peak_mb}
    for mode in ("rest", "side by side", "blend"):
        window.controller.show(mode=mode)
        handle()
        each = []
        for view in list(window.views.visible_slices())[:3]:
            for _ in range(10):
                start = time.perf_counter()
                view.scroll_slices(1)
                handle()
                each.append(1000.0 * (time.perf_counter() - start))
        told[f"scroll_ms, {mode}"] = {"median": median(each), "longest": max(each)}
    return told


def identifying(window: Any, handle: Callable[[], None], case: Path, folder: Path) -> dict[str, Any]:
    """Longest time without an answer while a copy of a case is identified and looked at, and seconds from cancel to no process left."""
    copy = folder / "identified"
    shutil.copytree(case, copy)
    state = json.loads((copy / "state.json").read_text())
    state.pop("identify", None)
    (copy / "state.json").write_text(json.dumps(state))
    window.controller.open_case(copy)
    _until(lambda: window.controller.case is not None and not window.controller.reader.running, handle)
    window.controller.run("identify")
    _for(8.0, handle)
    window.responsiveness.reset()
    x, y, z = window.controller.case.display.crosshair
    for k in range(12):
        window.controller.show(
            crosshair=(x + k % 4, y - k % 3, z + k % 5), mode=("side by side", "blend", "rest")[k // 4]
        )
        _for(1.5, handle)
    longest, own = window.responsiveness.longest_ms, window.responsiveness.longest_own_ms
    window.controller.cancel()
    _until(lambda: not window.controller.jobs.running, handle)
    return {"stall_ms": longest, "own_ms": own, "cancel_seconds": window.controller.jobs.state.cancel_seconds}


def _until(done: Callable[[], bool], handle: Callable[[], None]) -> None:
    end = time.monotonic() + _SECONDS
    while not done():
        if time.monotonic() > end:
            raise SystemExit("window.py: it did not come to its end")
        handle()
        time.sleep(0.002)


def _for(seconds: float, handle: Callable[[], None]) -> None:
    end = time.monotonic() + seconds
    _until(lambda: time.monotonic() > end, handle)


def main(arguments: list[str]) -> None:
    """Measures and prints."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["PALPATE_SETTINGS"] = str(folder / "settings")
        write_large_pair(folder)
        window, application_ = application.new_window(True)
        window.show()
        told: dict[str, Any] = {"opening": opening(window, application_.processEvents, folder)}
        if arguments:
            told["identifying"] = identifying(window, application_.processEvents, Path(arguments[0]), folder)
        window.shut()
    print(json.dumps(told, indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
