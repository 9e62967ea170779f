"""Corrections on disk: every stroke, undo and redo is written at once, so that a kill loses none and undo outlives the window.

`desktop/edits.jsonl` of the case, one JSON object on a line: {"stroke": ...}, {"act": "undo" or "redo"}, and
{"labels": {state: hash}} wherever the labels were, or were about to be, saved as they then were. What a process has
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
from typing import Any

from palpate.segmentation.volume import Volume
from palpate.ui.desktop.strokes import Corrections, Stroke


class Journal:
    """path : the file. flusher : where the flushing is done."""

    def __init__(self, path: Path, flusher: Executor) -> None:
        self._path, self._flusher = path, flusher
        path.parent.mkdir(parents=True, exist_ok=True)
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        size = os.fstat(self._descriptor).st_size
        if size and os.pread(self._descriptor, 1, size - 1) != b"\n":
            os.write(self._descriptor, b"\n")  # a last line that a kill cut in two ends here and is passed over

    def stroke(self, stroke: Stroke) -> None:
        """Notes a stroke."""
        self._write({"stroke": stroke.to_dict()})

    def act(self, name: str) -> None:
        """Notes an undo or a redo."""
        self._write({"act": name})

    def mark(self, volumes: Mapping[str, Volume]) -> None:
        """Notes the labels as they are and as they are about to be saved."""
        self._write({"labels": content_hashes(volumes)})

    def start_over(self, volumes: Mapping[str, Volume]) -> None:
        """Forgets everything: these are other labels. What was there is kept beside, for a person to look for."""
        if os.fstat(self._descriptor).st_size:
            kept = self._path.with_name("edits_of_earlier_labels.jsonl")
            kept.write_bytes(self._path.read_bytes())
        os.ftruncate(self._descriptor, 0)
        self.mark(volumes)

    def close(self) -> None:
        """Leaves the file as it is."""
        os.close(self._descriptor)

    def _write(self, line: Any) -> None:
        os.write(self._descriptor, json.dumps(line, separators=(",", ":")).encode() + b"\n")
        self._flusher.submit(_flush, self._path)


def content_hashes(volumes: Mapping[str, Volume]) -> dict[str, str]:
    """A hash of each label volume's voxels, by state."""
    return {state: hashlib.sha256(volume.array.tobytes()).hexdigest() for state, volume in sorted(volumes.items())}


def replay(path: Path, corrections: Corrections) -> int | None:
    """Brings labels that have just been read, and their undo, to where they were. Returns the number of acts since they
    were saved; None when there is no journal or it belongs to other labels, whose strokes would be nonsense on these."""
    if not path.is_file():
        return None
    lines = [line for line in map(_parsed, path.read_text(encoding="utf-8").splitlines()) if line]
    current = content_hashes(corrections.volumes)
    saved_at = max((n for n, line in enumerate(lines) if line.get("labels") == current), default=None)
    if saved_at is None:
        return None
    for line in lines[:saved_at]:
        _again(line, corrections, touch=False)
    corrections.saved()
    return sum(_again(line, corrections, touch=True) for line in lines[saved_at + 1 :])


def _again(line: Mapping[str, Any], corrections: Corrections, touch: bool) -> bool:
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


def _parsed(line: str) -> Mapping[str, Any]:
    with contextlib.suppress(ValueError):
        data = json.loads(line)
        return data if isinstance(data, dict) else {}
    return {}


def _flush(path: Path) -> None:
    with contextlib.suppress(OSError):  # the case was moved meanwhile
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
