"""Cases with a hidden effect, for the blind check of the diagnosis: pelves of its own, each patient of another shape.

Laws, element, assembly and mesh are not those that diagnose: `gap_truth` is on scikit-fem, with quadratic displacement on a finer
mesh, and writes its laws out anew. What makes an effect there has steps where the diagnosing effects have smooth edges, and places
they do not try.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from palpate.segmentation.atomic import atomic_path
from palpate.segmentation.case import CaseFolder
from palpate.segmentation.case_facts import CaseFacts
from palpate.segmentation.gap_truth.anatomy import Carried, Patient
from palpate.segmentation.gap_truth.body import Body
from palpate.segmentation.gap_truth.hidden import LIBRARY, OUTSIDE, SIZES
from palpate.segmentation.gap_truth.pelvis import Pelvis
from palpate.segmentation.gap_truth.simulated import Simulated
from palpate.segmentation.gap_truth.states import Shown, backward, effect_mm, landmarks, shown, true_surfaces
from palpate.segmentation.gap_truth.strength import strength
from palpate.segmentation.labels import LABELS, ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.segmentation.landmarks import Landmarks, landmarks_csv
from palpate.segmentation.meshing import MeshedCase, MeshOptions, mesh_labels
from palpate.segmentation.simulate_contours import drawn_labels
from palpate.segmentation.simulate_motion import WallMotion
from palpate.segmentation.simulate_source import LabelArray, labels_on
from palpate.segmentation.simulate_walls import BladderSpec, RectumSpec, moved_walls
from palpate.segmentation.smooth_field import FloatArray
from palpate.segmentation.volume import Volume

Labels = Callable[[FloatArray], LabelArray]
# Correlation length of the contours' noise, mm.
NOISE_LENGTH_MM = 6.5
# The noise floor, over the noise of one contour: an organ's motion is the difference of two.
FLOOR = float(np.sqrt(2.0))
# A contour is moved no farther from the organ than this.
_REACH_MM = 6.0
# Of the mesher's random numbers: no mesh of a diagnosis has it.
_SEED = 77


@dataclass(frozen=True)
class Recipe:
    """One case: seed, the effects hidden in it (id -> size; none: {}), true G of left and right, kPa.

    noise_mm : standard deviation of one contour. shown_mm : what the two stiffnesses shall leave of each effect alone (rms along the
    normal); its size is then found between SIZES, and that in `effects` not used. least_noise_mm : where even the strongest shows less,
    contours are drawn better in proportion, down to this. build : of the pelvis. rectum, bladder : how far the walls move. edge_mm : of the
    mesh. marks : whether points inside the organ are given.
    """

    name: str
    seed: int
    effects: Mapping[str, float] = field(default_factory=dict)
    G: tuple[float, float] = (20.0, 50.0)
    noise_mm: float = 0.35
    shown_mm: float | None = None
    least_noise_mm: float | None = None
    build: int = 0
    rectum: RectumSpec = field(default_factory=lambda: RectumSpec(8.0))
    bladder: BladderSpec = field(default_factory=lambda: BladderSpec(balance=0.8))
    edge_mm: float = 6.5
    marks: bool = False

    def random(self, what: int) -> np.random.Generator:
        """Random numbers for one purpose."""
        return np.random.default_rng([self.seed, what])


@dataclass(frozen=True, eq=False)
class Made:
    """A simulated patient: with its effects and without, its boundary's faces, walls, and both states.

    without : (n, 3) mm, the deformed state of a plain body that was not deformed at rest.
    """

    patient: Patient
    hidden: Simulated
    plain: Simulated
    boundary: Mapping[str, NDArray[np.int64]]
    walls: Mapping[str, WallMotion]
    rest: Shown
    deformed: Shown
    without: FloatArray

    @cached_property
    def effect_mm(self) -> tuple[float, float]:
        """What is to be seen of the effects, see `states.effect_mm`."""
        return effect_mm(self.hidden, self.plain, self.boundary, self.rest, self.deformed, self.without)


def simulated(recipe: Recipe, mesh_cache: Path | None = None) -> tuple[Recipe, Made]:
    """The states of a recipe, and the recipe with the sizes they have.

    Raises ConvergenceError when the deformation asked for has no equilibrium, InputError when the bladder cannot give off so much.
    """
    source = Pelvis.of(recipe.build)
    labels = source.model_labels
    meshed = mesh_labels(labels, MeshOptions(edge_mm=recipe.edge_mm, seed=_SEED), mesh_cache)
    patient = Patient.of(source, recipe.random(1))
    moved = moved_walls(labels, recipe.rectum, recipe.bladder)
    walls = {name: Carried(wall.motion, patient) for name, wall in moved.items()}
    body = Body(patient.made(meshed.mesh.points), meshed.mesh.cells, meshed.mesh.regions)
    pose = _Pose(recipe, patient, body, meshed, walls)
    if recipe.shown_mm is not None:
        recipe = replace(recipe, effects={name: pose.strength(name) for name in recipe.effects})
    made = pose.made(recipe.effects)
    return replace(recipe, noise_mm=_noise_mm(recipe, made)), made


def _noise_mm(recipe: Recipe, made: Made) -> float:
    """Of one contour: the recipe's, or less where its effects show less than they shall."""
    least, wanted = recipe.least_noise_mm, recipe.shown_mm
    if not recipe.effects or least is None or wanted is None:
        return recipe.noise_mm
    share = min(made.effect_mm[1] / wanted, 1.0)
    return round(float(max(recipe.noise_mm * share, min(least, recipe.noise_mm))), 3)


