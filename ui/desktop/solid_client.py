"""The window's side of the process that draws in 3D: sends what has changed, takes pictures when they come, never waits."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.worker.executors import ONE_THREAD
from palpate.segmentation.volume import Volume
from palpate.ui.cli.arguments import cores
from palpate.ui.pictures.offscreen import REMEDY


@dataclass(frozen=True, eq=False)
class Picture:
    """pixels (height, width, 3) of the view with this number."""

    number: int
    pixels: NDArray[np.uint8]


class SolidClient:
    """folder : where arrays are left for the process. failure : why there is no 3D, empty while there is."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._folder.mkdir(parents=True, exist_ok=True)
        self._pictures: queue.Queue[Picture | None] = queue.Queue()
        self._lines: queue.Queue[bytes | None] = queue.Queue()
        self._number, self._answered = 0, 0
        self.failure = ""
        self._log = (folder / "solid.log").open("wb")
        self._child = subprocess.Popen(
            [sys.executable, "-P", "-m", "palpate.ui.desktop.solid_child"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, env=_environment(),
        )  # fmt: skip
        for work in (self._send, self._receive):
            threading.Thread(target=work, daemon=True).start()

    @property
    def busy(self) -> bool:
        """Whether a view that was asked for has not come yet."""
        return not self.failure and self._answered < self._number

    def labels(self, state: str, volume: Volume) -> None:
        """New labels of one state."""
        path = self._folder / f"labels_{state}.npy"
        temporary = path.with_suffix(".part.npy")
        np.save(temporary, volume.array)
        temporary.replace(path)
        self._say({"type": "labels", "state": state, "file": str(path), "affine": volume.affine.tolist()})

    def scan(self, file: Path, affine: NDArray[np.float64]) -> None:
        """The scan whose slices are shown; its voxels lie in a file already."""
        self._say({"type": "scan", "file": str(file), "affine": affine.tolist()})

    def points(self, table: NDArray[np.float64] | None) -> None:
        """Misfit on the organ: (n, 7) x, y, z, residual, r, g, b; None takes it away."""
        path = self._folder / "points.npy"
        if table is not None:
            np.save(path, table)
        self._say({"type": "points", "file": None if table is None else str(path)})

    def view(self, **how: Any) -> int:
        """Asks for a picture and returns its number; older ones that wait are not drawn."""
        self._number += 1
        self._say({"type": "view", "id": self._number, **how})
        return self._number

    def latest(self) -> Picture | None:
        """The newest picture that has come since the last call."""
        newest = None
        with contextlib.suppress(queue.Empty):
            while True:
                came = self._pictures.get_nowait()
                if came is None:
                    self.failure = f"3D pictures cannot be drawn on this machine; try `{REMEDY}`"
                else:
                    newest, self._answered = came, came.number
        return newest

    def close(self) -> None:
        """Ends the process."""
        self._lines.put(None)
        self._child.kill()
        self._child.wait()
        self._log.close()

    def _say(self, message: dict[str, Any]) -> None:
        self._lines.put(json.dumps(message).encode() + b"\n")

    def _send(self) -> None:
        pipe: IO[bytes] | None = self._child.stdin
        assert pipe is not None
        with contextlib.suppress(OSError):  # the process has ended
            while (line := self._lines.get()) is not None:
                pipe.write(line)
                pipe.flush()

    def _receive(self) -> None:
        pipe: IO[bytes] | None = self._child.stdout
        assert pipe is not None
        with contextlib.suppress(OSError, ValueError):
            while head := pipe.readline():
                facts = json.loads(head)
                size = facts["width"] * facts["height"] * 3
                data = pipe.read(size)
                if len(data) < size:
                    break
                pixels = np.frombuffer(data, dtype=np.uint8).reshape(facts["height"], facts["width"], 3)
                self._pictures.put(Picture(facts["id"], pixels))
        self._pictures.put(None)


def _environment() -> dict[str, str]:
    # Without a graphics card Mesa draws with threads that wait for each other, which takes for ever while a step uses all cores.
    threads = cores() // 2 if cores() > 2 else 0
    return {"LP_NUM_THREADS": str(threads), **os.environ, **ONE_THREAD}
