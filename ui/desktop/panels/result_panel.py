"""What was found, in words and figures: stiffness with intervals, misfit, and what the diagnosis says."""

from __future__ import annotations

from html import escape

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QPushButton

from palpate.core.files.json_types import known
from palpate.ui.desktop import style
from palpate.ui.desktop.panels.panel_parts import Panel
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.open_case import OpenCase
from palpate.ui.report.diagnosis_words import says_little
from palpate.ui.report.measured_regions import YOUNG
from palpate.ui.report.summary import MISSING, NOTHING_DETERMINED
from palpate.ui.words.number_words import three_figures

_RESEARCH = "Research use only. Not for diagnosis. G is relative to the assumed stiffness of the surrounding tissue."
# Of a result with two halves and a diagnosis without a gap.
_LINES = 13
_NOTHING = f"<span style='color:{style.FAINT}'>No stiffness yet. Run Stiffness.</span>"


class ResultPanel(Panel):
    """open_report : what the button does."""

    def __init__(self, controller: Controller, open_report: object) -> None:
        super().__init__(controller, "Result")
        form = self.form
        self.words = QLabel()
        self.words.setWordWrap(True)
        self.words.setTextFormat(Qt.TextFormat.RichText)
        self.words.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        # Room for a result from the start, so that what stands below stays where it is when one comes.
        self.words.setMinimumHeight(_LINES * self.words.fontMetrics().lineSpacing())
        self.words.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        # A place of its own from the start: nothing jumps when a result becomes out of date.
        self.old = QLabel()
        self.old.setStyleSheet(f"color: {style.WARN}")
        self.old.setFixedHeight(self.old.fontMetrics().lineSpacing())
        form.addRow(self.old)
        form.addRow(self.words)
        self.report = QPushButton("Show the report")
        self.report.clicked.connect(lambda: open_report())  # type: ignore[operator]
        form.addRow(self.report)

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what not in ("case", "results", "job", "labels", "steps"):
            return
        case = self._controller.case
        old = self._controller.out_of_date("identify"), self._controller.out_of_date("report")
        has_report = case is not None and case.folder.has("report/report.html")
        self.report.setEnabled(has_report)
        self.report.setText("Show the report (out of date)" if has_report and old[1] else "Show the report")
        tip = f"It shows what was found before: {old[1]}" if old[1] else "In the web browser"
        self.report.setToolTip(tip if has_report else "There is no report yet; run Report")
        is_old = case is not None and bool(case.regions) and bool(old[0])
        self.old.setText("Out of date: found before what is there now" if is_old else "")
        self.old.setToolTip(old[0])
        words = _found(case, is_old) if case is not None and case.regions else _NOTHING
        words = _simulated(case) + _doubts(case) + words
        if words != self.words.text():  # a stroke tells often
            self.words.setText(words)


def _simulated(case: OpenCase | None) -> str:
    """That the pair is not two scans of a patient."""
    if case is None or not case.simulated:
        return ""
    return f"<span style='color:{style.WARN}'><b>Simulated</b>: {escape(case.simulated)}</span><br>"


def _doubts(case: OpenCase | None) -> str:
    """What the segmentation is not sure of, above everything that stands on it."""
    notes = [] if case is None else [n for n in case.notes_on_labels if "doubtful" in n or "no prostate" in n]
    # The window has its own way to point at an organ.
    said = [escape(note.split("; ")[0]) + ": look at its outline, correct it or point at it" for note in notes]
    return "".join(f"<span style='color:{style.WARN}'>{text}</span><br>" for text in said)


def _found(case: OpenCase, old: bool) -> str:
    """old : whether the stiffness is out of date; its words then take as much room as before."""
    rows = []
    tone = style.FAINT if old else style.TEXT
    for region in case.regions:
        if region.determined:
            interval = (
                "error not known"
                if region.ci is None
                else f"{three_figures(region.ci[0])}\N{EN DASH}{three_figures(region.ci[1])} kPa"
            )
            value = f"<b style='color:{tone}'>{three_figures(region.G)} kPa</b>"
            value += f" <span style='color:{style.FAINT}'>(E {three_figures(YOUNG * region.G)} kPa)"
            value += f"<br>95 % {interval}</span>"
        else:
            value = f"<span style='color:{style.WARN}'>the scans cannot determine it</span>"
        rows.append(f"<tr><td style='padding-right:10px'>{escape(region.words)}</td><td>{value}</td></tr>")
    misfit = None if case.result is None else case.result.misfit
    expected = None if misfit is None else known(misfit.expected_noise_rms_mm)
    beside = "" if expected is None else f" (contour error alone: {expected:.2f} mm)"
    # The values stand below it.
    parts = [_first(sentence) for sentence in case.first_words]
    parts += [f"Shear modulus G (Young's modulus E = 3 G)<table cellspacing=2>{''.join(rows)}</table>",
             f"Misfit {float('nan') if misfit is None else misfit.rms_mm:.2f} mm rms{beside}"]  # fmt: skip
    parts += _gap(case)
    parts.append(f"<span style='color:{style.FAINT}'>{_RESEARCH}</span>")
    return "<br>".join(parts)


def _first(sentence: str) -> str:
    """A sentence that stands before the values, which it need not repeat."""
    said = escape(sentence.split(": shear modulus G =")[0].rstrip(".") + ".")
    warns = sentence == NOTHING_DETERMINED or sentence.startswith(MISSING)
    return f"<span style='color:{style.WARN}'>{said}</span>" if warns else said


def _gap(case: OpenCase) -> list[str]:
    found = case.diagnosis
    if found is None:
        return []
    gap, verdict = found.gap, found.verdict
    names = ", ".join(escape(name.replace("_", " ").replace("-", " ")) for name in found.candidates)
    said = {"none": "no gap beyond the noise" + (", but a stiffness is at its bound" if says_little(found) else ""),
            "unknown": "a gap of a kind that is not known",
            "ambiguous": f"a gap, by one of: {names}" if names else "the scans show too little to see one"}  # fmt: skip
    out = [f"<b>Gap:</b> {said.get(verdict, escape(verdict.replace('_', ' ').replace('-', ' ')))}"]
    if gap.detected:
        out.append(f"{gap.rms_mm:.2f} mm rms, noise floor {gap.noise_floor_mm:.2f} mm; may be a false alarm")
    if found.next_measurement:
        out.append(f"Next: {escape(found.next_measurement)}")
    return out
