"""How the case is shown: arrangement, window and level, overlay, opacity, threshold, uncertainty."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QCheckBox, QDoubleSpinBox, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from palpate.ui.desktop.panels.label_rows import LabelRows
from palpate.ui.desktop.panels.panel_parts import Choice, combo, group, slider
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.display import PRESETS, SCALES
from palpate.ui.pictures.colours import COLOUR_MAPS

_MODES = (
    ("rest", "Rest", "The scan at rest"),
    ("deformed", "Deformed", "The deformed scan, aligned on bone"),
    ("side by side", "Both", "Both scans side by side, at the same place"),
    ("blend", "Blend", "One scan over the other"),
)
_OVERLAYS = (
    ("labels", "Labels", "Organs in colour"),
    ("stiffness", "Stiffness", "Shear modulus of each half of the organ, kPa"),
    (
        "map",
        "Map",
        "Shear modulus within the organ at rest, kPa, smoothed; hatched where the scans cannot determine it",
    ),
    ("misfit", "Misfit", "Where the model's organ lies off the scan's, mm"),
    ("none", "None", "The scan alone"),
)
_TOOLS = (
    ("look", "Look", "Click or drag: move the crosshair (1)"),
    ("window", "Window and level", "Drag: window (sideways) and level (up and down) (5)"),
)
# The loosest setting of the uncertainty mask stands for "no limit but what cannot be told".
_NO_LIMIT_TENTHS = 60


class DisplayPanel(QWidget):
    """Controls for the fields of `Display`."""

    def __init__(self, controller: Controller) -> None:
        super().__init__()
        self._controller = controller
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._view())
        column.addWidget(self._overlay())
        self.labels = LabelRows(controller)
        column.addWidget(self.labels)

    def _view(self) -> QWidget:
        box, form = group("Arrangement")
        self.modes = Choice(_MODES, lambda mode: self._controller.show(mode=mode))
        form.addRow(self.modes)
        self.tools = Choice(_TOOLS, lambda tool: self._controller.show(tool=tool))
        form.addRow(self.tools)
        self.blend = slider(0, 100, 50, lambda v: self._controller.show(blend=v / 100.0), "Share of the deformed scan")
        form.addRow("Blend", self.blend)
        self.preset = combo(["Custom", *PRESETS], self._choose_preset, "Which Hounsfield units are black and white")
        form.addRow("Preset", self.preset)
        self.centre = slider(
            -1000, 2000, 40, lambda v: self._controller.show(centre=float(v)), "Level: HU shown as middle grey"
        )
        self.wide = slider(
            1, 4000, 400, lambda v: self._controller.show(width=float(v)), "Window: HU from black to white"
        )
        form.addRow("Window", self.wide)
        form.addRow("Level", self.centre)
        return box

    def _overlay(self) -> QWidget:
        box, form = group("Overlay")
        self.overlays = Choice(_OVERLAYS, lambda name: self._controller.show(overlay=name))
        form.addRow(self.overlays)
        self.opacity = slider(0, 100, 45, lambda v: self._controller.show(opacity=v / 100.0), "Opacity of the overlay")
        form.addRow("Opacity", self.opacity)
        self.scale = combo(SCALES, lambda name: self._controller.show(scale=name),
                           "Which stiffness has which colour: the same for every patient; the first is the report's")  # fmt: skip
        form.addRow("Scale", self.scale)
        self.colours = combo(COLOUR_MAPS, lambda name: self._controller.show(colours=name), "Colours of the stiffness")
        form.addRow("Colours", self.colours)
        self.low, self.high = self._limit(), self._limit()
        row = QHBoxLayout()
        row.addWidget(self.low)
        row.addWidget(QLabel("to"))
        row.addWidget(self.high)
        form.addRow("Show", row)
        self.sure = slider(11, _NO_LIMIT_TENTHS, _NO_LIMIT_TENTHS, self._choose_sure,
                           "Stiffness known less well is hatched, not coloured")  # fmt: skip
        self.sure_words = QLabel()
        self.sure_words.setWordWrap(True)
        self.sure_words.setMinimumHeight(2 * self.sure_words.fontMetrics().lineSpacing())  # with and without a factor
        form.addRow("Hatch", self.sure)
        form.addRow("", self.sure_words)
        self.outlines = QCheckBox("Outlines of organs")
        self.outlines.toggled.connect(lambda on: self._controller.show(outlines=on))
        form.addRow(self.outlines)
        return box

    def _limit(self) -> QDoubleSpinBox:
        out = QDoubleSpinBox()
        out.setRange(0.0, 10000.0)
        out.setDecimals(1)
        out.setSuffix(" kPa")
        out.setSpecialValueText("any")
        out.setToolTip("Threshold: stiffness outside is not coloured")
        out.valueChanged.connect(self._choose_limits)
        return out

    def _choose_preset(self, name: str) -> None:
        if name in PRESETS:
            self._controller.show(centre=PRESETS[name].centre, width=PRESETS[name].width)

    def _choose_limits(self) -> None:
        self._controller.show(low_kpa=self.low.value() or None, high_kpa=self.high.value() or None)

    def _choose_sure(self, tenths: int) -> None:
        self._controller.show(surest_factor=None if tenths >= _NO_LIMIT_TENTHS else tenths / 10.0)

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what in ("view", "case", "tools"):
            self.tools.select(self._controller.display.tool)
            self.labels.refresh()
        if what not in ("view", "case", "results"):
            return
        display, case = self._controller.display, self._controller.case
        self.modes.select(display.mode)
        self.overlays.select(display.overlay)
        for widget, value in ((self.blend, 100 * display.blend), (self.opacity, 100 * display.opacity),
                              (self.centre, display.centre), (self.wide, display.width),
                              (self.sure, 10 * (display.surest_factor or 0.1 * _NO_LIMIT_TENTHS))):  # fmt: skip
            with QSignalBlocker(widget):
                widget.setValue(round(value))
        for spin, limit in ((self.low, display.low_kpa), (self.high, display.high_kpa)):
            with QSignalBlocker(spin):
                spin.setValue(limit or 0.0)
        with QSignalBlocker(self.outlines):
            self.outlines.setChecked(display.outlines)
        named = next((name for name, preset in PRESETS.items() if preset == display.window), "Custom")
        self.preset.setCurrentText(named)  # only a person's choice is told
        self.scale.setCurrentText(display.scale)
        self.colours.setCurrentText(display.colours)
        factor = display.surest_factor
        self.sure_words.setText(
            "Hatch regions that the scans cannot determine"
            if factor is None
            else f"Hatch regions that the scans cannot determine to a factor of {factor:.1f}"
        )
        self.blend.setEnabled(display.mode == "blend")
        stiff = case is not None and bool(case.regions)
        self._enable("stiffness", stiff, "Stiffness has not been found yet; run Stiffness")
        mapped = case is not None and case.stiffness_map is not None
        self._enable("map", mapped, "No map yet; run Stiffness")
        self._enable("misfit", case is not None and case.gap is not None, "No misfit yet; run Stiffness")
        for control in (self.low, self.high, self.sure):
            control.setEnabled(stiff and display.overlay in ("stiffness", "map"))

    def _enable(self, overlay: str, possible: bool, reason: str) -> None:
        button = self.overlays.buttons[overlay]
        button.setEnabled(possible)
        button.setToolTip({o[0]: o[2] for o in _OVERLAYS}[overlay] if possible else reason)
