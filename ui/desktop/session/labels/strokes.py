"""Corrections of labels: brush, eraser, lasso and polygon, undo and redo. A stroke keeps what it changed, not copies of the volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from matplotlib.path import Path as Outline

from palpate.core.arrays import FloatArray, IntArray, LabelArray
from palpate.core.errors import InputError
from palpate.imaging.labels import LABELS, OUTSIDE, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.ui.pictures.planes import Plane


class StrokeData(TypedDict):
    """A stroke as JSON; see `Stroke`."""

    state: str
    after: int | list[int]
    index: list[int]
    before: list[int]


@dataclass(frozen=True, eq=False)
class Stroke:
    """state : "rest" or "deformed". index (n,) flat voxel indices (C order), before (n,) their labels, after : the new label, one of
    all or (n,)."""

    state: str
    index: IntArray
    before: LabelArray
    after: int | LabelArray

    def to_dict(self) -> StrokeData:
        """JSON-able form."""
        return {
            "state": self.state,
            "after": self.after if isinstance(self.after, int) else self.after.tolist(),
            "index": self.index.tolist(),
            "before": self.before.tolist(),
        }

    @classmethod
    def from_dict(cls, data: StrokeData) -> Stroke:
        """Raises KeyError, TypeError or ValueError when the data is no stroke."""
        index, before = np.array(data["index"], dtype=np.int64), np.array(data["before"], dtype=np.uint8)
        given = data["after"]
        after = np.array(given, dtype=np.uint8) if isinstance(given, list) else int(given)
        known = np.isin(after, list(LABELS)).all() and np.shape(after) in ((), index.shape)
        if index.shape != before.shape or not known or data["state"] not in ("rest", "deformed"):
            raise ValueError("no stroke")
        return cls(data["state"], index, before, after)


def footprint(volume: Volume, centre: FloatArray, radius_mm: float, plane: Plane | None) -> IntArray:
    """Flat indices of the voxels whose centres lie within a radius (mm) of a point: a disc in the plane's slice through the
    point, or a ball where there is no plane. The voxel that holds the point always belongs to it."""
    middle = volume.to_index(centre[None])[0]
    reach = np.ceil(radius_mm / volume.spacing).astype(int) + 1
    shape = np.array(volume.array.shape)
    low = np.clip(np.floor(middle).astype(int) - reach, 0, shape)
    high = np.clip(np.ceil(middle).astype(int) + reach + 1, 0, shape)
    grids = np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high, strict=True)), indexing="ij")
    index = np.stack([g.ravel() for g in grids], axis=1)
    away = volume.to_lps(index.astype(float)) - centre
    if plane is not None:
        away[:, plane.normal] = 0.0
        index, away = (part[index[:, plane.normal] == round(middle[plane.normal])] for part in (index, away))
    near = (np.linalg.norm(away, axis=1) <= radius_mm) | (index == np.rint(middle)).all(axis=1)
    return np.ravel_multi_index(tuple(index[near].T), volume.array.shape)


def erased_to(label: int) -> int:
    """What an eraser leaves of a label: tissue where an organ was, nothing where tissue was."""
    return OUTSIDE if label == SURROUNDING_TISSUE else SURROUNDING_TISSUE


class Corrections:
    """The strokes made on the label volumes of a case. volumes : state -> Volume whose arrays are changed in place."""

    def __init__(self, volumes: dict[str, Volume]) -> None:
        self.volumes = volumes
        self._done: list[Stroke] = []
        self._undone: list[Stroke] = []
        self._saved: Stroke | None = None

    @property
    def can_undo(self) -> bool:
        """Whether there is a stroke to take back."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether there is a stroke to make again."""
        return bool(self._undone)

    @property
    def unsaved(self) -> bool:
        """Whether the labels differ from those that were saved, by the strokes made since."""
        return self._last is not self._saved

    def saved(self) -> None:
        """The labels as they are now have been saved."""
        self._saved = self._last

    def paint(self, state: str, index: IntArray, label: int, only: int | None = None) -> Stroke | None:
        """The stroke that gives voxels a label; only those of the label ``only`` where that is given. Nothing is changed yet.

        None where nothing would change. Raises InputError when the state has no labels to correct.
        """
        if state not in self.volumes:
            raise InputError(f"the {state} scan has no labels yet; run Segment first")
        index = np.unique(index)
        before = self._flat(state)[index]
        changes = (before != label) if only is None else (before == only) & (before != label)
        return Stroke(state, index[changes], before[changes].copy(), label) if changes.any() else None

    def make(self, stroke: Stroke, touch: bool = True) -> None:
        """Makes a stroke and remembers it. touch : False where the voxels hold it already."""
        if touch:
            self._flat(stroke.state)[stroke.index] = stroke.after
        self._done.append(stroke)
        self._undone.clear()

    def undo(self, touch: bool = True) -> Stroke | None:
        """Takes the last stroke back and returns it."""
        if not self._done:
            return None
        stroke = self._done.pop()
        if touch:
            self._flat(stroke.state)[stroke.index] = stroke.before
        self._undone.append(stroke)
        return stroke

    def redo(self, touch: bool = True) -> Stroke | None:
        """Makes the stroke that was taken back last again."""
        if not self._undone:
            return None
        stroke, rest = self._undone[-1], self._undone[:-1]
        self.make(stroke, touch)
        self._undone = rest
        return stroke

    @property
    def _last(self) -> Stroke | None:
        return self._done[-1] if self._done else None

    def _flat(self, state: str) -> LabelArray:
        return self.volumes[state].array.reshape(-1)


