"""Corrections on disk: every stroke, undo and redo is written at once, so that a kill loses none and undo outlives the window.

`desktop/edits.jsonl` of the case, one JSON object on a line: {"stroke": ...}, {"act": "undo" or "redo"}, and
{"labels": {state: hash}, "acts": n} wherever the labels were, or were about to be, saved as they were after n acts. What a process has
written survives its being killed; against a power failure the file is also flushed, in another thread.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import TypedDict

import numpy as np

from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.labels.strokes import Corrections, Stroke, StrokeData


class Line(TypedDict, total=False):
    """One line: a stroke; an undo or redo; or hashes of the labels by state, and how many acts they hold."""

    stroke: StrokeData
    act: str
    labels: dict[str, str]
    acts: int


class Journal:
    """path : the file. flusher : where the flushing is done."""

    def __init__(self, path: Path, flusher: Executor) -> None:
        self._path, self._flusher = path, flusher
        path.parent.mkdir(parents=True, exist_ok=True)
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        size = os.fstat(self._descriptor).st_size
        if size and os.pread(self._descriptor, 1, size - 1) != b"\n":
            os.write(self._descriptor, b"\n")  # a last line that a kill cut in two ends here and is passed over
        self.acts = sum(_is_act(line) for line in _lines(path))

    def stroke(self, stroke: Stroke) -> None:
        """Notes a stroke."""
        self.acts += 1
        self._write({"stroke": stroke.to_dict()})

    def act(self, name: str) -> None:
        """Notes an undo or a redo."""
        self.acts += 1
        self._write({"act": name})

    def mark(self, hashes: Mapping[str, str], acts: int) -> None:
        """Notes that labels with these hashes, as they were after so many acts, are about to be saved."""
        self._write({"labels": dict(hashes), "acts": acts})

    def start_over(self, hashes: Mapping[str, str]) -> None:
        """Forgets everything: these are other labels. What was there is kept beside, for a person to look for."""
        if os.fstat(self._descriptor).st_size:
            kept = self._path.with_name("edits_of_earlier_labels.jsonl")
            kept.write_bytes(self._path.read_bytes())
        os.ftruncate(self._descriptor, 0)
        self.acts = 0
        self.mark(hashes, 0)

    def close(self) -> None:
        """Leaves the file as it is."""
        os.close(self._descriptor)

    def _write(self, line: Line) -> None:
        os.write(self._descriptor, json.dumps(line, separators=(",", ":")).encode() + b"\n")
        self._flusher.submit(_flush, self._path)


def content_hash(volume: Volume) -> str:
    """A hash of a label volume's voxels."""
    return hashlib.sha256(np.ascontiguousarray(volume.array).data).hexdigest()


def replay(path: Path, corrections: Corrections, hashes: Mapping[str, str]) -> bool:
    """Brings labels that have just been read, with these hashes, and their undo to where they were. False when there is no
    journal or it belongs to other labels, whose strokes would be nonsense on these."""
    lines = _lines(path)
    acts = [line for line in lines if _is_act(line)]
    saved_at = [line.get("acts") for line in lines if line.get("labels") == dict(hashes)]
    if not saved_at or not isinstance(saved_at[-1], int):
        return False
    for line in acts[: saved_at[-1]]:
        _again(line, corrections, touch=False)
    corrections.saved()
    for line in acts[saved_at[-1] :]:
        _again(line, corrections, touch=True)
    return True


def _lines(path: Path) -> list[Line]:
    if not path.is_file():
        return []
    return [line for line in map(_parsed, path.read_text(encoding="utf-8").splitlines()) if line]


def _is_act(line: Line) -> bool:
    return "stroke" in line or line.get("act") in ("undo", "redo")


def _again(line: Line, corrections: Corrections, touch: bool) -> bool:
    if line.get("act") == "undo":
        return corrections.undo(touch) is not None
    if line.get("act") == "redo":
        return corrections.redo(touch) is not None
    with contextlib.suppress(KeyError, TypeError, ValueError):
        stroke = Stroke.from_dict(line["stroke"])
        size = corrections.volumes[stroke.state].array.size
        if stroke.index.size and 0 <= stroke.index.min() <= stroke.index.max() < size:
            corrections.make(stroke, touch)
            return True
    return False


def _parsed(line: str) -> Line:
    with contextlib.suppress(ValueError):
        data: Line = json.loads(line)
        return data if isinstance(data, dict) else {}
    return {}


def _flush(path: Path) -> None:
    with contextlib.suppress(OSError):  # the case was moved meanwhile
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
