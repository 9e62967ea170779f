"""The whole way from two scans to a report: import, segment, mesh, identify, diagnose, report.

Each step that has been done on the same input is passed over, so that a run that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import random_seed
from palpate.ui.cli.commands import diagnose, further_states, identify, import_scans, mesh, report, segment
from palpate.ui.cli.console import Console
from palpate.ui.cli.steps import record

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder

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
        "--no-diagnosis", action="store_true", help="do not ask what the model leaves out (saves about a minute)"
    )


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Runs every step."""
    from palpate.case.case_folder import CaseFolder  # here, as all that takes long to load: help comes at once
    from palpate.case.steps import identify as identify_step
    from palpate.case.steps import mesh as mesh_step
    from palpate.case.steps.import_scans.pair import run_import
    from palpate.case.steps.segment import run_segment
    from palpate.case.steps.segment_options import SegmentOptions
    from palpate.core.files.json_types import plain
    from palpate.ui.report import report_step

    began = time.monotonic()
    # A wrong option is told before the work, not after it.
    more = further_states.states_of(args)
    search, pointed = identify.options_of(args), SegmentOptions(*segment.prompts_of(args), model=args.model)
    with console.progress(import_scans.NAME) as progress:
        imported = run_import(args.rest, args.deformed, args.output, import_scans.options_of(args), progress)
    case = CaseFolder(args.output)
    with console.progress(segment.NAME) as progress:
        labelled = run_segment(case, pointed, progress)
    states = further_states.add_states(case, more)
    with console.progress(mesh.NAME) as progress:
        meshed = mesh_step.run(case, mesh.options_of(args), progress)
    with console.progress(identify.NAME) as progress:
        found = identify_step.run(case, search, progress)
    told, said = _diagnosed(case, args, console)
    record(case, args, time.monotonic() - began)
    with console.progress(report.NAME) as progress:
        written = report_step.run(case, None, progress)
    text = [*import_scans.text_of(imported), *states, *segment.text_of(labelled), mesh.text_of(case, meshed)]
    text += [*identify.text_of(case, found), *said, *report.text_of(written)]
    data = {"case": str(case.path), "import": imported, "segment": labelled, "mesh": meshed, "result": plain(found)}
    return data | told | {"report": written}, "\n".join(text)


def _diagnosed(case: CaseFolder, args: argparse.Namespace, console: Console) -> tuple[dict[str, object], list[str]]:
    """Content of diagnosis.json under its name, and what a person reads of it.

    A case that cannot be diagnosed keeps its stiffness: the reason is a line, and there is no diagnosis.
    """
    from palpate.case.steps import diagnose as diagnose_step
    from palpate.core.errors import ConvergenceError, InputError
    from palpate.core.files.json_types import plain

    if args.no_diagnosis:
        return {}, []
    try:
        with console.progress(diagnose.NAME) as progress:
            options = diagnose_step.DiagnoseOptions(seed=random_seed(args), image=args.image)
            found = diagnose_step.run(case, options, progress)
    except (ConvergenceError, InputError) as error:
        return {}, [f"note    no diagnosis: {error}"]
    return {"diagnosis": plain(found)}, diagnose.text_of(case, found)