class Drag:
    """What is drawn between pressing and releasing the button becomes one stroke: one undo takes it back."""

    def __init__(self, corrections: Corrections, state: str, label: int, only: int | None = None) -> None:
        self._corrections, self.state, self._label, self._only = corrections, state, label, only
        self._parts: list[Stroke] = []

    def add(self, index: IntArray) -> Stroke | None:
        """Changes further voxels at once; None where nothing changes."""
        part = self._corrections.paint(self.state, index, self._label, self._only)
        if part is not None:
            self._corrections.volumes[self.state].array.reshape(-1)[part.index] = part.after
            self._parts.append(part)
        return part

    def end(self) -> Stroke | None:
        """The whole stroke, remembered for undo; None where nothing has changed."""
        if not self._parts:
            return None
        # No voxel is changed twice within a drag: it has the label after the first time.
        index = np.concatenate([part.index for part in self._parts])
        before = np.concatenate([part.before for part in self._parts])
        whole = Stroke(self.state, index, before, self._label)
        self._corrections.make(whole, touch=False)
        return whole


def within_outline(volume: Volume, points: Sequence[tuple[float, float, float]], plane: Plane) -> IntArray:
    """Flat indices of the voxels of the slice through the points (mm) whose centres lie within their closed outline."""
    drawn = np.array(points, dtype=np.float64)
    index = volume.to_index(drawn)
    shape = np.array(volume.array.shape)
    low = np.clip(np.floor(index.min(axis=0)).astype(int) - 1, 0, shape)
    high = np.clip(np.ceil(index.max(axis=0)).astype(int) + 2, 0, shape)
    grids = np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high, strict=True)), indexing="ij")
    voxels = np.stack([g.ravel() for g in grids], axis=1)
    centres = volume.to_lps(voxels.astype(float))
    # The slice that is shown: voxels whose centres lie within half a voxel of it.
    reach = 0.5 * float(np.abs(volume.affine[plane.normal, :3]).max())
    away = centres[:, plane.normal] - drawn[0, plane.normal]
    flat = [plane.across, plane.down]
    inside = (away >= -reach) & (away < reach)
    inside[inside] = Outline(drawn[:, flat]).contains_points(centres[inside][:, flat])
    return np.ravel_multi_index(tuple(voxels[inside].T), volume.array.shape)
