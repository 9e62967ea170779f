"""Cases with a hidden effect, for the blind check of the diagnosis: the phantom's pelvis, solved with a quadratic element.

What makes an effect here is written anew, with steps where the diagnosing effects have smooth edges and places they do not try.
The element (displacement only, quadratic, finer) is not one that diagnoses; the assembly around it and the strain-energy laws
are the program's own, so a mistake in those would not show.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.fem.materials import Material
from palpate.core.laws.fibre import with_fibres
from palpate.core.laws.grown import grown
from palpate.core.laws.stiffening import STIFFENING
from palpate.core.mesh import TetMesh
from palpate.segmentation.atomic import atomic_path
from palpate.segmentation.case import CaseFolder
from palpate.segmentation.case_facts import CaseFacts
from palpate.segmentation.labels import LABELS, ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.segmentation.meshing import MeshOptions, mesh_labels
from palpate.segmentation.simulate_contours import drawn_labels
from palpate.segmentation.simulate_solve import Stiffness, solve_deformed
from palpate.segmentation.simulate_source import LabelArray, PhantomSource, labels_on
from palpate.segmentation.simulate_walls import BladderSpec, RectumSpec, moved_walls
from palpate.segmentation.simulate_warp import BackwardMap
from palpate.segmentation.smooth_field import FloatArray
from palpate.segmentation.volume import Volume

Materials = dict[int, Material]
Change = Callable[[TetMesh, Materials, float, np.random.Generator], Materials]
NOISE_MM, NOISE_LENGTH_MM = 0.35, 6.5


@dataclass(frozen=True)
class Recipe:
    """One case: seed, the effects hidden in it (id -> size; none: {}), true G of left and right, kPa. voxel_mm : of the labels."""

    name: str
    seed: int
    effects: Mapping[str, float] = field(default_factory=dict)
    G: tuple[float, float] = (20.0, 50.0)
    rectum_mm: float = 8.0
    balance: float = 0.8
    edge_mm: float = 4.0


@dataclass(frozen=True)
class _Hidden(Stiffness):
    """Stiffness of a body with hidden effects."""

    mesh: TetMesh | None = None
    recipe: Recipe | None = None

    def materials(self) -> Materials:
        out = super().materials()
        assert self.mesh is not None and self.recipe is not None
        for name, size in self.recipe.effects.items():
            if name in CHANGES:
                out = CHANGES[name](self.mesh, out, size, effect_rng(self.recipe))
        return out


def effect_rng(recipe: Recipe) -> np.random.Generator:
    """What decides where an effect is."""
    return np.random.default_rng([recipe.seed, 5])


def make_case(recipe: Recipe, case_path: Path, answers: Path, mesh_cache: Path | None = None) -> dict[str, Any]:
    """Write a label case and, in another folder, what is true of it. Returns the truth.

    Raises ConvergenceError when the deformation asked for has no equilibrium.
    """
    source = PhantomSource()
    labels = source.model_labels
    walls = moved_walls(labels, RectumSpec(inflate_mm=recipe.rectum_mm), BladderSpec(balance=recipe.balance))
    meshed = mesh_labels(labels, MeshOptions(edge_mm=recipe.edge_mm), mesh_cache)
    organ = dict(zip(ORGAN_LABELS, recipe.G, strict=True))
    state = solve_deformed(meshed, _Hidden(organ, mesh=meshed.mesh, recipe=recipe), walls, "tied")
    warp = BackwardMap(state.space, state.u, state.boundary, {name: wall.motion for name, wall in walls.items()})
    deformed: Callable[[FloatArray], LabelArray] = lambda points: source.labels(warp.rest_points(points))  # noqa: E731
    if "contour_bias" in recipe.effects:
        deformed = widened(deformed, source.label_grid, recipe.effects["contour_bias"])
    rng = np.random.default_rng([recipe.seed, 9])
    case = CaseFolder.create(
        case_path, CaseFacts(recipe.name, boundary_noise_sd_mm=NOISE_MM, other={"simulated": True})
    )
    for name, seen in (("rest", source.labels), ("deformed", deformed)):
        case.write_labels(name, drawn_labels(seen, source.label_grid, NOISE_MM, NOISE_LENGTH_MM, rng))
    truth = {
        "name": recipe.name,
        "effects": list(recipe.effects) or ["none"],
        "sizes": dict(recipe.effects),
        "in_library": all(name in IN_LIBRARY for name in recipe.effects),
        "true_G_kpa": {LABELS[label]: G for label, G in organ.items()},
    }
    if "inclusion" in recipe.effects:
        truth["centre_mm"] = _ball(meshed.mesh, effect_rng(recipe))[1].tolist()
    answers.mkdir(parents=True, exist_ok=True)
    with atomic_path(answers / f"{recipe.name}.json") as temporary:
        temporary.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    return truth


def _centres(mesh: TetMesh) -> FloatArray:
    return np.asarray(mesh.points[mesh.cells].mean(axis=1))


def _times(mesh: TetMesh, materials: Materials, region: int, factor: FloatArray) -> Materials:
    here = mesh.regions == region
    material = materials[region]
    return {**materials, region: Material(material.law, material.per_cell(int(here.sum())) * factor[here, None])}


def _inclusion(mesh: TetMesh, materials: Materials, size: float, rng: np.random.Generator) -> Materials:
    """A ball in one half, its edge sharp; size : factor on its moduli."""
    label, centre, radius = _ball(mesh, rng)
    inside = np.linalg.norm(_centres(mesh) - centre, axis=1) < radius
    return _times(mesh, materials, label, np.where(inside, size, 1.0))


def _ball(mesh: TetMesh, rng: np.random.Generator) -> tuple[int, FloatArray, float]:
    """Label of the half it is in, centre (3,) mm, radius mm."""
    label = int(rng.choice(ORGAN_LABELS))
    centre = _centres(mesh)[mesh.regions == label].mean(axis=0) + rng.uniform(-4.0, 4.0, 3)
    return label, centre, float(rng.uniform(6.5, 9.0))


def _one_side(mesh: TetMesh, materials: Materials, size: float, rng: np.random.Generator) -> Materials:
    """Tissue beyond a plane behind or before the organ; size : factor on its moduli."""
    at = _centres(mesh)
    sign = float(rng.choice([-1.0, 1.0]))
    depth = sign * (at[:, 1] - at[np.isin(mesh.regions, ORGAN_LABELS), 1].mean()) - rng.uniform(-3.0, 6.0)
    return _times(mesh, materials, SURROUNDING_TISSUE, np.where(depth > 0.0, size, 1.0))


def _stiffening(mesh: TetMesh, materials: Materials, size: float, rng: np.random.Generator) -> Materials:
    values = np.asarray(materials[SURROUNDING_TISSUE].values, dtype=float)
    return {**materials, SURROUNDING_TISSUE: Material(STIFFENING, np.append(values, size * values[0]))}


def _growth(mesh: TetMesh, materials: Materials, size: float, rng: np.random.Generator) -> Materials:
    return {r: Material(grown(m.law, 1.0 + size), m.values) if r in ORGAN_LABELS else m for r, m in materials.items()}


def _compressible(mesh: TetMesh, materials: Materials, size: float, rng: np.random.Generator) -> Materials:
    """size : Poisson's ratio of the organ."""
    out = dict(materials)
    for r in ORGAN_LABELS:
        values = np.array(materials[r].values, dtype=float)
        G = 2.0 * (values[0] + values[1])
        values[2] = 0.5 * 2.0 * G * (1.0 + size) / (3.0 * (1.0 - 2.0 * size))
        out[r] = Material(materials[r].law, values)
    return out


