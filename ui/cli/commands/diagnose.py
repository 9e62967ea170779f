"""Says where the model of a case is wrong, which effect it leaves out, and how far the gap shrinks once it is added."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.core.errors import InputError
from palpate.ui.cli.arguments import IMAGE_HELP, add_case, case_of, random_seed, whole_number
from palpate.ui.cli.console import Console
from palpate.ui.cli.steps import recorded

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder
    from palpate.core.diagnose.diagnosis_record import DiagnosisRecord

NAME, HELP = "diagnose", "where the model is wrong, which effect it leaves out, how far that closes the gap"
_SHOWN = 4
FALSE_ALARMS = "pairs without any hidden effect can raise such an alarm too: docs/gap.md says how often that was seen"
# As `diagnose_step.DiagnoseOptions` has them, which is not loaded for a list of options.
DEFAULT_MESHES = 1
DEFAULT_IMAGE = None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE, and effects of one's own."""
    add_case(parser)
    parser.add_argument(
        "--effects", type=Path, metavar="FOLDER", help="a folder of effects of your own, one *.py file each"
    )
    parser.add_argument(
        "--meshes", type=whole_number(1, 9), default=DEFAULT_MESHES, metavar="N",
        help="average the prediction over so many meshes of the same labels (default %(default)s)",
    )  # fmt: skip
    parser.add_argument("--image", action=argparse.BooleanOptionalAction, default=DEFAULT_IMAGE,
                        help=IMAGE_HELP)  # fmt: skip


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Diagnoses; see `diagnose_step.run`."""
    case = case_of(args)
    from palpate.case.steps import diagnose
    from palpate.core.files.json_types import plain

    if args.effects is not None and not args.effects.is_dir():
        raise InputError(f"{args.effects} is no folder; give the folder with your effects' *.py files")
    options = diagnose.DiagnoseOptions(args.effects, random_seed(args), args.meshes, image=args.image)
    with recorded(case, args), console.progress(NAME) as progress:
        found = diagnose.run(case, options, progress)
    return plain(found), "\n".join(text_of(case, found))


def text_of(case: CaseFolder, found: DiagnosisRecord) -> list[str]:
    """What a person reads of a diagnosis."""
    gap = found.gap
    lines = [
        f"gap     {gap.rms_mm:.2f} mm rms, noise alone {gap.noise_floor_mm:.2f} mm, p = {gap.p_value:.2g}",
        f"verdict {found.verdict}: {found.in_words}",
    ]
    if found.verdict != "none":
        lines.append(f"        {FALSE_ALARMS}")
        for row in found.ranking[:_SHOWN]:
            lines.append(f"        {row.effect}: probability {row.probability:.2f}")
    if found.next_measurement:
        lines.append(f"next    {found.next_measurement}")
    return [*lines, *(f"note    {flag}" for flag in found.flags), f"result  {case.file('diagnosis.json')}"]
