"""The window: step bar above, views in the middle, controls at the right."""

from __future__ import annotations

import tempfile
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QKeySequence, QPixmap, QShortcut
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QMainWindow,
    QScrollArea,
    QStackedWidget,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from palpate.ui.desktop.panels.colour_bar import ColourBar
from palpate.ui.desktop.panels.display_panel import DisplayPanel
from palpate.ui.desktop.panels.edit_panel import EDITS, EditPanel
from palpate.ui.desktop.panels.job_panel import JobPanel
from palpate.ui.desktop.panels.measure_panel import MEASURES, MeasurePanel
from palpate.ui.desktop.panels.result_panel import ResultPanel
from palpate.ui.desktop.panels.search_panel import SearchPanel
from palpate.ui.desktop.panels.step_bar import StepBar
from palpate.ui.desktop.panels.tool_tabs import ToolTabs
from palpate.ui.desktop.panels.wheel_guard import WheelGuard
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.crosshair import words_at_crosshair
from palpate.ui.desktop.session.read_scans import Offered
from palpate.ui.desktop.window import geometry, questions
from palpate.ui.desktop.window.choosers import ChoicePage
from palpate.ui.desktop.window.menu import Menu, MenuParts
from palpate.ui.desktop.window.notices import Notices, show_notice
from palpate.ui.desktop.window.open_page import OpenPage
from palpate.ui.desktop.window.organ_pages import organ_pages
from palpate.ui.desktop.window.outer_pages import show_outside
from palpate.ui.desktop.window.responsiveness import ResponsivenessMeter
from palpate.ui.desktop.window.statistics_page import StatisticsPage
from palpate.ui.desktop.window.views import Views

_POLL_MS = 30
_PANEL_WIDTH = 360
# A key changes the brush by this factor, within these limits, mm.
_WIDER, _RADIUS_MM = 1.25, (0.5, 20.0)


