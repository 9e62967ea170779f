"""The table of what is in every label, of both scans."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QTableWidget, QTableWidgetItem, QVBoxLayout, QWidget

from palpate.case.case_folder import STATES
from palpate.imaging.labels import LABELS
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.crosshair import value_words
from palpate.ui.desktop.session.label_statistics import LabelStatistics, MapStatistics, label_statistics
from palpate.ui.words.number_words import three_figures

_HEADS = (
    "scan",
    "label",
    "volume, cc",
    "CT mean, HU",
    "CT sd, HU",
    "G of the region",
    "map: median (5 to 95 %), kPa",
    "map tells",
)


def statistics_page(parent: QWidget, controller: Controller) -> QDialog:
    """The table, shown beside the window."""
    page = QDialog(parent)
    page.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    page.setWindowTitle("Statistics of labels")
    rows = [(state, one) for state in STATES for one in _of(controller, state)]
    table = QTableWidget(len(rows), len(_HEADS))
    table.setHorizontalHeaderLabels(_HEADS)
    table.verticalHeader().hide()
    table.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
    for row, (state, one) in enumerate(rows):
        for column, words in enumerate(_cells(state, one)):
            table.setItem(row, column, QTableWidgetItem(words))
    table.resizeColumnsToContents()
    QVBoxLayout(page).addWidget(table)
    page.resize(980, 80 + 30 * len(rows))
    page.show()
    return page


def _of(controller: Controller, state: str) -> list[LabelStatistics]:
    labels, case = controller.labels(state), controller.case
    if labels is None or case is None:
        return []
    if state != "rest":  # stiffness is of the organ at rest
        return label_statistics(labels, controller.ct(state), ())
    return label_statistics(labels, controller.ct(state), case.regions, case.stiffness_map)


def _cells(state: str, one: LabelStatistics) -> tuple[str, ...]:
    hu = ("", "") if one.mean_hu is None or one.sd_hu is None else (f"{one.mean_hu:.0f}", f"{one.sd_hu:.0f}")
    hu = (hu[0].replace("-", "\N{MINUS SIGN}"), hu[1])
    found = one.region
    stiff = "" if found is None else value_words(found) if found.told else "not determined"
    return state, LABELS[one.label].replace("_", " "), f"{one.volume_cc:.1f}", *hu, stiff, *_map_cells(one.mapped)


def _map_cells(mapped: MapStatistics | None) -> tuple[str, str]:
    if mapped is None:
        return "", ""
    if mapped.median is None or mapped.low is None or mapped.high is None:
        return "not determined", "0 %"
    low, median, high = (three_figures(value) for value in (mapped.low, mapped.median, mapped.high))
    return f"{median} ({low} to {high})", f"{100.0 * mapped.told_share:.0f} %"
