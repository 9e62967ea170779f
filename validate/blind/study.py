"""The blind check of the diagnosis: answers are sealed before anything is diagnosed, and opened after all is written.

Every case is diagnosed in a process of its own that is given the case's path alone. A ledger holds the SHA-256 of every answer,
written before the first diagnosis, and of every diagnosis, written before the first answer is opened again.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import TypedDict

import numpy as np

from palpate.case.case_folder import file_sha256
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.worker.progress import Progress, part, silent
from palpate.validate.blind.achieved import achieved
from palpate.validate.blind.cases import make_case
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.recipes import StudyOptions, another, easier, instead, recipes_of
from palpate.validate.blind.records import Diagnosis, Truth
from palpate.validate.blind.score_table import Scores
from palpate.validate.blind.scores import scores
from palpate.validate.blind.simulator.strength import Hopeless, TooWeak

# A deformation that has no equilibrium is tried again with walls that move less, so many times easier.
_EASIER = (0, 2, 4)
# Patients that are looked at for one whose scans show the effect above the noise floor, before another effect takes its place; and how
# many effects are tried.
_PATIENTS, _EFFECTS = 2, 12
_CHILD = (
    "import sys; from palpate.case import case_folder as c; from palpate.case.steps import diagnose as d; "
    "d.run(c.CaseFolder(sys.argv[1]))"
)


class Kind(TypedDict):
    """What all cases of one study have in common."""

    states: int
    effect_free: bool


class Ledger(TypedDict, total=False):
    """Kind of the study, which an old ledger lacks; once it is sealed SHA-256 of answers and diagnoses (None: there is none), by case."""

    states: int
    effect_free: bool
    answers: dict[str, str]
    diagnoses: dict[str, str | None]


class BlindTable(Scores, Kind):
    """The scores, the kind of study, and where its ledger is."""

    seed: int
    ledger: str


def run(folder: Path, options: StudyOptions | None = None, progress: Progress = silent) -> BlindTable:
    """Make cases in folder/cases, answers in folder/answers, the ledger in folder/ledger.json; return figures and rows.

    A run that was stopped goes on. Raises InputError when the folder holds another study.
    """
    options = options or StudyOptions()
    cases, answers = folder / "cases", folder / "answers"
    cases.mkdir(parents=True, exist_ok=True)
    _begun(folder, options)
    recipes = recipes_of(options)
    _make_all(folder, recipes, options.workers, part(progress, 0.0, 0.4))
    ledger = _sealed(folder, [r.name for r in recipes if (answers / f"{r.name}.json").exists()])
    _diagnose_all(folder, ledger, options, part(progress, 0.4, 0.98))
    _unchanged(answers, ledger["answers"])
    pairs = [_pair(cases / name, answers / f"{name}.json") for name in ledger["answers"]]
    return {**scores(pairs), **_kind(options), "seed": options.seed, "ledger": str(folder / "ledger.json")}


def _make_all(folder: Path, recipes: Sequence[Recipe], workers: int, progress: Progress) -> None:
    """Cases that are not there; one of which no patient can be solved however easy is left out, and counted as missing by its absence."""
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
    """One case of these effects, or of others instead where no patient shows them; none where no equilibrium is found at all."""
    for _ in range(_EFFECTS):
        for _ in range(_PATIENTS):
            try:
                _made_of(recipe, folder)
                return
            except Hopeless:
                break
            except (ConvergenceError, InputError, TooWeak):
                recipe = another(recipe)
        recipe = instead(recipe)


def _made_of(recipe: Recipe, folder: Path) -> None:
    """This patient, its walls moved as little as need be. Raises as `make_case`."""
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


def _diagnose_all(folder: Path, ledger: Ledger, options: StudyOptions, progress: Progress) -> None:
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


def _note(folder: Path, ledger: Ledger, name: str) -> None:
    diagnosis = folder / "cases" / name / "diagnosis.json"
    ledger["diagnoses"][name] = file_sha256(diagnosis) if diagnosis.exists() else None
    _write(folder / "ledger.json", ledger)


def _kind(options: StudyOptions) -> Kind:
    return {"states": options.states, "effect_free": options.effect_free}


def _begun(folder: Path, options: StudyOptions) -> None:
    """Start the ledger, with the kind of study it is of. Raises InputError where the folder's is of another kind."""
    path, asked, first = folder / "ledger.json", _kind(options), _kind(StudyOptions())
    ledger: Ledger = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    # from before there were other kinds, or ledgers that began before the answers
    of_old = bool(ledger) or any((folder / "answers").glob("*.json"))
    told: Kind = {
        "states": ledger.get("states", first["states"]),
        "effect_free": ledger.get("effect_free", first["effect_free"]),
    }
    held = told if of_old else asked
    if held != asked:
        raise InputError(
            f"the study in {folder} was made with {_flags(held)}; give that, or an empty folder for one with {_flags(asked)}"
        )
    if not ledger:
        _write(path, asked)


def _flags(kind: Kind) -> str:
    return f"--states {kind['states']}" + (" --effect-free" if kind["effect_free"] else "")


def _sealed(folder: Path, names: Sequence[str]) -> Ledger:
    """The ledger with the answers' hashes, written once. Raises InputError when one there is of other answers."""
    hashes = {name: file_sha256(folder / "answers" / f"{name}.json") for name in names}
    path = folder / "ledger.json"
    ledger: Ledger = json.loads(path.read_text(encoding="utf-8"))
    if "answers" in ledger:
        if ledger["answers"] != hashes:
            raise InputError(f"{path} seals other answers than those beside it; give an empty folder for a new study")
        return ledger
    ledger["answers"], ledger["diagnoses"] = hashes, {}
    _write(path, ledger)
    return ledger


def _diagnosed(case: Path, timeout_s: float) -> None:
    """Diagnose in a process that knows the case's path and nothing else; what it says goes to diagnose.log in the case."""
    case = case.resolve()  # the process begins in it
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


def _write(path: Path, data: Ledger | Kind) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
