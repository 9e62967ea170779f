"""Cases with a hidden effect, for the blind check of the diagnosis: pelves of its own, each patient of another shape.

Laws, element, assembly and mesh are not those that diagnose: `simulator` is on scikit-fem, with quadratic displacement on a finer
mesh, and writes its laws out anew. What makes an effect there has steps where the diagnosing effects have smooth edges, and places
they do not try.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.files.atomic import atomic_path
from palpate.imaging.labels import LABELS, ORGAN_LABELS
from palpate.meshing.mesh_labels import MeshOptions, mesh_labels
from palpate.validate.blind.noise_floor import noise_floor_mm, noise_whose_floor_is
from palpate.validate.blind.patient import Made, Pose, carried_walls
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.records import Truth
from palpate.validate.blind.simulator.effects import LIBRARY
from palpate.validate.blind.simulator.fem import Body
from palpate.validate.blind.simulator.patients import Patient
from palpate.validate.blind.simulator.pelvis import Pelvis
from palpate.validate.blind.simulator.strength import TooWeak
from palpate.validate.blind.simulator.visibility import true_surfaces
from palpate.validate.blind.write_case import write_case

# Of the mesher's random numbers: no mesh of a diagnosis has it.
_SEED = 77


def simulated(recipe: Recipe, mesh_cache: Path | None = None) -> tuple[Recipe, Made]:
    """The states of a recipe, and the recipe with the sizes they have.

    Raises ConvergenceError when the deformation asked for has no equilibrium, InputError when the bladder cannot give off so much, TooWeak
    when its scans cannot show an effect above the noise floor.
    """
    source = Pelvis.of(recipe.build)
    meshed = mesh_labels(source.model_labels, MeshOptions(edge_mm=recipe.edge_mm, seed=_SEED), mesh_cache)
    patient = Patient.of(source, recipe.random(1))
    walls = carried_walls(patient, (recipe.rectum, recipe.bladder))
    body = Body(patient.made(meshed.mesh.points), meshed.mesh.cells, meshed.mesh.regions)
    pose = Pose(recipe, patient, body, meshed, walls)
    further = (
        pose.plain_further()
    )  # before the search, which takes longest: walls that cannot move so are not searched for
    if recipe.shown_mm is not None:
        recipe = replace(recipe, effects={name: pose.strength(name) for name in recipe.effects})
    made = pose.further(recipe.effects, pose.made(recipe.effects), further)
    return replace(recipe, noise_mm=_noise_mm(recipe, made)), made


def _noise_mm(recipe: Recipe, made: Made) -> float:
    """Of one contour: the recipe's, or less where its effects show less than they shall, so that they show above the noise floor.

    Raises TooWeak where the best contours that the recipe may have do not show them.
    """
    best, wanted = recipe.best_noise_mm, recipe.shown_mm
    if not recipe.effects or recipe.least_noise_mm is None or wanted is None:
        return recipe.noise_mm
    left = made.effect_mm[1]
    if left < noise_floor_mm(best):
        raise TooWeak(f"{left:.2f} mm are left")
    wished = min(recipe.noise_mm * min(left / wanted, 1.0), noise_whose_floor_is(left))
    return round(float(max(wished, best)), 3)


def make_case(recipe: Recipe, case_path: Path, answers: Path, mesh_cache: Path | None = None) -> Truth:
    """Write a label case and, in another folder, what is true of it. Returns the truth.

    Raises, and writes nothing: ConvergenceError when the deformation asked for has no equilibrium, InputError when the bladder cannot give
    off so much, TooWeak when the two stiffnesses leave less of an effect than the noise floor of the best contours.
    """
    recipe, made = simulated(recipe, mesh_cache)
    write_case(recipe, made, case_path)
    truth = _truth(recipe, made)
    answers.mkdir(parents=True, exist_ok=True)
    with atomic_path(answers / f"{recipe.name}_surface.npz") as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **_surfaces(made))  # type: ignore[arg-type]
    with atomic_path(answers / f"{recipe.name}.json") as temporary:
        temporary.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    return truth


def _truth(recipe: Recipe, made: Made) -> Truth:
    done, left = (0.0, 0.0)
    if recipe.effects:
        done, left = made.effect_mm
    truth: Truth = {
        "name": recipe.name,
        "effects": list(recipe.effects) or ["none"],
        "sizes": dict(recipe.effects),
        "instead_of": list(recipe.instead_of),
        "in_library": all(name in LIBRARY for name in recipe.effects),
        "true_G_kpa": {LABELS[label]: G for label, G in zip(ORGAN_LABELS, recipe.G, strict=True)},
        "wanted_mm": recipe.shown_mm,
        "effect_mm": done,
        "effect_left_mm": left,
        "noise_mm": recipe.noise_mm,
        "noise": recipe.contour_noise.facts(),
        "stated_noise_mm": recipe.stated_mm,
        "voxel_mm": list(recipe.voxel_mm),
        "has_fat_planes": recipe.build % 8 >= 4,
        "free_edge": recipe.free_edge,
        "centre_mm": None if made.hidden.centre is None else made.hidden.centre.tolist(),
    }
    if made.more:
        truth["states"], truth["shares"] = 1 + len(made.more), [dict(state.shares) for state in made.more]
    return truth


def _surfaces(made: Made) -> dict[str, FloatArray | IntArray]:
    """See `true_surfaces`; points_2 and so on of further states."""
    surface = true_surfaces(made.hidden, made.rest, made.deformed)
    found = {name: surface[name] for name in ("points", "at_rest", "faces")}
    for k, state in enumerate(made.more, 2):
        found[f"points_{k}"] = true_surfaces(state.hidden, made.rest, state.deformed)["points"]
    return found
