"""What is drawn of a patient of the blind check: the labels of every scan, with the contours' noise, and the points in
them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy import ndimage

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.landmarks import Landmarks, landmarks_csv
from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.labels import ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.simulate.contour_errors import labels_with_contour_errors
from palpate.simulate.source import labels_on
from palpate.validate.blind.patient import Made
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.simulator.simulated_body import Simulated
from palpate.validate.blind.simulator.states import Shown, backward
from palpate.validate.blind.simulator.visibility import marked, read_marks

Labels = Callable[[FloatArray], LabelArray]
# Correlation length of the contours' noise, mm.
NOISE_LENGTH_MM = 6.5
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
    case = CaseFolder.create(path, CaseFacts(recipe.name, boundary_noise_sd_mm=recipe.noise_mm, other=other))
    case.write_labels("rest", _drawn(recipe, made, _seen(made, made.hidden, made.rest), rng))
    case.write_labels("deformed", _drawn(recipe, made, _contoured(made, made.hidden, made.deformed), rng))
    further = {k: recipe.random(10 + k) for k in numbers}
    for k, state in zip(numbers, made.more, strict=True):
        with case.atomic_path(f"deformed_{k}.nii.gz") as temporary:
            write_labels(temporary, _drawn(recipe, made, _contoured(made, state.hidden, state.deformed), further[k]))
    if not recipe.marks:
        return
    chosen = marked(made.hidden, rng)
    at_rest = read_marks(made.hidden, chosen, made.rest, rng)  # once: it is one scan
    _write_marks(case, "landmarks.csv", at_rest, read_marks(made.hidden, chosen, made.deformed, rng))
    for k, state in zip(numbers, made.more, strict=True):
        after = read_marks(state.hidden, chosen, state.deformed, further[k])
        _write_marks(case, f"landmarks_{k}.csv", at_rest, after)


def _entry(number: int, marks: bool) -> dict[str, str]:
    """Of `states` of case.json."""
    entry = {"name": f"deformed {number}", "labels": f"deformed_{number}.nii.gz"}
    return entry | ({"landmarks": f"landmarks_{number}.csv"} if marks else {})


def _write_marks(case: CaseFolder, name: str, at_rest: FloatArray, after: FloatArray) -> None:
    points = Landmarks(tuple(f"mark_{k + 1}" for k in range(len(after))), at_rest, after)
    case.write_text(name, landmarks_csv(points, np.eye(4)))


def _seen(made: Made, hidden: Simulated, state: Shown) -> Labels:
    """Labels of points as a scan of a state shows them."""
    if not state.u.any():
        return made.patient.labels
    warp = backward(hidden, made.boundary, state)
    return lambda points: made.patient.labels(warp.rest_points(points))


def _contoured(made: Made, hidden: Simulated, state: Shown) -> Labels:
    """As somebody draws them who draws the deformed scan too wide, if so it is."""
    seen = _seen(made, hidden, state)
    return seen if hidden.offset is None else widened(seen, made.patient.grid, hidden.offset)


def _drawn(recipe: Recipe, made: Made, labels: Labels, rng: np.random.Generator) -> Volume:
    return labels_with_contour_errors(labels, made.patient.grid, recipe.noise_mm, NOISE_LENGTH_MM, rng)


def widened(labels: Labels, grid: Volume, offset: Callable[[FloatArray], FloatArray]) -> Labels:
    """Labels whose organ is drawn too wide by offset (k,) mm (negative: too tight), asked with its outward normals (k,
    3).
    """
    organ = np.isin(labels_on(labels, grid).array, ORGAN_LABELS)
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
        organ_here = np.isin(found, ORGAN_LABELS)
        left_bare = np.isin(plain, ORGAN_LABELS) & ~organ_here
        return np.where(organ_here, found, np.where(left_bare, SURROUNDING_TISSUE, plain)).astype(np.uint8)

    return asked
