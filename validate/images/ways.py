"""Ways to an answer on one pair of scans: contours alone, images beside them, images with contours of one scan, and nothing drawn.

Every command runs in a process of its own that is given paths in the pair's folder alone.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from palpate.case.case_folder import CaseFolder
from palpate.core.files.atomic import atomic_path
from palpate.validate.sealed import run_program

# File of the pair that says that its ways were gone.
DONE, LOG = "done.json", "analysis.log"
# What a copied case does not take along.
_ANSWERS = ("identify", "diagnose", "result.json", "diagnosis.json", "mesh.vtu")


@dataclass(frozen=True)
class Run:
    """command : runs one command of the program, given the pair's folder and its words. stated_mm : the contours' error that
    cases with drawn contours state, None for none. diagnosis : whether the gap is diagnosed."""

    command: Callable[[Path, tuple[str, ...]], None]
    stated_mm: float | None = None
    diagnosis: bool = True


def contours(pair: Path, run: Run) -> None:
    """Organs drawn in both scans, the images not looked at."""
    _imported(pair, "contours", ("rest", "deformed"), run)
    _meshed(pair, "contours", run)
    _answered(pair, "contours", "--no-image", run)


def images(pair: Path, run: Run) -> None:
    """The same contours and mesh, and the motion that both images tell; a case of its own where `contours` was not gone."""
    source, case = pair / "contours", pair / "images"
    if not source.exists():
        _imported(pair, "images", ("rest", "deformed"), run)
        _meshed(pair, "images", run)
    elif not (source / "mesh.npz").exists():
        return
    elif not case.exists():
        begun = pair / "images.begun"
        shutil.rmtree(begun, ignore_errors=True)  # of a run that was stopped
        shutil.copytree(source, begun, ignore=shutil.ignore_patterns(*_ANSWERS))
        begun.rename(case)
    _answered(pair, "images", "--image", run)


def one_scan(pair: Path, run: Run) -> None:
    """Organs drawn at rest only; carried over, and their motion from the images."""
    _imported(pair, "one_scan", ("rest",), run)
    _meshed(pair, "one_scan", run)
    _answered(pair, "one_scan", "--image", run)


def automatic(pair: Path, run: Run) -> None:
    """Two CTs and nothing else."""
    _imported(pair, "automatic", (), run)
    _meshed(pair, "automatic", run)
    _answered(pair, "automatic", "--image", run)


# By name, in the order in which they are gone: `images` starts from the case of `contours` where there is one.
WAYS: Mapping[str, Callable[[Path, Run], None]] = {
    "contours": contours,
    "images": images,
    "one_scan": one_scan,
    "automatic": automatic,
}


def analyse(
    pair: Path, timeout_s: float, ways: tuple[str, ...] = (), stated_mm: float | None = None, diagnosis: bool = True
) -> None:
    """These ways on a pair, all where none is named. stated_mm, diagnosis : see `Run`.

    What the commands say goes to analysis.log; a case without result.json is a way that failed.
    """
    pair = pair.resolve()

    def command(at: Path, words: tuple[str, ...]) -> None:
        run_program([*words, "--quiet", "--workers", "1"], at, LOG, timeout_s)

    run = Run(command, stated_mm, diagnosis)
    gone = [way for way in WAYS if way in (ways or WAYS)]
    for way in gone:
        WAYS[way](pair, run)
    with atomic_path(pair / DONE) as temporary:
        temporary.write_text('{"ways": ["' + '", "'.join(gone) + '"]}\n', encoding="utf-8")


def _imported(pair: Path, case: str, drawn: tuple[str, ...], run: Run) -> None:
    if (pair / case / "case.json").exists():  # of a run that was stopped
        return
    labels = [word for state in drawn for word in (f"--{state}-labels", f"scans/contours/{state}.nii.gz")]
    run.command(pair, ("import", "scans/rest_ct", "scans/deformed_ct", "-o", case, *labels))
    if drawn and run.stated_mm is not None and (pair / case / "case.json").exists():
        folder = CaseFolder(pair / case)
        folder.write_json("case.json", replace(folder.facts, boundary_noise_sd_mm=run.stated_mm).to_dict())


def _meshed(pair: Path, case: str, run: Run) -> None:
    for command in ("segment", "mesh"):
        run.command(pair, (command, case))


def _answered(pair: Path, case: str, image: str, run: Run) -> None:
    run.command(pair, ("identify", case, "--no-map", "--method", "gauss-newton", image))
    if run.diagnosis:
        run.command(pair, ("diagnose", case, image))
