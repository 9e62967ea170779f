"""`palpate import --surfaces`: a pair of closed surfaces to a case folder."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import UsageError
from palpate.ui.cli.console import Console
from palpate.ui.cli.steps import recorded

if TYPE_CHECKING:
    from palpate.case.step_records import SurfacesRecord

_UNFIT = ("rest_labels", "deformed_labels", "roi", "rest_series", "deformed_series", "series", "same_patient")


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Imports; see `run_surface_import`. Raises UsageError for an option that is of scans only."""
    from palpate.case.case_folder import CaseFolder  # here, because it and VTK take seconds to load
    from palpate.case.steps.import_scans import surfaces

    for name in _UNFIT:
        if getattr(args, name):
            raise UsageError(f"--{name.replace('_', '-')} does not go with --surfaces; leave it out")
    options = surfaces.SurfaceImportOptions(args.name, args.landmarks, not args.no_align)
    with console.progress("import") as progress:
        summary = surfaces.run_surface_import(args.rest, args.deformed, args.output, options, progress)
    with recorded(CaseFolder(args.output), args):
        return summary, "\n".join(text_of(summary))


def text_of(summary: SurfacesRecord) -> list[str]:
    """What a person reads of an import of surfaces."""
    given, left = summary["landmarks_as_given_rms_mm"], summary["surface_rms_mm"]
    lines = [f"case    {summary['case']}, surfaces {left['rigid']:.2f} mm rms apart after alignment"]
    lines += [f"note    {note}" for note in summary["notes"]]
    lines += [f"found   {words}" for words in summary["in_words"]]
    if given is not None:
        lines.append(f"found   as the files have them, the landmarks are {given:.2f} mm rms apart")
    return [*lines, f"says    no stiffness can be determined: {summary['cannot_tell']}", f"says    {summary['next']}"]
