"""The report step of a case: pictures, one HTML page and a PDF."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TypedDict

from palpate import __version__
from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.diagnosed import DIAGNOSIS
from palpate.case.labels_on_scan import labels_on_scan
from palpate.case.meshed import rigid_offset_of
from palpate.case.stated_files import is_body
from palpate.case.steps.step import MadeFrom
from palpate.core.errors import InputError
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.volume import Volume
from palpate.ui.report.bench_page import bench_document
from palpate.ui.report.declaration import REPORT
from palpate.ui.report.document import Document
from palpate.ui.report.figures import draw
from palpate.ui.report.html_page import html
from palpate.ui.report.pdf import write_pdf
from palpate.ui.report.record import label_volumes, read_record
from palpate.ui.report.sections import document

FOLDER = "report"


class Written(TypedDict):
    """Files of a report, and what could not be drawn and why, one line each."""

    html: str
    pdf: str | None
    pictures: list[str]
    missing: list[str]


@dataclass(frozen=True)
class ReportOptions:
    """pdf : whether to write the PDF beside the HTML page."""

    pdf: bool = True


def run(case: CaseFolder, options: ReportOptions | None = None, progress: Progress = silent) -> Written:
    """Writes report/ of a case: report.html, report.pdf and the pictures. Returns what was written, and what could not be.

    Nothing is done when neither what it shows nor what draws it has changed and nothing was missing. Raises InputError when the
    case has no result or no labels.
    """
    options = options or ReportOptions()
    version = __version__
    made_from = REPORT.made_from(case, asdict(options))
    if REPORT.is_done(case, made_from) and not _written(case)["missing"]:
        progress(1.0, "the report is up to date")
        return _written(case)
    if is_body(case):
        return _of_a_body(case, options, made_from, progress)
    if not case.has_labels("rest"):
        raise InputError(f"{case.file('rest.nii.gz')} is not there; run `palpate segment` or put labels there")
    labels = labels_in_rest_frame(case)
    record = read_record(case, labels)
    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    with case.atomic_folder(FOLDER) as folder:
        drawn = draw(case, record, labels, folder, lambda f, m: progress(0.9 * f, m))
        pages = document(record, drawn, date, version, exported_volumes(case))
        progress(0.95, "pages")
        _write(pages, folder, options)
    case.write_json(f"{FOLDER}/missing.json", drawn.missing)
    return _done(case, options, made_from, progress)


def _of_a_body(case: CaseFolder, options: ReportOptions, made_from: MadeFrom, progress: Progress) -> Written:
    """The report of a body on a bench, whose results are a diagnosis alone. Raises InputError where it has none."""
    if not case.has(DIAGNOSIS):
        raise InputError(f"{case.file(DIAGNOSIS)} is not there; run `palpate diagnose` first")
    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    with case.atomic_folder(FOLDER) as folder:
        progress(0.2, "the body in its states")
        pages = bench_document(case, folder, date, __version__)
        _write(pages, folder, options)
    case.write_json(f"{FOLDER}/missing.json", [])
    return _done(case, options, made_from, progress)


def _write(pages: Document, folder: Path, options: ReportOptions) -> None:
    Path(folder, "report.html").write_text(html(pages), encoding="utf-8")
    if options.pdf:
        write_pdf(pages, Path(folder, "report.pdf"))


def _done(case: CaseFolder, options: ReportOptions, made_from: MadeFrom, progress: Progress) -> Written:
    REPORT.mark_done(case, made_from, [f"{FOLDER}/report.html", *([f"{FOLDER}/report.pdf"] if options.pdf else [])])
    progress(1.0, "report written")
    return _written(case)


def exported_volumes(case: CaseFolder) -> dict[str, dict[str, float]]:
    """Volumes of the labels on the voxels of the CT, cc, by state and label; of the states that have both."""
    states = [state for state in STATES if case.has_labels(state) and case.has(f"{state}_ct")]
    return {state: label_volumes(labels_on_scan(case, state)) for state in states}


def labels_in_rest_frame(case: CaseFolder) -> dict[str, Volume]:
    """Of both states, as far as there are any, in the frame of the scan at rest."""
    found = {state: case.labels(state) for state in STATES if case.has_labels(state)}
    elsewhere = rigid_offset_of(case) if case.has("mesh.json") else None
    if elsewhere is not None and "deformed" in found:
        found["deformed"] = found["deformed"].moved(elsewhere.deformed_to_rest)
    return found


def _written(case: CaseFolder) -> Written:
    folder = case.file(FOLDER)
    return {
        "html": str(folder / "report.html"),
        "pdf": str(folder / "report.pdf") if (folder / "report.pdf").exists() else None,
        "pictures": sorted(str(path) for path in folder.glob("*.png")),
        "missing": case.read_json(f"{FOLDER}/missing.json"),
    }
