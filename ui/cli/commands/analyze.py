"""The whole way from two scans to a report: import, segment, mesh, identify, diagnose, report.

Each step that has been done on the same input is passed over, so that a run that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.ui.cli import further_states
from palpate.ui.cli.arguments import random_seed, workers
from palpate.ui.cli.commands import diagnose, identify, import_scans, mesh, report, segment
from palpate.ui.cli.console import Console
from palpate.ui.cli.steps import record

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder
    from palpate.case.steps.diagnose import DiagnoseOptions
    from palpate.ui.cli.search_and_diagnosis import Diagnosed

NAME, HELP = "analyze", "the whole way from two DICOM folders to a report"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """REST DEFORMED -o CASE and the options of every step."""
    import_scans.add_arguments(parser, alone=False)
    segment.add_options(parser)
    mesh.add_options(parser)
    identify.add_options(parser)
    add_own_options(parser)


def add_own_options(parser: argparse.ArgumentParser) -> None:
    """What no step alone has."""
    parser.add_argument(
        "--no-diagnosis", action="store_true", help="do not ask what the model leaves out (saves some seconds)"
    )


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Runs every step."""
    from palpate.case.case_folder import CaseFolder  # here, as all that takes long to load: help comes at once
    from palpate.case.steps import mesh as mesh_step
    from palpate.case.steps.import_scans.pair import run_import
    from palpate.case.steps.segment import run_segment
    from palpate.case.steps.segment_options import SegmentOptions
    from palpate.core.files.json_types import plain
    from palpate.ui.cli.search_and_diagnosis import search_and_diagnose
    from palpate.ui.report import report_step
    from palpate.ui.report.conclusions import conclusions

    began = time.monotonic()
    # A wrong option is told before the work, not after it.
    more = further_states.states_of(args)
    search = identify.options_of(args)
    pointed = SegmentOptions(*segment.prompts_of(args), model=args.model, propagate=not args.no_propagation)
    with console.progress(import_scans.NAME) as progress:
        imported = run_import(args.rest, args.deformed, args.output, import_scans.options_of(args), progress)
    case = CaseFolder(args.output)
    with console.progress(segment.NAME) as progress:
        labelled = run_segment(case, pointed, progress, workers(args))
    states = further_states.add_states(case, more)
    with console.progress(mesh.NAME) as progress:
        meshed = mesh_step.run(case, mesh.options_of(args), progress)
    found, diagnosis = search_and_diagnose(case, search, _look(args), console, workers(args) > 1)
    told, said = _told(case, diagnosis)
    record(case, args, time.monotonic() - began)
    with console.progress(report.NAME) as progress:
        written = report_step.run(case, None, progress)
    text = [*import_scans.text_of(imported), *states, *segment.text_of(labelled), mesh.text_of(case, meshed)]
    text += [*identify.text_of(case, found), *said, *report.text_of(written)]
    data = {"case": str(case.path), "import": imported, "segment": labelled, "mesh": meshed, "result": plain(found)}
    return data | told | {"conclusions": conclusions(case), "report": written}, "\n".join(text)


def _look(args: argparse.Namespace) -> DiagnoseOptions | None:
    """Options of the diagnosis; None where none is asked for."""
    from palpate.case.steps.diagnose import DiagnoseOptions

    return None if args.no_diagnosis else DiagnoseOptions(seed=random_seed(args), image=args.image, law=args.law)


def _told(case: CaseFolder, found: Diagnosed | None) -> tuple[dict[str, object], list[str]]:
    """Content of diagnosis.json under its name, and what a person reads of it."""
    from palpate.core.files.json_types import plain

    if found is None or isinstance(found, str):
        return {}, [] if found is None else [found]
    return {"diagnosis": plain(found)}, diagnose.text_of(case, found)
