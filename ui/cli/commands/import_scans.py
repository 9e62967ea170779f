"""Makes the case folder of a pair of scans: two CTs (DICOM folders, NIfTI, NRRD, MetaImage), or two label volumes.

The deformed scan is aligned to the one at rest on bone, or by a DICOM registration that is given. The case holds copies; the
scans are not touched.
The scan at rest alone makes a case for `plan`; import both into it when there is a second.
With --surfaces, REST and DEFORMED are closed surfaces of one body (STL, OBJ, PLY, in mm), aligned on each other.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.ui.cli import further_states, import_surfaces
from palpate.ui.cli.arguments import UsageError, add_roi, no_points, roi_of
from palpate.ui.cli.console import Console
from palpate.ui.cli.steps import recorded

if TYPE_CHECKING:
    from palpate.case.step_records import ImportRecord
    from palpate.case.steps.import_scans.options import ImportOptions

NAME, HELP = "import", "two scans to a case folder, aligned on bone"


def add_arguments(parser: argparse.ArgumentParser, alone: bool = True) -> None:
    """REST DEFORMED -o CASE, and how to read them. alone : whether the scan at rest may come without the second."""
    parser.add_argument(
        "rest",
        type=Path,
        metavar="REST",
        help="scan at rest: DICOM folder, or a CT or a label volume as NIfTI, NRRD or MetaImage",
    )
    words = "scan in which the organ is deformed"
    if alone:
        parser.add_argument("deformed", type=Path, metavar="DEFORMED", nargs="?",
                            help=f"{words}; left out, the case serves `plan`")  # fmt: skip
    else:
        parser.add_argument("deformed", type=Path, metavar="DEFORMED", help=words)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="CASE", help="case folder to make")
    parser.add_argument("--surfaces", action="store_true",
                        help="REST and DEFORMED are closed surfaces: STL, OBJ or PLY, in mm")  # fmt: skip
    group = parser.add_argument_group("reading the scans")
    for state in ("rest", "deformed"):
        group.add_argument(f"--{state}-labels", type=Path, metavar="FILE",
                           help=f"labels drawn on the {state} scan, which always win: DICOM RTSTRUCT or SEG, "
                           "NIfTI, NRRD, MetaImage, ITK-SNAP workspace, .seg.nrrd of 3D Slicer")  # fmt: skip
        group.add_argument(f"--{state}-series", metavar="ID", help="which CT series, where a folder contains several")
    group.add_argument(
        "--series", metavar="ID", help="which CT series in both folders: its number in the list, or its UID's end"
    )
    add_roi(group, "which structures, segments or label numbers are an organ, e.g. prostate=Prostata")
    group.add_argument(
        "--landmarks",
        type=Path,
        metavar="CSV",
        help="matched points in both scans: columns name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z",
    )
    group.add_argument("--registration", type=Path, metavar="FILE",
                       help="rigid DICOM registration (REG) of the two scans, instead of the alignment on bone")  # fmt: skip
    group.add_argument("--name", help="the case's name, printed in the report (default: the folder's)")
    group.add_argument("--same-patient", action="store_true",
                       help="the scans are of one patient although their headers differ")  # fmt: skip
    group.add_argument(
        "--no-align", action="store_true", help="the scans lie in one frame already: do not align on bone"
    )
    further_states.add_arguments(parser)


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Imports; see `run_import` and `run_surface_import`."""
    from palpate.case.case_folder import CaseFolder  # here, because it takes seconds to load
    from palpate.case.steps.import_scans.pair import run_import

    no_points(args)
    if args.deformed is None:
        return _alone(args, console)
    if args.surfaces:
        return import_surfaces.run(args, console)
    more = further_states.states_of(args)
    with console.progress(NAME) as progress:
        summary = run_import(args.rest, args.deformed, args.output, options_of(args), progress)
    case = CaseFolder(args.output)
    with recorded(case, args):
        lines = further_states.add_states(case, more)
        return summary | {"further_states": len(more)}, "\n".join([*text_of(summary), *lines])


def _alone(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """The scan at rest alone."""
    from palpate.case.case_folder import CaseFolder
    from palpate.case.steps.import_scans.rest_only import import_alone

    of_two = ("surfaces", "deformed_labels", "deformed_series", "landmarks", "registration", "more", "same_patient")
    for name in of_two:
        if getattr(args, name):
            raise UsageError(f"--{name.replace('_', '-')} needs DEFORMED, the scan in which the organ is deformed")
    with console.progress(NAME) as progress:
        summary = import_alone(args.rest, args.output, options_of(args), progress)
    with recorded(CaseFolder(args.output), args):
        return summary, "\n".join(text_of(summary))


def options_of(args: argparse.Namespace) -> ImportOptions:
    """The import options of a command line. Raises UsageError for a malformed ``--roi``."""
    from palpate.case.steps.import_scans.options import ImportOptions

    return ImportOptions(
        name=args.name,
        series=(args.rest_series or args.series, args.deformed_series or args.series),
        labels=(args.rest_labels, args.deformed_labels),
        roi=roi_of(args.roi),
        landmarks=args.landmarks,
        same_patient=args.same_patient,
        align=not args.no_align,
        registration=args.registration,
    )


def text_of(summary: ImportRecord) -> list[str]:
    """What a person reads of an import."""
    residual = summary["residual_mm"]
    if len(summary["sources_sha256"]) == 1:
        case = shlex.quote(str(summary["case"]))
        next_step = (
            f"next    `palpate segment {case}`, then `palpate plan {case}`; with a second scan, `palpate import` both"
        )
        return [f"case    {summary['case']}, the scan at rest", *(f"note    {n}" for n in summary["notes"]), next_step]
    given = "aligned by the registration, bones agree" if "aligned_by" in summary else "aligned on bone"
    aligned = "not aligned on bone" if residual is None else f"{given} to {residual:.2f} mm rms"
    return [f"case    {summary['case']}, {aligned}", *(f"note    {note}" for note in summary["notes"])]
