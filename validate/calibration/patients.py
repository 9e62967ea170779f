"""Patients of a calibration: stiffness from the prior, then a simulated pair, written as a case and its answer."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.files.atomic import atomic_path
from palpate.imaging.labels import LABELS, ORGAN_LABELS
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.recipes import another, recipe_of
from palpate.validate.blind.simulator.effects import LIBRARY, SIZES
from palpate.validate.blind.study import make_moving_less
from palpate.validate.calibration.records import CalibrationOptions, CalibrationTruth
from palpate.validate.calibration.simulators import SIMULATORS, VOXEL_MM, solved_states
from palpate.validate.simulated.contour_noise import STATES, ContourNoise, errors_of

# The only simulator that can hide something; patients that are looked at for one that can be made.
_HIDES, _PATIENTS = "blind", 6
# Of the standard deviation that case.json states over the true one, the logarithm's standard deviation.
_MISSTATED = 0.2


def check(options: CalibrationOptions) -> None:
    """Raises InputError for a simulator or an effect that is not there."""
    if options.simulator not in SIMULATORS:
        raise InputError(f"there is no simulator {options.simulator!r}; give one of {', '.join(sorted(SIMULATORS))}")
    if options.effect is not None and options.effect not in LIBRARY:
        raise InputError(f"there is no effect {options.effect!r}; give one of {', '.join(sorted(LIBRARY))}")
    if options.effect is not None and options.simulator != _HIDES:
        raise InputError(f"the simulator {options.simulator!r} hides nothing; give --simulator {_HIDES} with --effect")


def make_patient(options: CalibrationOptions, number: int, folder: Path) -> bool:
    """FOLDER/cases/NAME and FOLDER/answers/NAME.json of one patient; whether it could be made. Nothing is done where the answer is there.

    A patient that has no equilibrium gives its place to another of the same stiffness, so that the prior stays what it is.
    """
    name = name_of(number)
    if (folder / "answers" / f"{name}.json").exists():
        return True
    rng = np.random.default_rng([options.seed, number, 81])
    low, high = np.log(options.bounds_kpa)
    left, right = np.exp(rng.uniform(low, high, 2)).tolist()
    shutil.rmtree(folder / "cases" / name, ignore_errors=True)  # of a run that was stopped
    make = _hiding if options.simulator == _HIDES else _plain
    return make(options, name, (left, right), folder, rng)


def name_of(number: int) -> str:
    """Name of a patient."""
    return f"patient_{number:04d}"


def _hiding(
    options: CalibrationOptions, name: str, G: tuple[float, float], folder: Path, rng: np.random.Generator
) -> bool:
    """The size of an effect is drawn, not searched for: whether it shows depends on the stiffness, which nothing may select."""
    chosen = () if options.effect is None else (options.effect,)
    recipe = recipe_of(name, chosen, rng)
    for _ in range(_PATIENTS):
        sizes = {effect: float(np.exp(rng.uniform(*np.log(SIZES[effect])))) for effect in chosen}
        asked = replace(recipe, G=G, bounds_kpa=options.bounds_kpa, effects=sizes, shown_mm=None, least_noise_mm=None)
        if _made(asked, folder):
            return True
        recipe = another(recipe)
    return False


def _made(recipe: Recipe, folder: Path) -> bool:
    """Whether this patient could be made."""
    try:
        make_moving_less(recipe, folder)
    except (ConvergenceError, InputError):
        return False
    return True


def _plain(
    options: CalibrationOptions, name: str, G: tuple[float, float], folder: Path, rng: np.random.Generator
) -> bool:
    try:
        states = solved_states(options.simulator, rng, G, folder / "meshes")
    except ConvergenceError:
        return False
    noise = ContourNoise.drawn(rng)
    errors = errors_of(noise, states, rng)
    across, along = (float(rng.uniform(*limits)) for limits in VOXEL_MM)
    stated = None if rng.random() < 1 / 3 else round(noise.sd_mm * float(np.exp(_MISSTATED * rng.standard_normal())), 3)
    facts = CaseFacts(
        name,
        organ_shear_modulus_bounds_kpa=options.bounds_kpa,
        boundary_noise_sd_mm=stated,
        other={"simulated": True},
    )
    case = CaseFolder.create(folder / "cases" / name, facts)
    for state in STATES:
        case.write_labels(state, errors.on(state, states.labels(state), states.grid((across, across, along))))
    truth: CalibrationTruth = {
        "name": name,
        "effects": ["none"],
        "true_G_kpa": {LABELS[label]: value for label, value in zip(ORGAN_LABELS, G, strict=True)},
    }
    with atomic_path(folder / "answers" / f"{name}.json") as temporary:
        temporary.write_text(json.dumps(truth | {"noise": noise.facts()}, indent=1) + "\n", encoding="utf-8")
    return True
