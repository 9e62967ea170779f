"""Colours, fonts and the style sheet of the window: dark, so that grey pictures are seen as on a reading station."""

from __future__ import annotations

from pathlib import Path

import matplotlib
from PySide6.QtGui import QColor, QFont, QFontDatabase
from PySide6.QtWidgets import QApplication

GROUND, PANEL, RAISED, LINE = "#15181c", "#1e2227", "#2a3037", "#3a424c"
TEXT, FAINT, ACCENT, GOOD, WARN, BAD = "#e6e9ed", "#98a2ae", "#3d8bfd", "#4cb782", "#e0a63a", "#e5645a"
CROSSHAIR, SEED, RULER = "#4fd1ff", "#ff5fd2", "#ffd84d"

SHEET = f"""
QWidget {{ background: {PANEL}; color: {TEXT}; }}
QMainWindow, QSplitter {{ background: {GROUND}; }}
QToolTip {{ background: {RAISED}; color: {TEXT}; border: 1px solid {LINE}; padding: 4px; }}
QPushButton, QToolButton {{ background: {RAISED}; border: 1px solid {LINE}; border-radius: 4px; padding: 5px 10px; }}
QPushButton:hover, QToolButton:hover {{ border-color: {ACCENT}; }}
QPushButton:disabled, QToolButton:disabled {{ color: #646e7a; background: {PANEL}; }}
QToolButton:checked, QPushButton:checked {{ background: {ACCENT}; border-color: {ACCENT}; color: white; }}
QPushButton#main {{ background: {ACCENT}; border-color: {ACCENT}; color: white; font-weight: bold; }}
QPushButton#main:disabled {{ background: {RAISED}; border-color: {LINE}; color: #646e7a; }}
QPushButton#stop {{ background: {BAD}; border-color: {BAD}; color: white; font-weight: bold; }}
QPushButton#stop:disabled {{ background: {PANEL}; border-color: {LINE}; color: #646e7a; }}
QGroupBox {{ border: 1px solid {LINE}; border-radius: 5px; margin-top: 9px; padding: 8px 6px 6px 6px; }}
QGroupBox::title {{ subcontrol-origin: margin; left: 8px; padding: 0 4px; color: {FAINT}; }}
QComboBox, QDoubleSpinBox, QSpinBox, QLineEdit {{ background: {GROUND}; border: 1px solid {LINE}; border-radius: 3px; padding: 3px 5px; }}
QComboBox QAbstractItemView {{ background: {GROUND}; selection-background-color: {ACCENT}; }}
QDoubleSpinBox::up-button, QDoubleSpinBox::down-button {{ width: 0; border: none; }}
QSlider::groove:horizontal {{ height: 4px; background: {LINE}; border-radius: 2px; }}
QSlider::handle:horizontal {{ background: {TEXT}; width: 12px; margin: -5px 0; border-radius: 6px; }}
QSlider::sub-page:horizontal {{ background: {ACCENT}; border-radius: 2px; }}
QProgressBar {{ background: {GROUND}; border: 1px solid {LINE}; border-radius: 3px; height: 14px; text-align: center; }}
QProgressBar::chunk {{ background: {ACCENT}; }}
QTableWidget {{ background: {GROUND}; border: 1px solid {LINE}; gridline-color: {LINE}; }}
QHeaderView::section {{ background: {PANEL}; color: {FAINT}; border: none; padding: 3px; }}
QScrollArea {{ border: none; }}
QScrollBar:vertical {{ background: {PANEL}; width: 10px; }}
QScrollBar::handle:vertical {{ background: {LINE}; border-radius: 5px; min-height: 24px; }}
QScrollBar::add-line, QScrollBar::sub-line {{ height: 0; }}
QCheckBox::indicator {{ width: 13px; height: 13px; border: 1px solid {FAINT}; border-radius: 3px; background: {GROUND}; }}
QCheckBox::indicator:checked {{ background: {ACCENT}; border-color: {ACCENT}; }}
QTabWidget::pane {{ border: none; }}
QTabBar::tab {{ background: {PANEL}; color: {FAINT}; padding: 6px 12px; border-bottom: 2px solid {LINE}; }}
QTabBar::tab:selected {{ color: {TEXT}; border-bottom: 2px solid {ACCENT}; }}
QListWidget {{ background: {GROUND}; border: 1px solid {LINE}; border-radius: 4px; }}
QListWidget::item {{ padding: 5px; }}
QListWidget::item:hover {{ background: {RAISED}; }}
QStatusBar {{ color: {FAINT}; }}
QStatusBar::item {{ border: none; }}
"""
_POINTS = 9


def dress(application: QApplication) -> None:
    """Gives the program its look. The font comes along, because a machine without a desktop may have none."""
    fonts = Path(matplotlib.get_data_path(), "fonts", "ttf")
    for name in ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf", "DejaVuSansMono.ttf", "DejaVuSansMono-Bold.ttf"):
        QFontDatabase.addApplicationFont(str(fonts / name))
    application.setStyle("Fusion")
    application.setFont(QFont("DejaVu Sans", _POINTS))
    application.setStyleSheet(SHEET)


def colour(name: str, alpha: int = 255) -> QColor:
    """A colour of this file with an opacity, 0 to 255."""
    out = QColor(name)
    out.setAlpha(alpha)
    return out
