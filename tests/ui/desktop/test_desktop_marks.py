"""What is written on a slice view keeps apart, however narrow the view is, and letters are never covered."""

from __future__ import annotations

from itertools import combinations
from unittest.mock import MagicMock

import numpy as np
import pytest
from PySide6.QtCore import QRectF, QSize, Qt

from palpate.case.measured.measurements import Measurement, angle_degrees
from palpate.ui.desktop.session.display import Display
from palpate.ui.desktop.slices import shape_marks, slice_marks
from palpate.ui.desktop.slices.slice_viewport import Screen, Viewport
from palpate.ui.pictures.planes import PLANES, Plane

WIDE = 7.2  # pixels of a letter of DejaVu Sans at 8 points, the widest but W and M


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, QRectF]]:
    """Words and the rectangle of their ink, in the order of writing."""
    found: list[tuple[str, QRectF]] = []

    def note(painter: object, where: QRectF, words: str, flags: Qt.AlignmentFlag, colour: str = "") -> None:
        wide, high = WIDE * len(words), 12.0
        if flags & Qt.TextFlag.TextWordWrap and wide > where.width():
            wide, high = where.width(), min(40.0, where.height())
        x, y = where.left(), where.top()
        if flags & Qt.AlignmentFlag.AlignRight:
            x = where.right() - wide
        if flags & Qt.AlignmentFlag.AlignHCenter:
            x = where.center().x() - wide / 2.0
        if flags & Qt.AlignmentFlag.AlignBottom:
            y = where.bottom() - high
        if flags & Qt.AlignmentFlag.AlignVCenter:
            y = where.center().y() - high / 2.0
        if words:
            found.append((words, QRectF(x, y, wide, high)))

    monkeypatch.setattr(slice_marks, "text", note)
    monkeypatch.setattr(slice_marks, "wide", lambda painter, words: WIDE * len(words))
    monkeypatch.setattr(slice_marks, "QFont", MagicMock())
    return found


@pytest.mark.parametrize("plane", PLANES, ids=lambda p: p.name)
@pytest.mark.parametrize("width", [88, 95, 107, 140, 200, 235, 300, 500])
def test_letters_titles_window_and_scale_bar_keep_apart(
    written: list[tuple[str, QRectF]], plane: Plane, width: int
) -> None:
    screen = Screen(plane, Viewport(np.zeros(3), 0.7), QSize(width, 220))
    painter = MagicMock()
    slice_marks.letters(painter, screen)
    brush = shape_marks.tool_words(painter, screen, Display(tool="brush", label=6))
    slice_marks.captions(
        painter, screen, plane.name.capitalize(), "deformed", (brush, "z = -140.0 mm", "map is shown at rest only")
    )
    slice_marks.window_words(painter, screen, 40.0, 400.0)
    slice_marks.scale_bar(painter, screen)
    bar = painter.drawLine.call_args[0]
    written.append(("bar", QRectF(bar[0], bar[1]).adjusted(0, -2, 0, 2)))
    for (first, a), (second, b) in combinations(written, 2):
        assert not a.intersects(b), f"{first!r} covers {second!r}"
    words = " ".join(w for w, _ in written)
    assert "Brush" in words and ((width < 300) or "Brush: rectum" in words)
    assert "deformed" in words and "mm" in words and plane.name[:2].capitalize() in words
    assert (width < 235) or "W 400 L 40" in " ".join(words.split())
    assert (width < 500) or f"{plane.name.capitalize()}, deformed" in words


def test_an_angle_is_that_at_its_second_point() -> None:
    assert angle_degrees([(1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 2.0, 0.0)]) == pytest.approx(90.0)
    assert angle_degrees([(3.0, 0.0, 5.0), (0.0, 0.0, 5.0), (1.0, 1.0, 5.0)]) == pytest.approx(45.0)
    assert angle_degrees([(0.0, 0.0, 0.0)] * 3) == 0.0


def test_a_measurement_is_written_where_its_slice_is_shown(written: list[tuple[str, QRectF]]) -> None:
    screen = Screen(PLANES[0], Viewport(np.zeros(3)), QSize(300, 300))
    outline = ((9.0, 0.0, 5.0), (0.0, 0.0, 5.0), (0.0, 9.0, 5.0))
    angle = Measurement("A", "angle", "axial", outline)
    axial, coronal = Measurement("B", "region", "axial", outline), Measurement("C", "region", "coronal", outline)
    for one, position, shown in ((angle, 5.0, 1), (angle, 40.0, 0), (axial, 5.0, 1), (coronal, 5.0, 0)):
        written.clear()
        shape_marks.measurements(MagicMock(), screen, [(one, one.name)], position)
        assert [word for word, _ in written] == [one.name] * shown


def test_values_of_measurements_keep_off_each_other(written: list[tuple[str, QRectF]]) -> None:
    """A ruler through an ellipse: both values would begin at one height, beside their rightmost points."""
    screen = Screen(PLANES[0], Viewport(np.zeros(3), 0.5), QSize(400, 400))
    ends = {"A": 2.0, "B": 12.0, "C": 4.0}
    kept = [Measurement(n, "distance", "axial", ((-10.0, 0.0, 0.0), (x, 0.0, 0.0))) for n, x in ends.items()]
    painter = MagicMock()
    painter.drawPolyline.side_effect = lambda *_: written.append(("line", QRectF()))
    shape_marks.measurements(painter, screen, [(one, f"{one.name}: G = 53.3 kPa") for one in kept], 0.0)
    words = [name for name, _ in written]
    assert words == [*["line"] * 6, *(f"{name}: G = 53.3 kPa" for name in ends)], "no line over a value"
    del written[:6]
    assert len(written) == 3
    assert not any(one.intersects(other) for (_, one), (_, other) in combinations(written, 2))


def test_missed_motion_is_an_arrow_five_times_as_long_where_it_is_near_the_slice() -> None:
    plane, painter = PLANES[0], MagicMock()
    screen = Screen(plane, Viewport(np.zeros(3), 0.5), QSize(300, 300))
    places = np.array([[10.0, -4.0, 2.0], [0.0, 0.0, 20.0]])
    missed = np.array([[1.0, 2.0, 0.0], [1.0, 0.0, 0.0]])
    slice_marks.missed_motion(painter, screen, places, missed, np.array([[255, 0, 0]] * 2, dtype=np.uint8), 0.0)
    lines = [call.args for call in painter.drawLine.call_args_list]
    assert (
        lines == [(screen.to_pixel(10.0, -4.0), screen.to_pixel(15.0, 6.0))] * 2
    )  # edge and colour; the second lies off
