"""The window's side of the process that draws in 3D: sends what has changed, takes pictures when they come, never waits."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.files.atomic import atomic_path
from palpate.imaging.volume import Volume
from palpate.ui.desktop.solid.process_pipe import Pipe, Reply
from palpate.ui.pictures.offscreen import REMEDY


class SolidClient:
    """folder : where arrays are left for the process."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._folder.mkdir(parents=True, exist_ok=True)
        self._number, self._answered = 0, 0
        self._pipe = Pipe("palpate.ui.desktop.solid.renderer_process", folder / "solid.log")

    @property
    def failure(self) -> str:
        """Why there is no 3D, empty while there is."""
        return f"3D pictures cannot be drawn on this machine; try `{REMEDY}`" if self._pipe.over else ""

    @property
    def busy(self) -> bool:
        """Whether a view that was asked for has not come yet."""
        return not self.failure and self._answered < self._number

    def labels(self, state: str, volume: Volume) -> None:
        """New labels of one state."""
        path = self._folder / f"labels_{state}.npy"
        with atomic_path(path) as temporary:
            np.save(temporary, volume.array)
        self._pipe.say(type="labels", state=state, file=str(path), affine=volume.affine.tolist())

    def scan(self, file: Path, affine: FloatArray) -> None:
        """The scan whose slices are shown; its voxels lie in a file already."""
        self._pipe.say(type="scan", file=str(file), affine=affine.tolist())

    def points(self, table: FloatArray | None) -> None:
        """Misfit on the organ: (n, 7) x, y, z, residual, r, g, b; None takes it away."""
        path = self._folder / "points.npy"
        if table is not None:
            np.save(path, table)
        self._pipe.say(type="points", file=None if table is None else str(path))

    def view(self, **how: object) -> int:
        """Asks for a picture and returns its number; older ones that wait are not drawn."""
        self._number += 1
        self._pipe.say(type="view", id=self._number, **how)
        return self._number

    def latest(self) -> Reply | None:
        """The newest picture that has come since the last call; `id` in its head is the view's number."""
        came = self._pipe.replies()
        if not came:
            return None
        self._answered = came[-1].head["id"]
        return came[-1]

    def close(self) -> None:
        """Ends the process."""
        self._pipe.close()
