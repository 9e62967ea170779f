"""The menu: open, recent cases, the sample, every export, the picture, the report, help."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from PySide6.QtGui import QAction, QPixmap
from PySide6.QtWidgets import QFileDialog, QMainWindow, QMenu

from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.display import MODES
from palpate.ui.desktop.session.recent import recent_cases
from palpate.ui.desktop.window import help_page
from palpate.ui.desktop.window.open_page import OpenPage
from palpate.ui.desktop.window.outer_pages import show_outside
from palpate.ui.desktop.window.views import Views
from palpate.ui.export import names

_REPORTS = (("as a page", "report/report.html"), ("as PDF", "report/report.pdf"), ("its folder", "report"))

# By the names of `palpate export`; a form of a person's own, which is not here, is listed by its name.
FORMS = {
    "dicom-pdf": "DICOM: report as PDF",
    "dicom-pm": "DICOM: stiffness as Parametric Map",
    "dicom-reg": "DICOM: alignment as Spatial Registration",
    "dicom-seg": "DICOM: labels as SEG",
    "dicom-series": "DICOM: stiffness as Secondary Capture",
    "dicom-sr": "DICOM: measurements as SR",
    "itksnap": "ITK-SNAP: NIfTI and workspaces",
    "nrrd": "3D Slicer: NRRD and segmentations",
    "rtstruct": "DICOM: contours as RTSTRUCT",
    "transform": "ITK: alignment and displacement field",
    "uncertainty": "NIfTI: limits of the stiffness and map",
    "vtu": "ParaView: mesh as VTU",
}


@dataclass(frozen=True)
class MenuParts:
    """What of the window the menu acts on."""

    controller: Controller
    views: Views
    page: OpenPage
    show_open_page: Callable[[], None]
    show_statistics: Callable[[], None]
    picture: Callable[[], QPixmap]


class Menu:
    """Fills the menu bar of a window. Every entry that cannot be used now is off."""

    def __init__(self, window: QMainWindow, parts: MenuParts) -> None:
        self._window, self._parts = window, parts
        bar = window.menuBar()
        file, view, organ = bar.addMenu("&File"), bar.addMenu("&View"), bar.addMenu("&Organ")
        guide = bar.addMenu("&Help")
        self._entry(file, "Open scans or a case \N{HORIZONTAL ELLIPSIS}", parts.show_open_page, "Ctrl+O")
        self._recent = file.addMenu("Open recent")
        self._recent.aboutToShow.connect(self._list_recent)
        self._entry(file, "Open the finished sample", parts.page.open_sample)
        self._entry(file, "Run the sample", parts.page.run_sample_pair)
        file.addSeparator()
        self._of_case = [self._exports(file), self._reports(file)]
        self._picture = self._entry(file, "Save picture \N{HORIZONTAL ELLIPSIS}", self._save_picture)
        file.addSeparator()
        self._entry(file, "Quit", lambda: window.close(), "Ctrl+Q")
        for mode in MODES:
            self._entry(view, mode.capitalize(), partial(parts.controller.show, mode=mode))
        view.addSeparator()
        self._entry(view, "Go to the organ (F)", parts.views.go_to_organ)
        self._statistics = self._entry(view, "Statistics of labels \N{HORIZONTAL ELLIPSIS}", parts.show_statistics)
        more = "\N{HORIZONTAL ELLIPSIS}"
        self._of_organ = [
            self._entry(organ, f"Touch it {more}", self._touch),
            self._entry(organ, f"Film of its fall {more}", self._drop),
        ]
        self._entry(guide, "Mouse and keys", lambda: help_page.mouse_and_keys(window), "F1")
        self._entry(guide, "About Palpate", lambda: help_page.about(window))
        file.aboutToShow.connect(self.refresh)
        view.aboutToShow.connect(self.refresh)
        organ.aboutToShow.connect(self.refresh)

    def refresh(self) -> None:
        """Turns off what needs a case or a report that is not there."""
        case = self._parts.controller.case
        for menu in self._of_case:
            menu.setEnabled(case is not None)
        for action, (_, name) in zip(self._of_case[1].actions(), _REPORTS, strict=True):
            action.setEnabled(case is not None and case.folder.file(name).exists())
        self._picture.setEnabled(case is not None)
        for action in self._of_organ:
            action.setEnabled(case is not None and bool(case.regions) and not self._parts.controller.jobs.running)
        self._statistics.setEnabled(case is not None and bool(case.volumes))

    def _exports(self, file: QMenu) -> QMenu:
        out = file.addMenu("Export")
        for name in names():
            self._entry(out, FORMS.get(name, name), partial(self._export, name))
        return out

    def _reports(self, file: QMenu) -> QMenu:
        out = file.addMenu("Report")
        for words, name in _REPORTS:
            self._entry(out, words, partial(self._show_file, name))
        return out

    def _entry(self, menu: QMenu, words: str, act: Callable[[], object], keys: str = "") -> QAction:
        action = menu.addAction(words)
        action.triggered.connect(lambda _=False: act())
        if keys:
            action.setShortcut(keys)
        return action

    def _list_recent(self) -> None:
        self._recent.clear()
        for path in recent_cases():
            self._entry(self._recent, str(path), partial(self._parts.page.open_case, path))
        if self._recent.isEmpty():
            self._recent.addAction("none yet").setEnabled(False)

    def _export(self, name: str) -> None:
        folder = QFileDialog.getExistingDirectory(self._window, f"Folder for the files of {name}")
        if folder:
            self._parts.controller.attempt(lambda: self._parts.controller.export(name, Path(folder)))

    def _touch(self) -> None:
        self._parts.controller.attempt(self._parts.controller.touch)

    def _drop(self) -> None:
        chosen, _ = QFileDialog.getSaveFileName(self._window, "Film of the organ's fall", "fall.mp4", "Film (*.mp4)")
        if chosen:
            self._parts.controller.attempt(lambda: self._parts.controller.drop(Path(chosen)))

    def _show_file(self, name: str) -> None:
        case = self._parts.controller.case
        if case is not None:
            show_outside(self._parts.controller, case.folder.file(name))

    def _save_picture(self) -> None:
        chosen, _ = QFileDialog.getSaveFileName(self._window, "Save the views as a picture", "views.png", "PNG (*.png)")
        if chosen and not self._parts.picture().save(chosen):
            self._parts.controller.say(f"{chosen} cannot be written; choose another place")
