"""The blind check of the diagnosis: answers are sealed before anything is diagnosed, and opened after all is written.

Every case is diagnosed in a process of its own that is given the case's path alone. A ledger holds the SHA-256 of every answer,
written before the first diagnosis, and of every diagnosis, written before the first answer is opened again.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.errors import ConvergenceError, InputError
from palpate.core.worker.progress import Progress, silent
from palpate.segmentation.atomic import atomic_path
from palpate.segmentation.case import check_new_case, file_sha256
from palpate.segmentation.gap_cases import IN_LIBRARY, OUTSIDE_LIBRARY, Recipe, make_case
from palpate.segmentation.gap_scores import scores

_CHILD = "import sys; from palpate.segmentation import diagnose_step as d, case as c; d.run(c.CaseFolder(sys.argv[1]))"
# Strength of each effect from weak to strong: about one to ten times the noise floor.
_SIZES: Mapping[str, tuple[float, float]] = {
    "inclusion": (3.0, 25.0), "tissue_heterogeneity": (3.0, 12.0), "tissue_stiffening": (3.0, 15.0),
    "volume_change": (0.05, 0.2), "compressible_organ": (0.42, 0.28), "contour_bias": (0.4, 1.5),
    "uneven_growth": (0.1, 0.3), "tissue_fibres": (2.0, 8.0),
}  # fmt: skip


@dataclass(frozen=True)
class StudyOptions:
    """cases : how many. seed : of everything random. timeout_s : for one diagnosis."""

    cases: int = 60
    seed: int = 1
    timeout_s: float = 900.0


def run(folder: Path, options: StudyOptions | None = None, progress: Progress = silent) -> dict[str, Any]:
    """Make cases in folder/cases, answers in folder/answers, the ledger in folder/ledger.json; return figures and rows.

    A run that was stopped goes on. Raises InputError when the folder holds another study.
    """
    options = options or StudyOptions()
    cases, answers = folder / "cases", folder / "answers"
    cases.mkdir(parents=True, exist_ok=True)
    recipes = recipes_of(options)
    for k, recipe in enumerate(recipes):
        progress(0.4 * k / len(recipes), f"making {recipe.name}")
        _made(recipe, cases, answers, folder / "meshes")
    ledger = _sealed(folder, [r.name for r in recipes if (answers / f"{r.name}.json").exists()])
    for k, name in enumerate(ledger["answers"]):
        progress(0.4 + 0.58 * k / len(ledger["answers"]), f"diagnosing {name}")
        diagnosis = cases / name / "diagnosis.json"
        if not diagnosis.exists():
            _diagnosed(cases / name, options.timeout_s)
        ledger["diagnoses"][name] = file_sha256(diagnosis) if diagnosis.exists() else None
        _write(folder / "ledger.json", ledger)
    _unchanged(answers, ledger["answers"])
    pairs = [_pair(cases / name, answers / f"{name}.json") for name in ledger["answers"]]
    return scores(pairs) | {"seed": options.seed, "ledger": str(folder / "ledger.json")}


def recipes_of(options: StudyOptions) -> list[Recipe]:
    """A fifth without an effect, a fifth outside the library, a tenth with two effects, the others with one."""
    rng = np.random.default_rng(options.seed)
    out = []
    for k in range(options.cases):
        kind = k % 10
        chosen: Sequence[str] = ()
        if kind in (2, 7):
            chosen = (str(rng.choice(OUTSIDE_LIBRARY)),)
        elif kind == 4:
            chosen = tuple(rng.choice(IN_LIBRARY, 2, replace=False).tolist())
        elif kind not in (0, 5):
            chosen = (str(rng.choice(IN_LIBRARY)),)
        effects = {name: _size(name, rng) for name in chosen}
        G = tuple(np.exp(rng.uniform(np.log(10.0), np.log(100.0), 2)).round(2).tolist())
        rectum, balance = float(rng.uniform(6.0, 9.5)), float(rng.uniform(0.5, 1.0))
        out.append(Recipe(f"gap_{k:03d}", int(rng.integers(2**31)), effects, (G[0], G[1]), rectum, balance))
    return out


def _size(name: str, rng: np.random.Generator) -> float:
    low, high = _SIZES[name]
    return float(low * (high / low) ** rng.uniform())


def _made(recipe: Recipe, cases: Path, answers: Path, meshes: Path) -> None:
    """Make a case that is not there; one that cannot be solved is left out, and counted as missing by its absence."""
    if (answers / f"{recipe.name}.json").exists():
        return
    check_new_case(cases / recipe.name)
    try:
        make_case(recipe, cases / recipe.name, answers, meshes)
    except ConvergenceError:
        return


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
    found = json.loads(diagnosis.read_text(encoding="utf-8")) if diagnosis.exists() else None
    return json.loads(answer.read_text(encoding="utf-8")), found


def _write(path: Path, data: Any) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
