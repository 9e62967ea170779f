"""The commands of a script that point at organs and correct labels, without the mouse."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.case.case_folder import STATES
from palpate.imaging.labels import LABEL_VALUES
from palpate.ui.desktop.session.controller import Controller


class Correcting:
    """Acts on what a controller has open; points are patient coordinates, mm LPS."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller

    def shown(self) -> str:
        """The scan that a person would point at: the one shown, the one at rest where both are."""
        return "deformed" if self.controller.display.mode == "deformed" else "rest"

    def do_seed(self, name: str, x: str, y: str, z: str, state: str = "") -> None:
        """Points at an organ."""
        self.controller.editing.seed(state or self.shown(), name, (float(x), float(y), float(z)))

    def do_brush(self, label: str, radius: str, *rest: str) -> None:
        """One stroke with the brush."""
        self._stroke("brush", label, radius, rest)

    def do_eraser(self, label: str, radius: str, *rest: str) -> None:
        """One stroke with the eraser."""
        self._stroke("eraser", label, radius, rest)

    def do_undo(self) -> None:
        """Takes the last stroke back."""
        self.controller.editing.undo()

    def do_redo(self) -> None:
        """Makes it again."""
        self.controller.editing.redo()

    def do_save(self) -> None:
        """Writes the labels, and waits till they are written."""
        self.controller.save()
        if self.controller.case is not None:
            self.controller.case.flush()

    def _stroke(self, tool: str, label: str, radius: str, rest: Sequence[str]) -> None:
        state = rest[-1] if rest and rest[-1] in STATES else self.shown()
        numbers = [float(word) for word in (rest[:-1] if rest and rest[-1] in STATES else rest)]
        if not numbers or len(numbers) % 3:
            raise ValueError("points are X Y Z")
        points = [(numbers[n], numbers[n + 1], numbers[n + 2]) for n in range(0, len(numbers), 3)]
        value = LABEL_VALUES[label] if label in LABEL_VALUES else int(label)
        self.controller.show(tool=tool, label=value, radius_mm=float(radius))
        self.controller.editing.begin(state, None, points[0])
        for point in points[1:]:
            self.controller.editing.go_on(None, point)
        self.controller.editing.end()
