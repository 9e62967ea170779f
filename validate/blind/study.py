"""The blind check of the diagnosis: answers are sealed before anything is diagnosed, and opened after all is written.

Every case is diagnosed in a process of its own that is given the case's path alone: see `sealed`.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TypedDict

import numpy as np

from palpate.core.errors import ConvergenceError, InputError
from palpate.core.worker.progress import Progress, part, silent
from palpate.validate.blind.achieved import achieved
from palpate.validate.blind.cases import make_case
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.recipes import StudyOptions, another, easier, instead, recipes_of
from palpate.validate.blind.records import Diagnosis, Truth
from palpate.validate.blind.score_table import Scores
from palpate.validate.blind.scores import scores
from palpate.validate.blind.simulator.strength import Hopeless, TooWeak
from palpate.validate.sealed import Kind as SealedKind
from palpate.validate.sealed import SealedStudy, make_each, run_alone

# A deformation that has no equilibrium is tried again with walls that move less, so many times easier.
_EASIER = (0, 2, 4)
# Patients that are looked at for one whose scans show the effect above the noise floor, before another effect takes its place; and how
# many effects are tried.
_PATIENTS, _EFFECTS = 4, 12
_CHILD = (
    "import sys; from palpate.case import case_folder as c; from palpate.case.steps import diagnose as d; "
    "d.run(c.CaseFolder(sys.argv[1]))"
)


class Kind(TypedDict):
    """What all cases of one study have in common."""

    states: int
    effect_free: bool


class BlindTable(Scores, Kind):
    """The scores, the kind of study, and where its ledger is."""

    seed: int
    ledger: str


def run(folder: Path, options: StudyOptions | None = None, progress: Progress = silent) -> BlindTable:
    """Make cases in folder/cases, answers in folder/answers, the ledger in folder/ledger.json; return figures and rows.

    A run that was stopped goes on. Raises InputError when the folder holds another study.
    """
    options = options or StudyOptions()
    sealed = SealedStudy(folder, "diagnosis.json")
    sealed.begin(_kind(options), _kind(StudyOptions()), _flags)
    recipes = recipes_of(options)
    _make_all(folder, recipes, options.workers, part(progress, 0.0, 0.4))
    names = sealed.made([r.name for r in recipes])
    sealed.seal(names)
    sealed.analyse(names, partial(_diagnosed, timeout_s=options.timeout_s), options.workers, part(progress, 0.4, 0.98))
    sealed.check_unchanged()
    pairs = [_pair(sealed.cases / name, sealed.answers / f"{name}.json") for name in names]
    return {**scores(pairs), **_kind(options), "seed": options.seed, "ledger": str(sealed.ledger_path)}


def _make_all(folder: Path, recipes: Sequence[Recipe], workers: int, progress: Progress) -> None:
    """Cases that are not there; one of which no patient can be solved however easy is left out, and counted as missing by its absence."""
    todo = [r for r in recipes if not (folder / "answers" / f"{r.name}.json").exists()]
    make_each(partial(_made, folder=folder), todo, workers, progress)


def _made(recipe: Recipe, folder: Path) -> None:
    """One case of these effects, or of others instead where no patient shows them; none where no equilibrium is found at all."""
    for _ in range(_EFFECTS):
        for _ in range(_PATIENTS):
            try:
                make_moving_less(recipe, folder)
                return
            except Hopeless:
                break
            except (ConvergenceError, InputError, TooWeak):
                recipe = another(recipe)
        recipe = instead(recipe)


def make_moving_less(recipe: Recipe, folder: Path) -> None:
    """The case and answer of a recipe in their folders, its walls moved as little as need be. Raises as `make_case`."""
    case = folder / "cases" / recipe.name
    for k in _EASIER:
        shutil.rmtree(case, ignore_errors=True)  # of a run that was stopped while it made this one
        try:
            make_case(easier(recipe, k), case, folder / "answers", folder / "meshes")
            return
        except (ConvergenceError, InputError):  # no equilibrium; a bladder that cannot give off so much
            shutil.rmtree(case, ignore_errors=True)
            if k == _EASIER[-1]:
                raise


def _kind(options: StudyOptions) -> Kind:
    return {"states": options.states, "effect_free": options.effect_free}


def _flags(kind: SealedKind) -> str:
    return f"--states {kind['states']}" + (" --effect-free" if kind["effect_free"] else "")


def _diagnosed(case: Path, timeout_s: float) -> None:
    """Diagnose in a process that knows the case's path and nothing else; what it says goes to diagnose.log in the case."""
    case = case.resolve()  # the process begins in it
    run_alone([sys.executable, "-c", _CHILD, str(case)], case, "diagnose.log", timeout_s)


def _pair(case: Path, answer: Path) -> tuple[Truth, Diagnosis | None]:
    diagnosis = case / "diagnosis.json"
    truth: Truth = json.loads(answer.read_text(encoding="utf-8"))
    if not diagnosis.exists():
        return truth, None
    found: Diagnosis = json.loads(diagnosis.read_text(encoding="utf-8"))
    surface, maps = answer.with_name(f"{answer.stem}_surface.npz"), case / str(found["where"]["map"])
    if surface.exists() and maps.exists() and len(truth["effects"]) == 1:
        with np.load(surface) as true, np.load(maps) as seen:
            truth["achieved"] = achieved(seen, true, truth["effects"][0])
    return truth, found
