"""The search for the stiffness while it runs, on a tab of its own: nothing else moves when it comes and goes."""

from __future__ import annotations

from PySide6.QtWidgets import QLabel, QTabWidget, QVBoxLayout, QWidget

from palpate.ui.desktop import style
from palpate.ui.desktop.panels.charts import SwarmChart
from palpate.ui.desktop.session.controller import Controller

_NONE_YET = "The swarm is shown here while Stiffness runs: its best misfit so far, and where its particles are."
_STEP = "identify"


class SearchPanel(QWidget):
    """Adds itself to tabs. It comes to the front when the search begins; the tab of before comes back when the search ends."""

    def __init__(self, controller: Controller, tabs: QTabWidget) -> None:
        super().__init__()
        self._controller, self._tabs = controller, tabs
        self._before: QWidget | None = None
        self._searching = False
        column = QVBoxLayout(self)
        self.words = QLabel(_NONE_YET)
        self.words.setWordWrap(True)
        self.words.setStyleSheet(f"color: {style.FAINT}")
        self.chart = SwarmChart()
        self.chart.setFixedHeight(190)
        column.addWidget(self.chart)
        column.addWidget(self.words)
        column.addStretch(1)
        tabs.addTab(self, "Search")

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what not in ("job", "case"):
            return
        job = self._controller.jobs.state
        searching = job is not None and job.running and job.step == _STEP
        if searching != self._searching:
            self._searching = searching
            self._turn(searching)
        if job is not None and (job.swarm.iterations or searching):
            case = self._controller.case
            bounds = (5.0, 500.0) if case is None else case.folder.facts.organ_shear_modulus_bounds_kpa
            self.chart.show_swarm(job.swarm, (float(bounds[0]), float(bounds[1])))

    def _turn(self, searching: bool) -> None:
        if searching:
            self._before = self._tabs.currentWidget()
            self._tabs.setCurrentWidget(self)
        elif self._before is not None and self._tabs.currentWidget() is self:
            self._tabs.setCurrentWidget(self._before)
