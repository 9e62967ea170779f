"""Seeds, brush and eraser: what a click does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.imaging.labels import LABELS
from palpate.segmentation.prompts import SEED_NAMES
from palpate.ui.desktop.session.labels.label_operations import changed_label, values_at
from palpate.ui.desktop.session.labels.strokes import Drag, Stroke, erased_to, footprint, within_outline
from palpate.ui.desktop.session.open_case import OpenCase
from palpate.ui.desktop.session.session import Session
from palpate.ui.pictures.planes import Plane

Point = tuple[float, float, float]


class Editing:
    """Acts on the case that the session has open. Points are patient coordinates, mm, rest frame."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._drag: Drag | None = None
        self._from: FloatArray | None = None

    def reset(self) -> None:
        """Forgets a stroke that was begun."""
        self._drag = self._from = None

    def why_not(self) -> str:
        """Why labels cannot be corrected now; empty when they can."""
        case, jobs = self._session.case, self._session.jobs
        if case is None:
            return "open a case first"
        if self._session.reader.running and not case.volumes:
            return "the labels are being read"
        if not case.volumes:
            return "there are no labels yet; run Segment first"
        if jobs.running:
            return "a step runs on these labels; wait for it or cancel it"
        return ""

    def seed(self, state: str, name: str, point: Point) -> None:
        """Points at an organ in a scan; a second click on the same organ moves it. Raises InputError for an unknown name."""
        case = self._session.case
        if name not in SEED_NAMES or state not in ("rest", "deformed"):
            raise InputError(f"{name!r} is not one of {', '.join(SEED_NAMES)}")
        if case is None:
            raise InputError("seeds belong to a case; wait till it is made")
        case.seeds[state][name] = [float(x) for x in point]
        case.save_session()
        self._session.notify("labels")

    def forget_seeds(self) -> None:
        """Takes all seeds away."""
        case = self._session.case
        if case is not None:
            for seeds in case.seeds.values():
                seeds.clear()
            case.save_session()
            self._session.notify("labels")

    def begin(self, state: str, plane: Plane | None, point: Point, erase: bool = False) -> None:
        """Presses the brush, or the eraser, on a slice; plane None draws a ball. erase : the brush takes away.

        Raises InputError when it cannot draw.
        """
        shown, case = self._session.display, self._ready(state)
        erase = erase or shown.tool == "eraser"
        label = erased_to(shown.label) if erase else shown.label
        self._drag = Drag(case.corrections, state, label, shown.label if erase else None)
        self._from = None
        self.go_on(plane, point)

    def go_on(self, plane: Plane | None, point: Point) -> None:
        """Draws on to a point, along the straight line from the last one."""
        case, drag = self._session.case, self._drag
        if drag is None or case is None:
            return
        to = np.array(point, dtype=np.float64)
        start = to if self._from is None else self._from
        radius = self._session.display.radius_mm
        count = max(1, int(np.ceil(np.linalg.norm(to - start) / max(0.5 * radius, 0.25))))
        along = [start + (to - start) * share for share in np.linspace(0.0, 1.0, count + 1)[1:]]
        parts = [footprint(case.volumes[drag.state], p, radius, plane) for p in along]
        self._from = to
        if drag.add(self._within_threshold(drag.state, np.unique(np.concatenate(parts)))) is not None:
            self._session.notify("labels")

    def _within_threshold(self, state: str, index: IntArray) -> IntArray:
        """Those of flat voxel indices of the labels whose CT lies within the brush's threshold; all where there is none."""
        shown, labels, ct = self._session.display, self._session.labels(state), self._session.ct(state)
        if (shown.paint_low_hu is None and shown.paint_high_hu is None) or labels is None or ct is None:
            return index
        low = -np.inf if shown.paint_low_hu is None else shown.paint_low_hu
        high = np.inf if shown.paint_high_hu is None else shown.paint_high_hu
        hu = values_at(ct, labels, index)
        return index[(low <= hu) & (hu <= high)]

    def fill(self, state: str, plane: Plane, outline: Sequence[Point], erase: bool = False) -> None:
        """Gives the chosen label what lies within an outline on a slice, or takes it away; one undo takes it back. Raises InputError
        when it cannot draw."""
        case, label = self._ready(state), self._session.display.label
        index = self._within_threshold(state, within_outline(case.volumes[state], outline, plane))
        after, only = (erased_to(label), label) if erase else (label, None)
        self._made(case, case.corrections.paint(state, index, after, only))

    def _ready(self, state: str) -> OpenCase:
        """The case whose labels of a state can be corrected now."""
        reason, case = self.why_not(), self._session.case
        if reason or case is None:
            raise InputError(reason)
        if state not in case.volumes:
            raise InputError(f"the {state} scan has no labels yet; run Segment first")
        return case

    def _made(self, case: OpenCase, stroke: Stroke | None) -> None:
        """Makes a stroke and writes it into the journal."""
        if stroke is None:
            return
        case.corrections.make(stroke)
        if case.journal is not None:
            case.journal.stroke(stroke)
        self._session.notify("labels")

    def apply(self, state: str, operation: str, amount_mm: float = 0.0) -> None:
        """One of `label_operations.OPERATIONS` on the chosen label of a scan; one undo takes it back. Raises InputError when it
        cannot be done or changes nothing."""
        case, label = self._ready(state), self._session.display.label
        stroke = changed_label(case.volumes[state], state, label, operation, amount_mm)
        if stroke is None:
            raise InputError(f"that changes nothing of {LABELS[label].replace('_', ' ')} in the {state} scan")
        self._made(case, stroke)

    def end(self) -> None:
        """Releases the brush: the stroke can be undone, and is on disk."""
        case, drag = self._session.case, self._drag
        self.reset()
        stroke = drag.end() if drag is not None else None
        if stroke is not None and case is not None and case.journal is not None:
            case.journal.stroke(stroke)
            self._session.notify("labels")

    def undo(self) -> bool:
        """Takes the last stroke back; False when there is none or a step runs on the labels."""
        return self._act("undo")

    def redo(self) -> bool:
        """Makes the last stroke that was taken back again."""
        return self._act("redo")

    def _act(self, name: str) -> bool:
        case = self._session.case
        if case is None or case.journal is None or self.why_not():
            return False
        stroke = case.corrections.undo() if name == "undo" else case.corrections.redo()
        if stroke is None:
            return False
        case.journal.act(name)
        self._session.notify("labels")
        return True