class MainWindow(QMainWindow):
    """controller : the logic. stalls : how long the window did not answer."""

    def __init__(self, controller: Controller) -> None:
        super().__init__()
        self.controller = controller
        self._folder = tempfile.TemporaryDirectory(prefix="palpate-3d-")
        self.responsiveness = ResponsivenessMeter(self)
        self.steps = StepBar(controller, self.step_pressed)
        self.views = Views(controller, Path(self._folder.name))
        self.bar = ColourBar(controller)
        self.display, self.edit, self.measure = (
            DisplayPanel(controller),
            EditPanel(controller),
            MeasurePanel(controller),
        )
        self.results, self.job = ResultPanel(controller, self.open_report), JobPanel(controller)
        self.page = OpenPage(controller, self._opened)
        self._lay_out()
        self.organ = organ_pages(controller)
        self.notices = Notices(controller, lambda words: show_notice(self, words))
        parts = MenuParts(controller, self.views, self.page, self.show_open_page, self.show_statistics, self.picture)
        self.menu = Menu(self, parts)
        self.setAcceptDrops(True)
        geometry.fit(self)
        controller.listeners.append(self.on_change)
        self._timers()
        self._shortcuts()
        for name in ("case", "view", "tools", "job"):
            self.on_change(name)

    def _lay_out(self) -> None:
        panel = QWidget()
        column = QVBoxLayout(panel)
        column.setContentsMargins(6, 2, 8, 6)
        self.tabs = QTabWidget()
        self.tabs.addTab(self.display, "View")
        self.tabs.addTab(self.edit, "Correct")
        self.tabs.addTab(self.measure, "Measure")
        self.search = SearchPanel(self.controller, self.tabs)
        self.tool_tabs = ToolTabs(self.controller, self.tabs, {self.edit: EDITS, self.measure: MEASURES})
        for part in (self.job, self.results, self.tabs):
            column.addWidget(part)
        column.addStretch(1)
        WheelGuard(panel)
        scroll = QScrollArea()
        scroll.setWidget(panel)
        scroll.setWidgetResizable(True)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        # There is no bar to move it sideways: it must hold its widest row, whatever the font.
        needed = panel.minimumSizeHint().width() + scroll.verticalScrollBar().sizeHint().width()
        scroll.setFixedWidth(max(_PANEL_WIDTH, needed))
        self._work = work = QWidget()
        row = QHBoxLayout(work)
        row.setContentsMargins(8, 4, 0, 0)
        row.setSpacing(4)
        row.addWidget(self.views, 1)
        row.addWidget(self.bar)
        row.addWidget(scroll)
        self.stack = QStackedWidget()
        self.stack.addWidget(self.page)
        self.stack.addWidget(work)
        whole = QWidget()
        rows = QVBoxLayout(whole)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(2)
        rows.addWidget(self.steps)
        rows.addWidget(self.stack, 1)
        self.setCentralWidget(whole)
        self.where = QLabel()
        self.statusBar().addPermanentWidget(self.where)

    def _timers(self) -> None:
        self._poll = QTimer(self)
        self._poll.timeout.connect(self._tick)
        self._poll.start(_POLL_MS)
        self._second = QTimer(self)
        self._second.timeout.connect(self._each_second)
        self._second.start(1000)

    def _shortcuts(self) -> None:
        QShortcut(QKeySequence("F"), self).activated.connect(self.views.go_to_organ)
        for keys, count in (("PgUp", 1), ("PgDown", -1), ("Shift+PgUp", 5), ("Shift+PgDown", -5)):
            QShortcut(QKeySequence(keys), self).activated.connect(lambda n=count: self.views.through_slices(n))
        for keys, factor in (("+", _WIDER), ("=", _WIDER), ("-", 1.0 / _WIDER)):
            QShortcut(QKeySequence(keys), self).activated.connect(lambda f=factor: self._brush(f))
        for key, tool in (
            ("1", "look"),
            ("2", "seed"),
            ("3", "brush"),
            ("4", "eraser"),
            ("5", "window"),
            ("6", "ruler"),
            ("7", "angle"),
            ("8", "lasso"),
            ("9", "polygon"),
            ("E", "ellipse"),
            ("R", "region"),
        ):
            QShortcut(QKeySequence(key), self).activated.connect(lambda t=tool: self.controller.show(tool=t))

    def on_change(self, what: str) -> None:
        """Something has changed."""
        for part in (
            self.views,
            self.bar,
            self.display,
            self.edit,
            self.measure,
            self.tool_tabs,
            self.results,
            self.job,
            self.search,
            self.steps,
            self.organ,
            self.notices,
        ):
            part.on_change(what)
        if what == "said":
            self.statusBar().showMessage(self.controller.said)
            if self.controller.case is None and not self.controller.jobs.running and not self.controller.scans:
                self.page.show_problem(self.controller.said)
                self.stack.setCurrentWidget(self.page)
        if what == "choice" and self.controller.offered is not None:
            self.choose(self.controller.offered)
        if what in ("case", "labels"):
            self._title()
        if what in ("case", "view", "labels", "steps"):
            self.where.setText(self.place_words())

    def choose(self, offered: Offered) -> None:
        """The page on which a person chooses series and structures; the case is made after that."""
        self.choice = page = ChoicePage(self, offered)
        page.accepted.connect(lambda: self.controller.choose(page.chosen_series(), page.chosen_rois()))
        page.rejected.connect(self.controller.choose_nothing)
        page.open()

    def place_words(self) -> str:
        """Crosshair in patient coordinates and what lies there."""
        if self.controller.case is None and not self.controller.scans:
            return ""
        x, y, z = self.controller.display.crosshair
        place = f"x {x:.1f}  y {y:.1f}  z {z:.1f} mm (LPS)".replace("-", "\N{MINUS SIGN}")
        return f"{place}   {words_at_crosshair(self.controller)}"

    def show_open_page(self) -> None:
        """The first page; the case stays open till another is opened."""
        self.page.refresh()
        self.stack.setCurrentWidget(self.page)

    def step_pressed(self, command: str) -> None:
        """A button of the step bar."""
        if command == "import":
            self.show_open_page()
            return
        if questions.may_run(self, self.controller, command):
            self.controller.attempt(lambda: self.controller.run(command))

    def open_report(self) -> None:
        """The report, in the web browser."""
        case = self.controller.case
        if case is not None:
            show_outside(self.controller, case.folder.file("report/report.html"))

    def show_statistics(self) -> None:
        """The table of what is in every label."""
        StatisticsPage(self, self.controller).show()

    def picture(self) -> QPixmap:
        """The views with the bar that says what their colours stand for."""
        place = self.views.geometry()
        if self.bar.isVisible():
            place = place.united(self.bar.geometry())
        return self._work.grab(place)

    def _brush(self, factor: float) -> None:
        """Another radius of the brush, as far as the panel's slider goes."""
        radius = self.controller.display.radius_mm * factor
        self.controller.show(radius_mm=min(max(radius, _RADIUS_MM[0]), _RADIUS_MM[1]))

    def _opened(self) -> None:
        self.stack.setCurrentIndex(1)

    def _title(self) -> None:
        case = self.controller.case
        if case is None:
            self.setWindowTitle("Palpate")
            return
        unsaved = " (unsaved corrections)" if case.corrections.unsaved else ""
        made = " (simulated)" if case.simulated else ""
        self.setWindowTitle(f"{case.folder.path.name}{made}{unsaved} \N{EM DASH} Palpate")

    def _tick(self) -> None:
        self.controller.poll()
        self.views.solid.tick()

    def _each_second(self) -> None:
        self.job.refresh()
        self.where.setText(self.place_words())

    # Qt

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        self.show_open_page()
        self.page.drop(paths)

    def closeEvent(self, event: QCloseEvent) -> None:
        if questions.may_close(self, self.controller):
            self.shut()
            event.accept()
        else:
            event.ignore()

    def shut(self) -> None:
        """Ends everything that belongs to the window."""
        for timer in (self._poll, self._second):
            timer.stop()
        self.controller.listeners.clear()
        self.organ.close()
        self.controller.quit()
        self.views.solid.client.close()
        self._folder.cleanup()
