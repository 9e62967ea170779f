"""Studies that put figures on what is claimed.

forward: how wrong each element is and how long it takes, and the reduced model beside the full one.
gap: the blind check of the diagnosis; answers are sealed by hash before any case is diagnosed.
matching: how far local matching of two CTs finds a known motion, and whether its stated errors hold.
images: stiffness and diagnosis with and without the images, on real CTs whose second state is simulated.
calibration: ranks of the true stiffness among draws of what is said of it, for stiffnesses drawn from the prior.
meshing: angles, volumes and surfaces of meshes of contoured scans.
robustness: does every particle end in a stable equilibrium, or in a reason? Random scenes and stiffnesses.
table1, table2: the paper's tables, an organ's half with a tumour of growing size or stiffness.
sensitivity, resolution, swarm, threads, cohort: the paper's Figs 8, 11 and 12, 10, 14, 13.
drop: motion, contact and friction against closed forms; the energy of a soft ball in a dish.
map: are the errors of the map within the organ what it says, and which focus does it find?
grids: one pair's labels on five grids; do the answers agree within what they say?
coverage: do the 95 % intervals hold the truth 95 times in 100?
touch: quick answers to a probe beside the full solve, and a press on a ball beside Hertz.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.core.files.atomic import atomic_path
from palpate.core.worker.progress import Progress
from palpate.ui.cli.arguments import UsageError, add_roi, no_points, random_seed, roi_of, whole_number, workers
from palpate.ui.cli.console import Console
from palpate.ui.cli.studies import paper

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from palpate.validate.segmentation.contoured_scan import ContouredScan

Found = Mapping[str, object]
NAME, HELP = "validate", "studies of what is claimed, as JSON and pictures"
_DPI = 160
# As in `validate.images`, which is not read to parse a command line.
_HIDE, _WAYS = (
    ("inclusion", "tissue_heterogeneity", "interface_sliding", "capsule", "nothing"),
    ("contours", "images", "one_scan", "automatic"),
)


def _plain_text(found: Found) -> str:
    return "\n".join(f"{key}: {value}" for key, value in found.items() if not isinstance(value, list))


@dataclass(frozen=True)
class Study:
    """run : makes the figures. text : says them to a person. picture : draws them, where there is something to draw."""

    run: Callable[[argparse.Namespace, Progress], Found]
    text: Callable[[Any], str] = _plain_text
    picture: Callable[[Any], Figure] | None = None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """STUDY, and how large."""
    parser.add_argument("study", choices=tuple(STUDIES), metavar="STUDY", help=", ".join(STUDIES))
    parser.add_argument("--quick", action="store_true", help="the paper's studies in short, on coarse meshes")
    parser.add_argument("--patients", type=whole_number(4, 1000), default=10, metavar="N",
                        help="cohort: how many virtual patients (default %(default)s)")  # fmt: skip
    parser.add_argument("--cluster", metavar="ADDRESS",
                        help="cohort, robustness: a Dask scheduler instead of processes of this machine")  # fmt: skip
    parser.add_argument("--table", type=Path, metavar="CSV",
                        help="cohort: real cases instead, columns stage and mu_kpa")  # fmt: skip
    parser.add_argument("--scenes", type=whole_number(1, 1_000_000), default=1000, metavar="N",
                        help="robustness: how many random scenes (default %(default)s)")  # fmt: skip
    parser.add_argument("--log", type=Path, metavar="FILE",
                        help="robustness: keep every scene's outcome in this file; the same command then goes on from it")  # fmt: skip
    parser.add_argument("--cells", type=whole_number(80, 20_000), default=4000, metavar="N",
                        help="forward: about how many tetrahedra (default %(default)s)")  # fmt: skip
    parser.add_argument("--cases", type=whole_number(1, 10_000), default=60, metavar="N",
                        help="gap, calibration: how many cases (default %(default)s; each takes minutes)")  # fmt: skip
    parser.add_argument("--states", type=whole_number(1, 9), default=1, metavar="N",
                        help="gap: how many deformed states every patient has, each of another filling of rectum and bladder "
                        "(default %(default)s)")  # fmt: skip
    parser.add_argument("--effect-free", action="store_true",
                        help="gap: hide nothing in any case; are p-values uniform, and how wrong is the stiffness?")  # fmt: skip
    parser.add_argument("--simulator", default="blind", metavar="NAME",
                        help="calibration: blind, phantom or pressure (default %(default)s)")  # fmt: skip
    parser.add_argument("--effect", metavar="NAME", help="calibration: hidden in every patient (default: nothing)")
    parser.add_argument("--bounds", type=float, nargs=2, default=(5.0, 500.0), metavar=("LOW", "HIGH"),
                        help="calibration: the prior, even in the logarithm of G between these, kPa (default 5 500)")  # fmt: skip
    parser.add_argument("--folder", type=Path, default=Path("gap_study"), metavar="FOLDER",
                        help="gap, calibration, images, grids: cases, answers, ledger; goes on (default %(default)s)")  # fmt: skip
    parser.add_argument("--tets", type=whole_number(500, 500_000), default=7000, metavar="N",
                        help="meshing: about how many tetrahedra (default %(default)s)")  # fmt: skip
    parser.add_argument("--scan", type=Path, nargs=2, action="append", default=[], metavar=("CT", "CONTOURS"),
                        help="images, matching, meshing, segmentation: CT folder, contours; several times (default: phantom)")  # fmt: skip
    add_roi(parser, "meshing, segmentation: which structures of CONTOURS are an organ, e.g. rectum=RettoAno")
    parser.add_argument("--variants", type=whole_number(1, 10_000), default=0, metavar="N",
                        help="segmentation: N variants of scans and phantom in turn, with other noise, slices, HU, field, fat")  # fmt: skip
    parser.add_argument("--dice-only", action="store_true",
                        help="segmentation: no estimate of the surface errors, in half the time")  # fmt: skip
    parser.add_argument("--pairs", type=whole_number(1, 1000), default=2, metavar="N",
                        help="images, matching: how many simulated pairs of the scans; map: places of each focus "
                        "(default %(default)s)")  # fmt: skip
    parser.add_argument("--hide", action="append", default=[], choices=_HIDE, metavar="EFFECT",
                        help=f"images: hide this in a pair, in turn where several are given: {', '.join(_HIDE)}")  # fmt: skip
    parser.add_argument("--way", action="append", default=[], choices=_WAYS, metavar="WAY",
                        help=f"images: go this way only, several times: {', '.join(_WAYS)} (default: all)")  # fmt: skip
    parser.add_argument("--contour-error", type=float, nargs=2, metavar=("SD", "LENGTH"),
                        help="images: drawn contours err by SD mm over LENGTH mm, as the case states (default: 0.4, unstated)")  # fmt: skip
    parser.add_argument("--no-diagnosis", action="store_true", help="images: stiffness only, in half the time")
    parser.add_argument("--case", type=Path, action="append", default=[], metavar="CASE",
                        help="map: an identified case, whose anatomy, motion and errors the study takes; grids: one with labels "
                        "and CTs; several times")  # fmt: skip
    parser.add_argument("-o", "--output", type=Path, metavar="FILE",
                        help="write the figures to this JSON file too, and a picture beside it where the study has one")  # fmt: skip


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Runs one study."""
    from palpate.core.worker.messages import encode

    no_points(args)
    study = STUDIES[args.study]
    with console.progress(args.study) as progress:
        found = study.run(args, progress)
    if args.output is not None:
        with atomic_path(args.output) as path:
            path.write_text(encode(found) + "\n", encoding="utf-8")
        if study.picture is not None:
            with atomic_path(args.output.with_suffix(".png")) as path:
                study.picture(found).savefig(path, dpi=_DPI)
    return found, study.text(found)


