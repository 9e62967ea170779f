"""The blind check of the diagnosis: answers are sealed before anything is diagnosed, and opened after all is written.

Every case is diagnosed in a process of its own that is given the case's path alone. A ledger holds the SHA-256 of every answer,
written before the first diagnosis, and of every diagnosis, written before the first answer is opened again.
"""

from __future__ import annotations

import itertools
import json
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.errors import ConvergenceError, InputError
from palpate.core.worker.progress import Progress, part, silent
from palpate.segmentation.atomic import atomic_path
from palpate.segmentation.case import file_sha256
from palpate.segmentation.gap_achieved import achieved
from palpate.segmentation.gap_cases import NOISE_MM, Recipe, make_case
from palpate.segmentation.gap_scores import scores
from palpate.segmentation.gap_truth.hidden import LIBRARY, OUTSIDE
from palpate.segmentation.simulate_walls import BladderSpec, RectumSpec

# A deformation that has no equilibrium is tried again so many times, easier each time.
_EASIER = 3
# Pelves, of each of which many patients are made by stretching, and the range of their two stiffnesses.
BUILDS, SHEAR_MODULI_KPA = 4, (6.0, 60.0)
_CHILD = "import sys; from palpate.segmentation import diagnose_step as d, case as c; d.run(c.CaseFolder(sys.argv[1]))"


@dataclass(frozen=True)
class StudyOptions:
    """cases : how many. seed : of everything random. workers : processes at a time. timeout_s : for one diagnosis."""

    cases: int = 60
    seed: int = 1
    workers: int = 1
    timeout_s: float = 900.0


def run(folder: Path, options: StudyOptions | None = None, progress: Progress = silent) -> dict[str, Any]:
    """Make cases in folder/cases, answers in folder/answers, the ledger in folder/ledger.json; return figures and rows.

    A run that was stopped goes on. Raises InputError when the folder holds another study.
    """
    options = options or StudyOptions()
    cases, answers = folder / "cases", folder / "answers"
    cases.mkdir(parents=True, exist_ok=True)
    recipes = recipes_of(options)
    _make_all(folder, recipes, options.workers, part(progress, 0.0, 0.4))
    ledger = _sealed(folder, [r.name for r in recipes if (answers / f"{r.name}.json").exists()])
    _diagnose_all(folder, ledger, options, part(progress, 0.4, 0.98))
    _unchanged(answers, ledger["answers"])
    pairs = [_pair(cases / name, answers / f"{name}.json") for name in ledger["answers"]]
    return scores(pairs) | {"seed": options.seed, "ledger": str(folder / "ledger.json")}


def recipes_of(options: StudyOptions) -> list[Recipe]:
    """A fifth without an effect, a fifth outside the library, a tenth with two effects, the others with one; all effects take turns."""
    rng = np.random.default_rng(options.seed)
    inside, outside = (itertools.cycle(rng.permutation(sorted(names)).tolist()) for names in (LIBRARY, OUTSIDE))
    out = []
    for k in range(options.cases):
        chosen: Sequence[str] = ()
        if k % 10 in (2, 7):
            chosen = (next(outside),)
        elif k % 10 == 4:
            chosen = tuple(rng.choice(sorted(LIBRARY), 2, replace=False).tolist())
        elif k % 10 not in (0, 5):
            chosen = (next(inside),)
        out.append(_recipe(f"gap_{k:03d}", chosen, rng))
    return out


def _recipe(name: str, chosen: Sequence[str], rng: np.random.Generator) -> Recipe:
    """Effects that leave one to ten times the contours' noise where a pelvis can show it; in one of four the rectum empties."""
    G = np.exp(rng.uniform(*np.log(SHEAR_MODULI_KPA), 2)).round(2).tolist()
    empties = rng.random() < 0.25
    return Recipe(
        name,
        int(rng.integers(2**31)),
        dict.fromkeys(chosen, 0.0),
        (G[0], G[1]),
        NOISE_MM * float(10.0 ** rng.uniform()),
        int(rng.integers(BUILDS)),
        RectumSpec(
            inflate_mm=float(rng.uniform(-6.0, -4.0) if empties else rng.uniform(5.5, 9.0)),
            bias=(float(rng.uniform(-0.4, 0.4)), float(rng.uniform(-0.2, 0.2))),
            push_mm=(
                float(rng.uniform(-1.5, 1.5)),
                float(rng.uniform(1.0, 3.0) if empties else -rng.uniform(1.0, 4.5)),
                0.0,
            ),
            middle_mm=float(rng.uniform(-8.0, 8.0)),
            half_length_mm=float(rng.uniform(28.0, 38.0)),
        ),
        BladderSpec(
            balance=float(rng.uniform(0.6, 1.0)),
            push_mm=(
                0.0,
                float(rng.uniform(0.0, 2.0)),
                float(-rng.uniform(2.0, 5.0) if empties else rng.uniform(0.0, 2.0)),
            ),
        ),
        marks=bool(rng.random() < 0.5),
    )


