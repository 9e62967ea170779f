"""Ways to an answer on one pair of scans: contours alone, images beside them, images with contours of one scan, and nothing drawn.

Every command runs in a process of its own that is given paths in the pair's folder alone.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from palpate.core.files.atomic import atomic_path
from palpate.validate.sealed import run_alone

_COMMAND = (sys.executable, "-m", "palpate.ui.cli")
# File of the pair that says that its ways were gone.
DONE, LOG = "done.json", "analysis.log"
# What a copied case does not take along.
_ANSWERS = ("identify", "diagnose", "result.json", "diagnosis.json", "mesh.vtu")

# Runs one command of the program: the pair's folder, its words.
Run = Callable[[Path, tuple[str, ...]], None]


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


def analyse(pair: Path, timeout_s: float, ways: tuple[str, ...] = ()) -> None:
    """These ways on a pair, all where none is named.

    What the commands say goes to analysis.log; a case without result.json is a way that failed.
    """
    pair = pair.resolve()

    def run(at: Path, words: tuple[str, ...]) -> None:
        run_alone([*_COMMAND, *words, "--quiet", "--workers", "1"], at, LOG, timeout_s)

    gone = [way for way in WAYS if way in (ways or WAYS)]
    for way in gone:
        WAYS[way](pair, run)
    with atomic_path(pair / DONE) as temporary:
        temporary.write_text('{"ways": ["' + '", "'.join(gone) + '"]}\n', encoding="utf-8")


def _imported(pair: Path, case: str, drawn: tuple[str, ...], run: Run) -> None:
    if (pair / case / "case.json").exists():  # of a run that was stopped
        return
    labels = [word for state in drawn for word in (f"--{state}-labels", f"scans/contours/{state}.nii.gz")]
    run(pair, ("import", "scans/rest_ct", "scans/deformed_ct", "-o", case, *labels))


def _meshed(pair: Path, case: str, run: Run) -> None:
    for command in ("segment", "mesh"):
        run(pair, (command, case))


def _answered(pair: Path, case: str, image: str, run: Run) -> None:
    run(pair, ("identify", case, "--no-map", image))
    run(pair, ("diagnose", case, image))