def _robustness(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.validate.forward.robustness import RobustnessOptions, robustness

    options = RobustnessOptions(
        args.scenes, random_seed(args, 0), log=args.log, workers=workers(args), cluster=args.cluster
    )
    return robustness(options, progress)


def _forward(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.validate.forward.study import ForwardOptions, forward

    return forward(ForwardOptions(cells=args.cells), progress)


def _gap(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.validate.blind.recipes import StudyOptions
    from palpate.validate.blind.study import run as gap_study

    options = StudyOptions(
        cases=args.cases,
        seed=random_seed(args),
        workers=args.workers or 1,
        states=args.states,
        effect_free=args.effect_free,
    )
    return gap_study(args.folder, options, progress)


def _calibration(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.validate.calibration.records import CalibrationOptions
    from palpate.validate.calibration.study import run as calibrate

    low, high = args.bounds
    if not 0.001 <= low < high <= 1e6:
        raise UsageError(f"--bounds: {low:g} {high:g} are no bounds; give two rising numbers from 0.001 to 1e6")
    options = CalibrationOptions(
        args.cases, random_seed(args), args.workers or 1, args.simulator, args.effect, (low, high)
    )
    return calibrate(args.folder, options, progress)


def _scans(args: argparse.Namespace) -> list[ContouredScan]:
    from palpate.validate.segmentation.contoured_scan import contoured_scan, phantom_scan

    if args.roi and not args.scan:
        raise UsageError("--roi needs --scan CT CONTOURS, whose structures it names")
    roi = roi_of(args.roi)
    given = [contoured_scan(ct, contours, f"scan {k}", roi) for k, (ct, contours) in enumerate(args.scan, 1)]
    return given or [phantom_scan()]


def _meshing(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.meshing.mesh_labels import MeshOptions
    from palpate.validate.meshing_study import meshing_study

    return meshing_study(_scans(args), MeshOptions(target_tets=args.tets), progress)


def _segmentation(args: argparse.Namespace, progress: Progress) -> Found:
    if args.variants:
        from palpate.validate.segmentation.contoured_scan import phantom_scan
        from palpate.validate.segmentation.variant_study import variant_study

        scans = _scans(args)
        both = scans if not args.scan else [*scans, phantom_scan()]
        return variant_study(both, args.variants, random_seed(args), errors=not args.dice_only, progress=progress)
    from palpate.validate.segmentation.study import segmentation_study

    return segmentation_study(_scans(args), seed=random_seed(args), errors=not args.dice_only, progress=progress)


def _matching(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.validate.matching.study import matching_study

    return matching_study(_scans(args), args.pairs, random_seed(args), progress)


def _images(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.validate.images.records import ImagesOptions
    from palpate.validate.images.study import run as images

    if not args.scan:
        raise UsageError("images: give --scan CT CONTOURS, a CT whose texture is real; a phantom has none")
    scans = tuple((ct, contours) for ct, contours in args.scan)
    options = ImagesOptions(
        scans,
        args.pairs,
        random_seed(args),
        args.workers or 1,
        hide=tuple(args.hide),
        ways=tuple(args.way),
        contour_error=None if args.contour_error is None else tuple(args.contour_error),
        diagnosis=not args.no_diagnosis,
    )
    return images(args.folder, options, progress)


def _map(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.validate.stiffness_map.records import MapStudyOptions
    from palpate.validate.stiffness_map.study import map_study

    if not args.case:
        raise UsageError("map: give --case CASE, a case that `palpate identify` has answered")
    return map_study(MapStudyOptions(tuple(args.case), args.pairs, seed=random_seed(args)), progress)


def _grids(args: argparse.Namespace, progress: Progress) -> Found:
    from palpate.validate.label_grids import label_grids

    if not args.case:
        raise UsageError("grids: give --case CASE, a case with labels and two CTs")
    return label_grids(args.case, args.folder, progress=progress)


def _named(function: str) -> Callable[..., Any]:
    """The function "MODULE:NAME" of a room; the module is loaded when the function is called."""
    module, _, name = function.partition(":")
    return lambda *given: getattr(import_module(f"palpate.{module}"), name)(*given)


def _drawn(name: str, module: str = "paper_figures") -> Callable[..., Any]:
    """The picture `study_NAME` of a module of `ui.pictures.studies`."""
    return _named(f"ui.pictures.studies.{module}:study_{name}")


def _segmentation_text(found: Found) -> str:
    variants = "recipes" in found
    told = "segmentation.variant_study:variant_text" if variants else "segmentation.study:study_text"
    return str(_named(f"validate.{told}")(found))


# Studies of the room above this one are named only.
_DROP, _TOUCH = "applications.studies.drop", "applications.studies.touch"

STUDIES: dict[str, Study] = {
    "sensitivity": Study(paper.sensitivity, paper.sensitivity_text, _drawn("sensitivity")),
    "resolution": Study(paper.resolution, paper.resolution_text, _drawn("resolution")),
    "swarm": Study(paper.swarm, paper.swarm_text, _drawn("swarm")),
    "threads": Study(paper.threads, picture=_drawn("threads")),
    "cohort": Study(paper.cohort, paper.cohort_text, _drawn("cohort")),
    "coverage": Study(paper.coverage, paper.coverage_text, _drawn("coverage", "intervals")),
    "table1": Study(paper.tables, paper.tables_text, _drawn("table", "table")),
    "table2": Study(paper.tables, paper.tables_text, _drawn("table", "table")),
    "drop": Study(_named(f"{_DROP}:run"), _named(f"{_DROP}:text"), _named(f"{_DROP}:picture")),
    "gap": Study(_gap),
    "calibration": Study(_calibration, _named("validate.calibration.study:calibration_text")),
    "forward": Study(
        _forward, _named("validate.forward.study:study_text"), _named("ui.pictures.element_errors:element_errors")
    ),
    "meshing": Study(_meshing, _named("validate.meshing_study:study_text")),
    "touch": Study(_named(f"{_TOUCH}:run"), _named(f"{_TOUCH}:text")),
    "robustness": Study(_robustness),
    "segmentation": Study(_segmentation, _segmentation_text),
    "matching": Study(_matching, _named("validate.matching.study:matching_text")),
    "images": Study(_images, _named("validate.images.study:images_text")),
    "map": Study(_map, _named("validate.stiffness_map.study:study_text"), _drawn("map", "intervals")),
    "grids": Study(_grids, _named("validate.label_grids:table_text")),
}
