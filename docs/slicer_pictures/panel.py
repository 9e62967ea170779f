"""The module's panel as a picture: its .ui file, read by Qt, with plain widgets in place of those that only Slicer has."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
import numpy as np
from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtGui import QImage
from PySide6.QtUiTools import QUiLoader
from PySide6.QtWidgets import QApplication, QComboBox, QGroupBox, QLineEdit, QPlainTextEdit, QWidget

UI = Path(__file__).resolve().parents[2] / "plugin" / "PalpateStiffness" / "Resources" / "UI" / "PalpateStiffness.ui"
WIDTH = 470
SECTIONS = ("scansSection", "organsSection", "stiffnessSection", "resultsSection", "logSection", "advancedSection")


class _Loader(QUiLoader):
    """ctk's and MRML's widgets by plain ones that look alike."""

    def createWidget(self, class_name: str, parent: QWidget | None = None, name: str = "") -> QWidget:
        plain = {"ctkCollapsibleButton": QGroupBox, "ctkPathLineEdit": QLineEdit, "qMRMLNodeComboBox": QComboBox}
        if class_name in plain:
            made = plain[class_name](parent)
            made.setObjectName(name)
            return made
        return super().createWidget("QWidget" if class_name == "qMRMLWidget" else class_name, parent, name)


def panel_picture(show: tuple[str, ...], texts: Mapping[str, str], pressed: str = "") -> np.ndarray:
    """Rows, columns, red green blue.

    show : the sections that are open. texts : of fields, lists and labels by their names. pressed : the button of the step.
    """
    _application()
    panel = _Loader().load(str(UI))
    for name in SECTIONS:
        section = panel.findChild(QGroupBox, name)
        section.setTitle(str(section.property("text")))
        section.setVisible(name in show)
    for name, text in texts.items():
        _fill(panel.findChild(QWidget, name), text)
    bar = panel.findChild(QWidget, "progressBar")
    bar.setProperty("value", 100 if "summaryText" in texts else 0)
    if pressed:
        button = panel.findChild(QWidget, pressed)
        button.setStyleSheet("background: #3584e4; color: white; font-weight: bold")
    panel.setFixedWidth(WIDTH)
    panel.adjustSize()
    image = panel.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), dtype=np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).copy()


def _fill(widget: QWidget, text: str) -> None:
    if isinstance(widget, QComboBox):
        widget.addItem(text)
        widget.setCurrentText(text)
    elif isinstance(widget, QPlainTextEdit):
        widget.setPlainText(text)
        widget.setMinimumHeight(24 + widget.fontMetrics().lineSpacing() * (2 + text.count("\n") + len(text) // 60))
    else:
        widget.setProperty("text", text)


def _application() -> QCoreApplication:
    made = QApplication.instance()
    if made is None:
        made = QApplication([])
        made.setStyle("Fusion")
        made.setAttribute(Qt.ApplicationAttribute.AA_DontUseNativeDialogs)
    return made
