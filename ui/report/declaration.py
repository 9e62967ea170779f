"""The declaration of the report step."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from palpate import __version__
from palpate.case.measured.measurements import FILE as MEASUREMENTS
from palpate.case.steps.step import Step

_UI = Path(__file__).resolve().parents[1]
_DRAWING = ("words/*.py", "pictures/**/*.py", "report/**/*.py", "report/*.html")


@cache
def drawn_by() -> str:
    """The version, and SHA-256 in hex of every file that has a say in how a report looks.

    A report of other words or pictures is out of date, whatever the version's number says.
    """
    digest = hashlib.sha256()
    for path in sorted(path for pattern in _DRAWING for path in _UI.glob(pattern)):
        digest.update(f"{path.relative_to(_UI).as_posix()}\0".encode() + path.read_bytes() + b"\0")
    return f"{__version__} {digest.hexdigest()}"


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
