"""The table of what is in every label of both scans, the histograms of the chosen label, and both as CSV."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QFileDialog, QPushButton, QTableWidget, QTableWidgetItem, QVBoxLayout, QWidget

from palpate.case.case_folder import STATES
from palpate.core.files.atomic import atomic_path
from palpate.imaging.labels import LABELS
from palpate.ui.desktop.panels.charts import HistogramChart
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.crosshair import value_words
from palpate.ui.desktop.session.labels.label_statistics import (
    Histogram,
    LabelStatistics,
    MapStatistics,
    as_csv,
    histograms,
    label_statistics,
)
from palpate.ui.words.number_words import three_figures

_HEADS = (
    "scan",
    "label",
    "volume, cc",
    "CT mean, HU",
    "CT sd, HU",
    "G of the region",
    "map: median (5 to 95 %), kPa",
    "map determines",
)
_COLUMNS = (
    *("scan", "label", "volume_cc", "ct_mean_hu", "ct_sd_hu", "G_kpa", "G_low_kpa", "G_high_kpa"),
    *("map_median_kpa", "map_p5_kpa", "map_p95_kpa", "map_determined_share"),
)
_BINS = ("scan", "label", "quantity", "unit", "from", "to", "voxels")


class StatisticsPage(QDialog):
    """The table, shown beside the window. It is of the labels as they are when it opens."""

    def __init__(self, parent: QWidget, controller: Controller) -> None:
        super().__init__(parent)
        self._controller = controller
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle("Statistics of labels")
        self.rows = [(state, one) for state in STATES for one in _of(controller, state)]
        column = QVBoxLayout(self)
        self.table = self._table()
        column.addWidget(self.table)
        self.chart = HistogramChart()
        column.addWidget(self.chart)
        save = QPushButton("Save as CSV \N{HORIZONTAL ELLIPSIS}")
        save.setToolTip("The table, and beside it the histograms of all labels")
        save.clicked.connect(self._choose_file)
        column.addWidget(save, 0, Qt.AlignmentFlag.AlignLeft)
        self.table.selectRow(0)
        self.resize(980, 340 + 30 * len(self.rows))

    def _table(self) -> QTableWidget:
        table = QTableWidget(len(self.rows), len(_HEADS))
        table.setHorizontalHeaderLabels(_HEADS)
        table.verticalHeader().hide()
        table.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        table.setSelectionBehavior(QTableWidget.SelectionBehavior.SelectRows)
        for row, (state, one) in enumerate(self.rows):
            for column, words in enumerate(_cells(state, one)):
                table.setItem(row, column, QTableWidgetItem(words))
        table.resizeColumnsToContents()
        table.currentCellChanged.connect(lambda row, *_: self._show(row))
        return table

    def _show(self, row: int) -> None:
        if 0 <= row < len(self.rows):
            state, one = self.rows[row]
            self.chart.show_histograms(f"{LABELS[one.label].replace('_', ' ')}, {state}", self._histograms(row))

    def _histograms(self, row: int) -> list[Histogram]:
        state, one = self.rows[row]
        labels, case = self._controller.labels(state), self._controller.case
        if labels is None or case is None:
            return []
        arrays = case.stiffness_map if one.mapped is not None else None
        return histograms(labels, one.label, self._controller.ct(state), arrays)

    def _choose_file(self) -> None:
        chosen, _ = QFileDialog.getSaveFileName(self, "Statistics as CSV", "statistics.csv", "CSV (*.csv)")
        if chosen:
            self._controller.attempt(lambda: self.write(Path(chosen)))

    def write(self, path: Path) -> None:
        """Writes the table, and NAME_histograms.csv beside it. Raises InputError where it cannot."""
        bins = [row for number in range(len(self.rows)) for row in self._bins(number)]
        beside = path.with_name(f"{path.stem}_histograms{path.suffix or '.csv'}")
        table = as_csv(_COLUMNS, (_values(state, one) for state, one in self.rows))
        for file, text in ((path, table), (beside, as_csv(_BINS, bins))):
            with atomic_path(file) as temporary:
                temporary.write_text(text, encoding="utf-8")
        self._controller.say(f"written: {path} and {beside.name}")

    def _bins(self, row: int) -> list[tuple[object, ...]]:
        state, one = self.rows[row]
        return [
            (state, LABELS[one.label], h.quantity, h.unit, f"{a:.6g}", f"{b:.6g}", int(n))
            for h in self._histograms(row)
            for a, b, n in zip(h.edges[:-1], h.edges[1:], h.counts, strict=True)
        ]


def _of(controller: Controller, state: str) -> list[LabelStatistics]:
    labels, case = controller.labels(state), controller.case
    if labels is None or case is None:
        return []
    if state != "rest":  # stiffness is of the organ at rest
        return label_statistics(labels, controller.ct(state), ())
    return label_statistics(labels, controller.ct(state), case.regions, case.stiffness_map)


def _values(state: str, one: LabelStatistics) -> tuple[object, ...]:
    """Numbers as numbers."""
    region = one.region if one.region is not None and one.region.determined else None
    ci = (None, None) if region is None or region.ci is None else region.ci
    mapped = one.mapped
    of_map = (None,) * 4 if mapped is None else (mapped.median, mapped.low, mapped.high, mapped.told_share)
    G = None if region is None else region.G
    numbers = (one.volume_cc, one.mean_hu, one.sd_hu, G, *ci, *of_map)
    return (state, LABELS[one.label], *(None if value is None else f"{value:.6g}" for value in numbers))


def _cells(state: str, one: LabelStatistics) -> tuple[str, ...]:
    hu = ("", "") if one.mean_hu is None or one.sd_hu is None else (f"{one.mean_hu:.0f}", f"{one.sd_hu:.0f}")
    hu = (hu[0].replace("-", "\N{MINUS SIGN}"), hu[1])
    found = one.region
    stiff = "" if found is None else value_words(found) if found.determined else "not determined"
    return state, LABELS[one.label].replace("_", " "), f"{one.volume_cc:.1f}", *hu, stiff, *_map_cells(one.mapped)


def _map_cells(mapped: MapStatistics | None) -> tuple[str, str]:
    if mapped is None:
        return "", ""
    if mapped.median is None or mapped.low is None or mapped.high is None:
        return "not determined", "0 %"
    low, median, high = (three_figures(value) for value in (mapped.low, mapped.median, mapped.high))
    return f"{median} ({low} to {high})", f"{100.0 * mapped.told_share:.0f} %"
