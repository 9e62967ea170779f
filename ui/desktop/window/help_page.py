"""Mouse and keys on one page, and what the program is."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QMessageBox, QTextBrowser, QVBoxLayout, QWidget

from palpate import __version__

# The same table stands in docs/desktop.md.
ROWS = (
    ("left button", "what the chosen tool does; with Look, the crosshair"),
    ("right button, drag up or down", "magnify"),
    ("middle button or Shift, drag", "move the picture"),
    ("wheel; Page Up, Page Down", "through the slices"),
    ("arrow keys; with Shift", "crosshair by one voxel; by five"),
    ("Ctrl + wheel", "magnify"),
    ("double click", "this view alone; again: all views"),
    ("3D view", "left drag turns, right drag and wheel magnify, double click alone"),
    ("F", "go to the organ"),
    ("1, 2, 3, 4, 5, 6, 7", "look, point, brush, eraser, window and level, ruler, angle"),
    ("8, 9", "lasso, polygon (double click ends it) of a label"),
    ("E, R", "ellipse, free region on the stiffness map"),
    ("brush, lasso, polygon with Ctrl", "erases the label"),
    ("+, \N{MINUS SIGN}", "radius of the brush"),
    ("Ctrl + Z, Ctrl + Shift + Z, Ctrl + S", "undo, redo, save"),
    ("Ctrl + O", "open scans or a case"),
    ("Esc", "cancel the running step"),
    ("F1", "this page"),
)
_WORDS = (
    "The patient's left is on the right of axial and coronal slices. Coordinates are DICOM's: LPS, mm. "
    "<b>Which number to quote:</b> the value of each half with its interval. The map is smoothed and less certain. "
    "<b>Layouts</b>: rest, deformed, both and blend, on the tab View and in the menu View."
)


def mouse_and_keys(parent: QWidget) -> QDialog:
    """The page, shown beside the window."""
    rows = "".join(f"<tr><td style='padding-right:18px'><b>{key}</b></td><td>{what}</td></tr>" for key, what in ROWS)
    page = QDialog(parent)
    page.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    page.setWindowTitle("Mouse and keys")
    words = QTextBrowser()
    words.setHtml(f"<table cellpadding=3>{rows}</table><p>{_WORDS}</p>")
    column = QVBoxLayout(page)
    column.addWidget(words)
    page.resize(640, 520)
    page.show()
    return page


def about(parent: QWidget) -> None:
    """What it is, of which version, under which licence."""
    QMessageBox.about(
        parent, "About Palpate",
        f"<h3>Palpate {__version__}</h3>Stiffness of an organ from two CT scans, one at rest and one in which it is deformed."
        "<p><b>Research use only. Not for diagnosis.</b><p>Apache-2.0. Method: MaterialCloning.",
    )  # fmt: skip