@dataclass(frozen=True, eq=False)
class _Pose:
    """A patient whose walls are to move, before anything is hidden."""

    recipe: Recipe
    patient: Patient
    body: Body
    meshed: MeshedCase
    walls: Mapping[str, WallMotion]
    known: list[tuple[dict[str, float], Made]] = field(default_factory=list)

    @cached_property
    def _without(self) -> FloatArray:
        return shown(self._plain(), self.meshed.boundary, self.walls)[1].u

    def _plain(self) -> Simulated:
        faces, _ = self.meshed.mesh.region_boundary(ORGAN_LABELS)
        return Simulated.plain(self.body, faces, dict(zip(ORGAN_LABELS, self.recipe.G, strict=True)))

    def made(self, effects: Mapping[str, float]) -> Made:
        """With effects of these sizes."""
        alike = [(sizes, made) for sizes, made in self.known if set(sizes) == set(effects)]
        if alike and alike[-1][0] == dict(effects):
            return alike[-1][1]
        hidden = self._plain()
        for name, size in effects.items():
            (LIBRARY | OUTSIDE)[name](hidden, size, self.recipe.random(5))
        boundary = self.meshed.boundary
        near = alike[-1][1].deformed.u if alike else self._without
        states = shown(hidden, boundary, self.walls, near)
        out = Made(self.patient, hidden, self._plain(), boundary, self.walls, *states, self._without)
        self.known.append((dict(effects), out))
        return out

    def strength(self, name: str) -> float:
        """Size at which an effect alone shows what the recipe wants."""
        assert self.recipe.shown_mm is not None
        return strength(self.recipe.shown_mm, SIZES[name], lambda size: self.made({name: size}).effect_mm[1])


class TooWeak(Exception):
    """An effect that the scans of this patient cannot show."""


def make_case(
    recipe: Recipe, case_path: Path, answers: Path, mesh_cache: Path | None = None, must_show: bool = False
) -> dict[str, Any]:
    """Write a label case and, in another folder, what is true of it. Returns the truth.

    must_show : raise TooWeak, and write nothing, where the two stiffnesses leave less of the effects than the noise floor.
    Raises ConvergenceError when the deformation asked for has no equilibrium, InputError when the bladder cannot give off so much.
    """
    recipe, made = simulated(recipe, mesh_cache)
    if must_show and recipe.effects and made.effect_mm[1] < FLOOR * recipe.noise_mm:
        raise TooWeak(f"{recipe.name}: {made.effect_mm[1]:.2f} mm are left")
    _write_case(recipe, made, case_path)
    truth = _truth(recipe, made)
    answers.mkdir(parents=True, exist_ok=True)
    surface = true_surfaces(made.hidden, made.rest, made.deformed)
    with atomic_path(answers / f"{recipe.name}_surface.npz") as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, points=surface["points"], at_rest=surface["at_rest"], faces=surface["faces"])
    with atomic_path(answers / f"{recipe.name}.json") as temporary:
        temporary.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    return truth


