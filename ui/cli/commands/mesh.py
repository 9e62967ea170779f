"""Meshes the label volumes of a case: tetrahedra of organ and tissue, smooth surfaces of both states."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.meshing.mesh_options import MeshOptions
from palpate.ui.cli.arguments import add_case, case_of, random_seed, whole_number
from palpate.ui.cli.console import Console
from palpate.ui.cli.steps import recorded

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder
    from palpate.case.meshed import MeshReport

NAME, HELP = "mesh", "label volumes to one conforming mesh and smooth surfaces"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE, and what mesh is wanted."""
    add_case(parser)
    add_options(parser)


def add_options(parser: argparse.ArgumentParser) -> None:
    """What mesh is wanted."""
    group = parser.add_argument_group("mesh")
    group.add_argument("--tets", type=whole_number(500, 500000), default=MeshOptions.target_tets, metavar="N",
                       help="tetrahedra to aim at (default %(default)s)")  # fmt: skip


def options_of(args: argparse.Namespace) -> MeshOptions:
    """The mesh options of a command line, where seed 1 is that of a mesh nobody asked another of."""
    return MeshOptions(target_tets=args.tets, seed=max(random_seed(args) - 1, 0))


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Meshes; see `mesh_step.run`."""
    case = case_of(args)
    from palpate.case.steps import mesh

    with recorded(case, args), console.progress(NAME) as progress:
        report = mesh.run(case, options_of(args), progress)
    return report, text_of(case, report)


def text_of(case: CaseFolder, report: MeshReport) -> str:
    """What a person reads of a mesh."""
    from palpate.case.meshed import rigid_offset_of

    angle = report["min_dihedral_deg"]
    made = f"mesh    {case.file('mesh.vtu')}: {report['cells']} tetrahedra, smallest dihedral angle {angle:.0f}\N{DEGREE SIGN}"
    elsewhere = rigid_offset_of(case)
    notes = [*report.get("notes", ()), *([] if elsewhere is None else [elsewhere.words()])]
    return "\n".join([made, *(f"note    {note}" for note in notes)])
