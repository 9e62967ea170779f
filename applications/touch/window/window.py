"""The window of `palpate touch`: the organ on the left, what is felt on the right."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import (
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QMainWindow,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from palpate.applications.touch.window.chart import TouchChart
from palpate.applications.touch.window.model import TouchModel
from palpate.applications.touch.window.protocol import stiffness_words
from palpate.applications.touch.window.view import TouchView
from palpate.ui.desktop import style
from palpate.ui.desktop.panels.scale_bar import ScaleBar
from palpate.ui.pictures.colours import label_hex

_POLL_MS = 5
_PANEL_WIDTH = 340


class TouchWindow(QMainWindow):
    """model : what is known. output : folder in which *Save* leaves curves."""

    def __init__(self, model: TouchModel, output: Path) -> None:
        super().__init__()
        self.model, self.output = model, output
        self.view, self.chart = TouchView(model), TouchChart(model)
        self.region, self.force, self.indentation, self.slope, self.rate = (QLabel("") for _ in range(5))
        self.message = QLabel("")
        self.radius = QDoubleSpinBox()
        self.save, self.clear = QPushButton("Save the curve"), QPushButton("Forget the curve")
        self.setWindowTitle("Palpate: touch")
        self._lay_out()
        self.resize(1180, 760)
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self.tick)
        self._timer.start(_POLL_MS)

    def tick(self) -> None:
        """Takes what has come from both processes and shows it."""
        self.model.tick()
        if self.model.changed:
            self.model.changed = False
            self._tell()
            self.chart.update()
            self.view.touch_changed()
            self.view.update()
        self.view.tick()

    def shut(self) -> None:
        """Ends the processes."""
        self._timer.stop()
        self.model.close()

    def closeEvent(self, event: QCloseEvent) -> None:
        self.shut()
        super().closeEvent(event)

    def _tell(self) -> None:
        facts = self.model.facts_now
        name = None if facts is None else facts["region"]
        if facts is not None and name:
            region = next(r for r, found in self.model.body.names.items() if found == name)
            # The label's colour, as of its line in the chart; the organ itself is painted by its stiffness.
            self.region.setStyleSheet(f"border-left: 8px solid {label_hex(region)}; padding: 5px; font-weight: bold;")
            self.region.setText(f"{name.replace('_', ' ')}: {stiffness_words(facts['G_kpa'], facts['G_ci95_kpa'])}")
        else:
            self.region.setStyleSheet("padding: 5px;")
            self.region.setText("touch the organ with the left button")
        self.force.setText(f"{0.0 if facts is None else facts['force_n']:.2f} N")
        self.indentation.setText(f"{0.0 if facts is None else facts['indentation_mm']:.2f} mm")
        slope = None if facts is None else facts["stiffness_n_per_mm"]
        self.slope.setText("\N{EM DASH}" if slope is None else f"{slope:.2f} N/mm")
        solve = {"quick": "quick answers", "full": "full solve"}.get(
            "" if facts is None else facts.get("solve", ""), ""
        )
        self.rate.setText(f"{self.model.answers_per_second} a second, {solve}" if solve else "\N{EM DASH}")
        self.message.setText(self.model.said)
        for button in (self.save, self.clear):
            button.setEnabled(bool(self.model.curve))
            button.setToolTip("" if self.model.curve else "nothing has been felt yet")

    def _lay_out(self) -> None:
        panel = QWidget()
        panel.setFixedWidth(_PANEL_WIDTH)
        column = QVBoxLayout(panel)
        self.region.setWordWrap(True)
        column.addWidget(self.region)
        self.force.setStyleSheet("font-size: 30pt; font-weight: bold;")
        column.addWidget(self.force)
        column.addLayout(self._figures())
        column.addWidget(self.chart, 1)
        row = QHBoxLayout()
        self.save.clicked.connect(self._save)
        self.clear.clicked.connect(lambda: self.model.ask("forget"))
        row.addWidget(self.save)
        row.addWidget(self.clear)
        column.addLayout(row)
        about = f"Held: {self.model.held}. No friction. Stiffness is relative to the tissue's. Research use only."
        for label, colour in ((self.message, style.WARN), (QLabel(about), style.FAINT)):
            label.setWordWrap(True)
            label.setStyleSheet(f"color: {colour};")
            column.addWidget(label)
        both = QWidget()
        line = QHBoxLayout(both)
        line.setContentsMargins(0, 0, 0, 0)
        line.addWidget(self.view, 1)
        line.addWidget(ScaleBar(self.model.scale, list(self.model.body.shear_kpa.values())))
        line.addWidget(panel)
        self.setCentralWidget(both)

    def _figures(self) -> QFormLayout:
        """What is felt besides the force, and the probe."""
        form = QFormLayout()
        felt = (("indentation", self.indentation), ("local stiffness", self.slope), ("answers", self.rate))
        for words, label in felt:
            label.setStyleSheet("font-size: 12pt;")
            form.addRow(words, label)
        self.radius.setRange(2.0, 20.0)
        self.radius.setValue(self.model.radius)
        self.radius.setSuffix(" mm")
        self.radius.editingFinished.connect(self._new_probe)
        form.addRow("probe's radius", self.radius)
        return form

    def _new_probe(self) -> None:
        if self.radius.value() != self.model.radius:
            self.model.radius = self.radius.value()
            self.model.ask("radius", mm=self.model.radius)

    def _save(self) -> None:
        number = 1
        while (self.output / f"curve_{number}.csv").exists():
            number += 1
        self.model.save(self.output / f"curve_{number}")
        self.model.said = f"saved in {self.output.name}: curve_{number}.csv and .png"
        self.model.changed = True
