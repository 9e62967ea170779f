"""The page on which a person chooses: one of several series of a folder, and which structure of a file is which organ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QIcon, QImage, QPixmap
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from palpate.imaging.contours.roi_names import ORGANS
from palpate.ui.desktop.session.display import PRESETS, apply_window
from palpate.ui.desktop.session.read_scans import Offered, OfferedSeries, OfferedStructure

_WORDS = {"rest": "Scan at rest", "deformed": "Deformed scan"}
_NONE = "not used"
_PICTURE = 96
_ALONE = ("prostate", "prostate_left", "prostate_right", "bladder", "rectum")


class ChoicePage(QDialog):
    """series : a list for each folder with several. structures : a table for each file whose names do not tell."""

    def __init__(self, parent: QWidget, offered: Offered) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle("Which series, which structures?")
        column = QVBoxLayout(self)
        self.series: dict[str, QListWidget] = {}
        self.structures: dict[str, StructureTable] = {}
        for state, entries in offered["series"].items():
            column.addWidget(QLabel(f"<b>{_WORDS[state]}</b>: the folder contains {len(entries)} series. Which one?"))
            self.series[state] = _series_list(entries)
            column.addWidget(self.series[state])
        for state, structures in offered["structures"].items():
            column.addWidget(QLabel(f"<b>Contours, {_WORDS[state].lower()}</b>: which structure is which organ?"))
            self.structures[state] = StructureTable(structures)
            column.addWidget(self.structures[state])
        self.problem = QLabel()
        column.addWidget(self.problem)
        self._buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel)
        self._buttons.accepted.connect(self.accept)
        self._buttons.rejected.connect(self.reject)
        column.addWidget(self._buttons)
        for listed in self.series.values():
            listed.currentRowChanged.connect(lambda _row: self._check())
        for table in self.structures.values():
            for choice in table.choices:
                choice.currentTextChanged.connect(lambda _text: self._check())
        self.resize(760, min(220 + 260 * (len(self.series) + len(self.structures)), 660))
        self._check()

    def chosen_series(self) -> dict[str, str]:
        """Identifier of the chosen series, by state."""
        return {
            state: str(listed.currentItem().data(Qt.ItemDataRole.UserRole)) for state, listed in self.series.items()
        }

    def chosen_rois(self) -> dict[str, Mapping[str, Sequence[str]]]:
        """Organ -> structures, by state."""
        return {state: table.rois() for state, table in self.structures.items()}

    def _check(self) -> None:
        """Says what is missing; without it there is no OK."""
        missing = [f"choose a series of the {state} scan" for state, one in self.series.items() if one.currentRow() < 0]
        missing += [reason for table in self.structures.values() if (reason := table.why_not())]
        self.problem.setText("; ".join(missing).capitalize())
        self._buttons.button(QDialogButtonBox.StandardButton.Ok).setEnabled(not missing)


class StructureTable(QTableWidget):
    """A row for each structure: name, volume, and the organ that it is. choices : the organ of each row."""

    def __init__(self, structures: Sequence[OfferedStructure]) -> None:
        super().__init__(len(structures), 3)
        self._structures = structures
        self.setHorizontalHeaderLabels(("structure", "volume, cc", "organ"))
        self.verticalHeader().hide()
        self.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self.choices: list[QComboBox] = []
        for row, one in enumerate(structures):
            self.setItem(row, 0, QTableWidgetItem(one["name"]))
            self.setItem(row, 1, QTableWidgetItem(f"{one['volume_cc']:.1f}"))
            choice = QComboBox()
            choice.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
            choice.addItem(_NONE, "")
            for organ in ORGANS:
                choice.addItem(organ.replace("_", " "), organ)
            choice.setCurrentIndex(max(choice.findData(one["organ"]), 0))
            self.setCellWidget(row, 2, choice)
            self.choices.append(choice)
        self.resizeColumnsToContents()
        self.setColumnWidth(0, max(self.columnWidth(0), 300))
        self.setColumnWidth(2, 180)
        self.setMinimumHeight(180)

    def rois(self) -> dict[str, list[str]]:
        """Organ -> identifiers of its structures."""
        out: dict[str, list[str]] = {}
        for one, choice in zip(self._structures, self.choices, strict=True):
            if choice.currentData():
                out.setdefault(str(choice.currentData()), []).append(one["identifier"])
        return out

    def why_not(self) -> str:
        """What is missing or twice; empty when it can be taken."""
        rois = self.rois()
        if not any(organ.startswith("prostate") for organ in rois):
            return "say which structure is the prostate, or its halves"
        twice = [organ for organ, names in rois.items() if len(names) > 1 and organ in _ALONE]
        return f"several structures are {twice[0].replace('_', ' ')}; keep one" if twice else ""


def _series_list(entries: Sequence[OfferedSeries]) -> QListWidget:
    listed = QListWidget()
    listed.setIconSize(QSize(_PICTURE, _PICTURE))
    listed.setMinimumHeight(_PICTURE + 24)
    for one in entries:
        thick = "" if one["thickness_mm"] is None else f", every {one['thickness_mm']:g} mm"
        columns, rows = one["size"]
        words = (
            f"{one['identifier']}   {one['date'] or 'no date'}\n{one['slices']} slices of {columns} x {rows}{thick}"
            f"\n{one['description']}"
        )
        item = QListWidgetItem(words.rstrip())
        if one["picture"] is not None:
            item.setIcon(QIcon(_pixmap(np.array(one["picture"]))))
        item.setData(Qt.ItemDataRole.UserRole, one["identifier"])
        listed.addItem(item)
    return listed


def _pixmap(hu: np.ndarray) -> QPixmap:
    grey = apply_window(hu, PRESETS["Soft tissue"])
    rows, columns = grey.shape
    return QPixmap.fromImage(QImage(grey.data, columns, rows, columns, QImage.Format.Format_Grayscale8).copy())
