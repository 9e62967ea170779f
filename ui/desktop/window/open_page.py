"""The first page: drop two folders, or choose them; or open a case of before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QFileDialog,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from palpate.core.errors import InputError
from palpate.ui.desktop import style
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.dropped_files import Pair, case_beside
from palpate.ui.desktop.session.recent import recent_cases
from palpate.ui.desktop.session.sample import STEPS, finished_sample, sample_pair

_CONTOURS = "if you have any: RTSTRUCT, DICOM SEG, NIfTI, NRRD, MetaImage, ITK-SNAP workspace, .seg.nrrd"
_STATES = (
    "<b>Rest</b>: the organ as it lies by itself. <b>Deformed</b>: the same patient with the organ pushed out of shape, "
    "by a full bladder, a filled rectum or a probe."
)
_CONTOURS_MATTER = (
    "The two scans show how the tissue moved; contours show where the prostate and the walls beside it are. Palpate draws them by "
    "itself: look at them before you trust a stiffness, correct them, or give contours of a person or a trained model."
)
_ROWS = (
    ("rest", "Scan at rest", "drop a folder here"),
    ("rest_labels", "    its contours", _CONTOURS),
    ("deformed", "Scan with the organ deformed", "drop a folder here"),
    ("deformed_labels", "    its contours", _CONTOURS),
    ("case", "Case folder to make", "a new folder; scans are copied, never changed"),
)


class OpenPage(QWidget):
    """opened : called when something has been opened."""

    def __init__(self, controller: Controller, opened: Callable[[], None]) -> None:
        super().__init__()
        self._controller, self._opened = controller, opened
        self.pair = Pair()
        outer = QHBoxLayout(self)
        outer.addStretch(1)
        column = QVBoxLayout()
        outer.addLayout(column, 4)
        outer.addStretch(1)
        column.addStretch(1)
        about = "Tissue stiffness from two CT scans. Research use only, not for diagnosis."
        title = QLabel(
            f"<span style='font-size:22pt'>Palpate</span><br><span style='color:{style.FAINT}'>{about}</span>"
        )
        column.addWidget(title)
        column.addSpacing(16)
        column.addWidget(QLabel("<b>New case</b>: drop the two folders with the DICOM slices here, or choose them"))
        told = QLabel(f"{_STATES}<br>{_CONTOURS_MATTER}")
        told.setWordWrap(True)
        told.setStyleSheet(f"color: {style.FAINT}")
        column.addWidget(told)
        column.addLayout(self._pair_grid())
        column.addSpacing(18)
        self._add_cases(column)
        self.problem = QLabel()
        self.problem.setWordWrap(True)
        self.problem.setStyleSheet(f"color: {style.BAD}")
        column.addWidget(self.problem)
        column.addStretch(1)
        self.refresh()

    def _add_cases(self, column: QVBoxLayout) -> None:
        """The cases of before, and what opens another one."""
        column.addWidget(QLabel("<b>Earlier cases</b>"))
        self.recent = QListWidget()
        self.recent.itemActivated.connect(lambda item: self.open_case(Path(item.data(Qt.ItemDataRole.UserRole))))
        self.recent.itemClicked.connect(lambda item: self.open_case(Path(item.data(Qt.ItemDataRole.UserRole))))
        column.addWidget(self.recent, 3)
        other = QPushButton("Open another case folder \N{HORIZONTAL ELLIPSIS}")
        other.clicked.connect(self._choose_case)
        row = QHBoxLayout()
        self.sample, self.run_sample = QPushButton("Open the finished sample"), QPushButton("Run the sample")
        self.sample.setToolTip(
            "The finished case of two simulated CTs, copied to your home folder; its report is drawn while you look"
        )
        self.sample.clicked.connect(self.open_sample)
        self.run_sample.clicked.connect(self.run_sample_pair)
        self.run_sample.setToolTip("Two simulated CTs to a report in one go, in a new case folder; some minutes")
        for button in (other, self.sample, self.run_sample):
            row.addWidget(button)
        row.addStretch(1)
        column.addLayout(row)

    def _pair_grid(self) -> QGridLayout:
        grid = QGridLayout()
        self.fields: dict[str, QLineEdit] = {}
        for row, (name, words, hint) in enumerate(_ROWS):
            field = QLineEdit()
            field.setPlaceholderText(hint)
            field.textEdited.connect(lambda text, n=name: self._typed(n, text))
            button = QPushButton("Choose \N{HORIZONTAL ELLIPSIS}")
            button.clicked.connect(lambda _=False, n=name: self._choose(n))
            grid.addWidget(QLabel(words), row, 0)
            grid.addWidget(field, row, 1)
            grid.addWidget(button, row, 2)
            self.fields[name] = field
        self.swap = QPushButton("Swap rest and deformed")
        self.swap.clicked.connect(self._swap)
        self.go = QPushButton("Open the two scans")
        self.go.setObjectName("main")
        self.go.setMinimumHeight(32)
        self.go.clicked.connect(self.open_pair)
        grid.addWidget(self.swap, len(_ROWS), 0)
        grid.addWidget(self.go, len(_ROWS), 1, 1, 2)
        line = QFrame()
        line.setFrameShape(QFrame.Shape.NoFrame)
        grid.addWidget(line, len(_ROWS) + 1, 0)
        return grid

    def refresh(self, typing: str = "") -> None:
        """Shows what is chosen, and the cases of before. typing : the field that a person types in, which is left as it is."""
        for name, field in self.fields.items():
            path = getattr(self.pair, name)
            words = "" if path is None else str(path)
            if name != typing and field.text() != words:
                field.setText(words)
        reason = self.pair.why_not()
        self.go.setEnabled(not reason)
        self.go.setToolTip(reason or "Reads both scans and aligns them on bone")
        self.recent.clear()
        for path in recent_cases():
            item = QListWidgetItem(f"{path.name}    {path.parent}")
            item.setData(Qt.ItemDataRole.UserRole, str(path))
            self.recent.addItem(item)

    def drop(self, paths: list[Path]) -> None:
        """Folders that were dropped: a case is opened, scans are filled in; two scans are opened at once."""
        case = self.pair.take(paths)
        self.problem.clear()
        if case is not None:
            self.open_case(case)
        self.refresh()

    def open_pair(self) -> None:
        """Opens what is chosen."""
        pair = self.pair
        assert pair.rest is not None and pair.deformed is not None and pair.case is not None
        labels = (pair.rest_labels, pair.deformed_labels)
        self._try(lambda: self._controller.open_pair(pair.rest, pair.deformed, pair.case, labels))  # type: ignore[arg-type]

    def open_case(self, path: Path) -> None:
        """Opens a case folder."""
        self._try(lambda: self._controller.open_case(path))

    def show_problem(self, text: str) -> None:
        """Why it could not be opened."""
        self.problem.setText(text)

    def _try(self, act: Callable[[], None]) -> None:
        self.problem.clear()
        try:
            act()
        except InputError as error:
            self.problem.setText(str(error))
            return
        self._opened()

    def _typed(self, name: str, text: str) -> None:
        setattr(self.pair, name, Path(text).expanduser() if text.strip() else None)
        self.refresh(typing=name)

    def _choose(self, name: str) -> None:
        if name.endswith("_labels"):
            chosen, _ = QFileDialog.getOpenFileName(self, "Choose a file with contours")
            if chosen:
                setattr(self.pair, name, Path(chosen))
                self.refresh()
            return
        chosen = QFileDialog.getExistingDirectory(self, "Choose a folder")
        if chosen:
            setattr(self.pair, name, Path(chosen) if name != "case" else case_beside(Path(chosen) / "x"))
            if name != "case" and self.pair.case is None:
                self.pair.case = case_beside(Path(chosen))
            self.refresh()

    def open_sample(self) -> None:
        """Opens the finished sample; its report, which does not come with it, is drawn meanwhile."""
        self._try(lambda: self._controller.open_case(finished_sample(), then=("report",)))

    def run_sample_pair(self) -> None:
        """Runs the sample pair, from its scans to the report, in a new case folder."""
        self._try(lambda: self._controller.open_pair(*sample_pair(), then=STEPS))

    def _choose_case(self) -> None:
        chosen = QFileDialog.getExistingDirectory(self, "Choose a case folder")
        if chosen:
            self.open_case(Path(chosen))

    def _swap(self) -> None:
        pair = self.pair
        pair.rest, pair.deformed = pair.deformed, pair.rest
        pair.rest_labels, pair.deformed_labels = pair.deformed_labels, pair.rest_labels
        self.refresh()