def _uneven_growth(mesh: TetMesh, materials: Materials, size: float, rng: np.random.Generator) -> Materials:
    """Outside the library: one half swells and the other shrinks."""
    out = dict(materials)
    for r, ratio in zip(ORGAN_LABELS, (1.0 + size, 1.0 / (1.0 + size)), strict=True):
        out[r] = Material(grown(materials[r].law, ratio), materials[r].values)
    return out


def _tissue_fibres(mesh: TetMesh, materials: Materials, size: float, rng: np.random.Generator) -> Materials:
    """Outside the library: the tissue, not the organ, is stiffer along one direction; size : extra E over 3 G."""
    a = rng.standard_normal(3)
    values = np.asarray(materials[SURROUNDING_TISSUE].values, dtype=float)
    law = with_fibres(materials[SURROUNDING_TISSUE].law, a / np.linalg.norm(a))
    return {**materials, SURROUNDING_TISSUE: Material(law, np.append(values, 3.0 * size * values[0]))}


CHANGES: dict[str, Change] = {
    "inclusion": _inclusion, "tissue_heterogeneity": _one_side, "tissue_stiffening": _stiffening, "volume_change": _growth,
    "compressible_organ": _compressible, "uneven_growth": _uneven_growth, "tissue_fibres": _tissue_fibres,
}  # fmt: skip
OUTSIDE_LIBRARY = ("uneven_growth", "tissue_fibres")
IN_LIBRARY = (*(name for name in CHANGES if name not in OUTSIDE_LIBRARY), "contour_bias")


def widened(
    labels: Callable[[FloatArray], LabelArray], grid: Volume, offset_mm: float
) -> Callable[[FloatArray], LabelArray]:
    """Labels whose organ is drawn offset_mm too wide (negative: too tight)."""
    organ = np.isin(labels_on(labels, grid).array, ORGAN_LABELS)
    outside, inside = (ndimage.distance_transform_edt(a, sampling=grid.spacing) for a in (~organ, organ))
    distance = ndimage.gaussian_filter(outside - inside, 0.7)
    slope = np.stack(np.gradient(distance, *grid.spacing), axis=-1)
    turn = grid.affine[:3, :3] / grid.spacing

    def asked(points: FloatArray) -> LabelArray:
        index = grid.to_index(points).T
        at: NDArray[np.float64] = ndimage.map_coordinates(distance, index, order=1, mode="nearest")
        g = np.stack([ndimage.map_coordinates(slope[..., k], index, order=1, mode="nearest") for k in range(3)], axis=1)
        near = np.abs(at) < abs(offset_mm) + 3.0
        moved = points.copy()
        moved[near] = points[near] - offset_mm * (g[near] @ turn.T)
        found, plain = labels(moved), labels(points)
        organ_here = np.isin(found, ORGAN_LABELS)
        left_bare = np.isin(plain, ORGAN_LABELS) & ~organ_here
        return np.where(organ_here, found, np.where(left_bare, SURROUNDING_TISSUE, plain)).astype(np.uint8)

    return asked