def _make_all(folder: Path, recipes: Sequence[Recipe], workers: int, progress: Progress) -> None:
    """Cases that are not there; one that cannot be solved however easy is left out, and counted as missing by its absence."""
    todo = [r for r in recipes if not (folder / "answers" / f"{r.name}.json").exists()]
    if workers < 2:
        for k, recipe in enumerate(todo):
            progress(k / len(todo), f"making {recipe.name}")
            _made(recipe, folder)
        return
    with ProcessPoolExecutor(workers) as pool:
        running = [pool.submit(_made, recipe, folder) for recipe in todo]
        for k, done in enumerate(as_completed(running)):
            done.result()
            progress((k + 1) / len(todo), f"made {k + 1} of {len(todo)}")


def _made(recipe: Recipe, folder: Path) -> None:
    case = folder / "cases" / recipe.name
    for k in range(_EASIER + 1):
        shutil.rmtree(case, ignore_errors=True)  # of a run that was stopped while it made this one
        try:
            make_case(_easier(recipe, k), case, folder / "answers", folder / "meshes")
            return
        except (ConvergenceError, InputError):  # no equilibrium; a bladder that cannot give off so much
            shutil.rmtree(case, ignore_errors=True)


def _easier(recipe: Recipe, k: int) -> Recipe:
    """The recipe with walls that move less, k times over."""
    share = 0.8**k
    rectum, bladder = recipe.rectum, recipe.bladder
    return replace(
        recipe,
        rectum=replace(rectum, inflate_mm=share * rectum.inflate_mm, push_mm=_scaled(rectum.push_mm, share)),
        bladder=replace(bladder, push_mm=_scaled(bladder.push_mm, share)),
    )


def _scaled(v: tuple[float, float, float], share: float) -> tuple[float, float, float]:
    return share * v[0], share * v[1], share * v[2]


def _diagnose_all(folder: Path, ledger: dict[str, Any], options: StudyOptions, progress: Progress) -> None:
    """Every case that has no diagnosis yet; the ledger gets each one's hash as it is written."""
    cases = {name: folder / "cases" / name for name in ledger["answers"]}
    with ThreadPoolExecutor(options.workers) as pool:
        running = {
            pool.submit(_diagnosed, case, options.timeout_s): name
            for name, case in cases.items()
            if not (case / "diagnosis.json").exists()
        }
        for k, done in enumerate(as_completed(running)):
            done.result()
            _note(folder, ledger, running[done])
            progress((k + 1) / len(running), f"diagnosed {k + 1} of {len(running)}")
    for name in cases:
        _note(folder, ledger, name)


def _note(folder: Path, ledger: dict[str, Any], name: str) -> None:
    diagnosis = folder / "cases" / name / "diagnosis.json"
    ledger["diagnoses"][name] = file_sha256(diagnosis) if diagnosis.exists() else None
    _write(folder / "ledger.json", ledger)


def _sealed(folder: Path, names: Sequence[str]) -> dict[str, Any]:
    """The ledger with the answers' hashes, written once. Raises InputError when one there is of other answers."""
    hashes = {name: file_sha256(folder / "answers" / f"{name}.json") for name in names}
    path = folder / "ledger.json"
    if path.exists():
        ledger: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if ledger["answers"] != hashes:
            raise InputError(f"{path} seals other answers than those beside it; give an empty folder for a new study")
        return ledger
    ledger = {"answers": hashes, "diagnoses": {}}
    _write(path, ledger)
    return ledger


def _diagnosed(case: Path, timeout_s: float) -> None:
    """Diagnose in a process that knows the case's path and nothing else; what it says goes to diagnose.log in the case."""
    with (case / "diagnose.log").open("w", encoding="utf-8") as log:
        try:
            subprocess.run(
                [sys.executable, "-c", _CHILD, str(case)],
                cwd=case,
                stdout=log,
                stderr=log,
                timeout=timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired:
            log.write("timed out\n")


def _unchanged(answers: Path, hashes: Mapping[str, str]) -> None:
    for name, sha in hashes.items():
        if file_sha256(answers / f"{name}.json") != sha:
            raise InputError(
                f"{answers / name}.json was changed after it was sealed; the study is worth nothing, start it anew"
            )


def _pair(case: Path, answer: Path) -> tuple[dict[str, Any], dict[str, Any] | None]:
    diagnosis = case / "diagnosis.json"
    truth = json.loads(answer.read_text(encoding="utf-8"))
    if not diagnosis.exists():
        return truth, None
    found = json.loads(diagnosis.read_text(encoding="utf-8"))
    surface, maps = answer.with_name(f"{answer.stem}_surface.npz"), case / str(found["where"]["map"])
    if surface.exists() and maps.exists() and len(truth["effects"]) == 1:
        with np.load(surface) as true, np.load(maps) as seen:
            effect, noise_mm = truth["effects"][0], truth["noise_mm"]
            truth["achieved"] = achieved(seen, true["points"], true["faces"], effect, noise_mm)
    return truth, found


def _write(path: Path, data: Any) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
