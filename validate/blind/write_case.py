"""What is drawn of a patient of the blind check: the labels of every scan, with the contours' noise, and the points in
them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from scipy import ndimage

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.landmarks import Landmarks, landmarks_csv
from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.contours.itksnap_labels import label_description
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.labels import ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.simulate.source import labels_on
from palpate.validate.blind.patient import Made
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.simulator.simulated_body import Simulated
from palpate.validate.blind.simulator.states import Shown, backward
from palpate.validate.blind.simulator.visibility import marked, read_marks
from palpate.validate.simulated.contour_noise import COARSE_MM, STRUCTURES, ContourErrors, Scan
from palpate.validate.simulated.two_states import Labels, Points

# Rounds in which it is found where a point of a distorted scan really is.
_ROUNDS = 8
# A contour is moved no farther from the organ than this.
_REACH_MM = 6.0


def write_case(recipe: Recipe, made: Made, path: Path) -> None:
    """The case folder: labels of every state, case.json, and points where the recipe has them; each scan with errors of
    its own.
    """
    rng, numbers = recipe.random(9), range(2, 2 + len(made.more))
    other: dict[str, object] = {"simulated": True}
    if made.more:
        other["states"] = [_entry(k, recipe.marks) for k in numbers]
    edge: Literal["free", "fixed"] = "free" if recipe.free_edge else "fixed"
    facts = CaseFacts(
        recipe.name,
        organ_shear_modulus_bounds_kpa=recipe.bounds_kpa,
        boundary_noise_sd_mm=recipe.stated_mm,
        outer_surface=edge,
        other=other,
    )
    case = CaseFolder.create(path, facts)
    for name, volume in _volumes(recipe, made, rng).items():
        with case.atomic_path(f"{name}.nii.gz") as temporary:
            write_labels(temporary, volume)
    case.write_text("labels.txt", label_description())
    further = {k: recipe.random(10 + k) for k in numbers}
    if not recipe.marks:
        return
    chosen = marked(made.hidden, rng)
    at_rest = read_marks(made.hidden, chosen, made.rest, rng, recipe.marks_mm, is_rest=True)  # once: it is one scan
    _write_marks(case, "landmarks.csv", at_rest, read_marks(made.hidden, chosen, made.deformed, rng, recipe.marks_mm))
    for k, state in zip(numbers, made.more, strict=True):
        after = read_marks(state.hidden, chosen, state.deformed, further[k], recipe.marks_mm)
        _write_marks(case, f"landmarks_{k}.csv", at_rest, after)


def _entry(number: int, marks: bool) -> dict[str, str]:
    """Of `states` of case.json."""
    entry = {"name": f"deformed {number}", "labels": f"deformed_{number}.nii.gz"}
    return entry | ({"landmarks": f"landmarks_{number}.csv"} if marks else {})


def _write_marks(case: CaseFolder, name: str, at_rest: FloatArray, after: FloatArray) -> None:
    points = Landmarks(tuple(f"mark_{k + 1}" for k in range(len(after))), at_rest, after)
    case.write_text(name, landmarks_csv(points, np.eye(4)))


def _volumes(recipe: Recipe, made: Made, rng: np.random.Generator) -> dict[str, Volume]:
    """Label volumes by name, each scan's contours with errors of its own."""
    grid = made.patient.grid_of(recipe.voxel_mm)
    states = {"rest": (made.hidden, made.rest), "deformed": (made.hidden, made.deformed)}
    states |= {f"deformed_{k}": (state.hidden, state.deformed) for k, state in enumerate(made.more, 2)}
    bodies = {name: _to_body(made, hidden, state, name == "rest") for name, (hidden, state) in states.items()}
    labels = {
        name: _contoured(made, states[name][0], to_body, name == "rest", grid) for name, to_body in bodies.items()
    }
    scans = {name: Scan(labels[name], to_body) for name, to_body in bodies.items()}
    errors = ContourErrors.of(recipe.contour_noise, scans, made.patient.grid_of((COARSE_MM,) * 3), rng)
    return {name: errors.on(name, labels[name], grid) for name in states}


def _to_body(made: Made, hidden: Simulated, state: Shown, is_rest: bool) -> Points:
    """Where points of a scan of a state are in the stress-free body."""
    warp = backward(hidden, made.boundary, state) if state.u.any() else None
    scan = None if is_rest else hidden.scan

    def to_body(points: FloatArray) -> FloatArray:
        at = points
        if scan is not None:
            for _ in range(_ROUNDS):
                at = points - scan(at)
        return at if warp is None else warp.rest_points(at)

    return to_body


def _contoured(made: Made, hidden: Simulated, to_body: Points, is_rest: bool, grid: Volume) -> Labels:
    """As somebody draws them who draws an organ of the deformed scan too wide, if so it is."""

    def seen(points: FloatArray) -> LabelArray:
        return made.patient.labels(to_body(points))

    if is_rest:
        return seen
    drawn: Labels = seen if hidden.offset is None else widened(seen, grid, hidden.offset)
    for name, mm in hidden.wall_offsets.items():
        drawn = widened(drawn, grid, _everywhere(mm), STRUCTURES[name])
    return drawn


def _everywhere(mm: float) -> Callable[[FloatArray], FloatArray]:
    return lambda normals: np.full(len(normals), mm)


def widened(
    labels: Labels,
    grid: Volume,
    offset: Callable[[FloatArray], FloatArray],
    members: tuple[int, ...] = ORGAN_LABELS,
) -> Labels:
    """Labels whose organ (or whatever `members` are) is drawn too wide by offset (k,) mm (negative: too tight), asked with its outward
    normals (k, 3). It takes the place of tissue alone.
    """
    organ = np.isin(labels_on(labels, grid).array, members)
    outside, inside = (ndimage.distance_transform_edt(a, sampling=grid.spacing) for a in (~organ, organ))
    distance = ndimage.gaussian_filter(outside - inside, 0.7)
    slope = np.stack(np.gradient(distance, *grid.spacing), axis=-1)
    turn = grid.affine[:3, :3] / grid.spacing

    def asked(points: FloatArray) -> LabelArray:
        index = grid.to_index(points).T
        at: FloatArray = ndimage.map_coordinates(distance, index, order=1, mode="nearest")
        g = np.stack([ndimage.map_coordinates(slope[..., k], index, order=1, mode="nearest") for k in range(3)], axis=1)
        near = np.abs(at) < _REACH_MM
        normals = g[near] @ turn.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-9)[:, None]
        moved = points.copy()
        moved[near] = points[near] - offset(normals)[:, None] * normals
        found, plain = labels(moved), labels(points)
        here = np.isin(found, members) & (np.isin(plain, members) | (plain == SURROUNDING_TISSUE))
        left_bare = np.isin(plain, members) & ~here
        return np.where(here, found, np.where(left_bare, SURROUNDING_TISSUE, plain)).astype(np.uint8)

    return asked