def _write_case(recipe: Recipe, made: Made, path: Path) -> None:
    grid, rng = made.patient.grid, recipe.random(9)
    seen: dict[str, Labels] = {}
    for name, state in (("rest", made.rest), ("deformed", made.deformed)):
        warp = backward(made.hidden, made.boundary, state)
        moved = state.u.any()
        seen[name] = lambda p, w=warp, m=moved: made.patient.labels(w.rest_points(p) if m else p)  # type: ignore[misc]
    if made.hidden.offset is not None:
        seen["deformed"] = widened(seen["deformed"], grid, made.hidden.offset)
    facts = CaseFacts(recipe.name, boundary_noise_sd_mm=recipe.noise_mm, other={"simulated": True})
    case = CaseFolder.create(path, facts)
    for name, labels in seen.items():
        case.write_labels(name, drawn_labels(labels, grid, recipe.noise_mm, NOISE_LENGTH_MM, rng))
    if recipe.marks:
        at_rest, after = landmarks(made.hidden, made.rest, made.deformed, rng)
        points = Landmarks(tuple(f"mark_{k + 1}" for k in range(len(after))), at_rest, after)
        case.write_text("landmarks.csv", landmarks_csv(points, np.eye(4)))


def _truth(recipe: Recipe, made: Made) -> dict[str, Any]:
    done, left = (0.0, 0.0)
    if recipe.effects:
        done, left = made.effect_mm
    return {
        "name": recipe.name,
        "effects": list(recipe.effects) or ["none"],
        "sizes": dict(recipe.effects),
        "in_library": all(name in LIBRARY for name in recipe.effects),
        "true_G_kpa": {LABELS[label]: G for label, G in zip(ORGAN_LABELS, recipe.G, strict=True)},
        "wanted_mm": recipe.shown_mm,
        "effect_mm": done,
        "effect_left_mm": left,
        "noise_mm": recipe.noise_mm,
        "centre_mm": None if made.hidden.centre is None else made.hidden.centre.tolist(),
    }


def widened(labels: Labels, grid: Volume, offset: Callable[[FloatArray], FloatArray]) -> Labels:
    """Labels whose organ is drawn too wide by offset (k,) mm (negative: too tight), asked with its outward normals (k, 3)."""
    organ = np.isin(labels_on(labels, grid).array, ORGAN_LABELS)
    outside, inside = (ndimage.distance_transform_edt(a, sampling=grid.spacing) for a in (~organ, organ))
    distance = ndimage.gaussian_filter(outside - inside, 0.7)
    slope = np.stack(np.gradient(distance, *grid.spacing), axis=-1)
    turn = grid.affine[:3, :3] / grid.spacing

    def asked(points: FloatArray) -> LabelArray:
        index = grid.to_index(points).T
        at: NDArray[np.float64] = ndimage.map_coordinates(distance, index, order=1, mode="nearest")
        g = np.stack([ndimage.map_coordinates(slope[..., k], index, order=1, mode="nearest") for k in range(3)], axis=1)
        near = np.abs(at) < _REACH_MM
        normals = g[near] @ turn.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-9)[:, None]
        moved = points.copy()
        moved[near] = points[near] - offset(normals)[:, None] * normals
        found, plain = labels(moved), labels(points)
        organ_here = np.isin(found, ORGAN_LABELS)
        left_bare = np.isin(plain, ORGAN_LABELS) & ~organ_here
        return np.where(organ_here, found, np.where(left_bare, SURROUNDING_TISSUE, plain)).astype(np.uint8)

    return asked
