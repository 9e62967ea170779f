"""The declaration of the report step."""

from __future__ import annotations

from palpate.case.measured.measurements import FILE as MEASUREMENTS
from palpate.case.steps.step import Step
from palpate.ui.report.drawn_by import drawn_by

REPORT = Step(
    "report",
    "all results as a page and a PDF",
    (
        *("case.json", "rest.nii.gz", "deformed.nii.gz", "rest_ct", "alignment.json", "segmentation.json", "mesh.json"),
        *("import.json", "result.json", "surfaces.npz", "identify/fields.npz", "identify/stiffness_map.npz"),
        *("diagnosis.json", MEASUREMENTS),
    ),
    ("report/report.html", "report/report.pdf"),
    "palpate.ui.report.report_step:ReportOptions",
    "palpate.ui.report.report_step:run",
    program=drawn_by,
)
