"""How far walls that slid along themselves put the organ off, over what the noise model says: ``python tests/benchmarks/slides.py``.

On the effect-free cases among the blind check's first ones, whose walls' true motions are known: what reading them wrongly along
themselves does to the predicted organ, to first order at the true stiffness, rms mm, and its standard deviation by `WallMotion`;
the mean squares of both should have a ratio of 1.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

from palpate.case.case_data import data_of
from palpate.case.case_folder import CaseFolder
from palpate.case.steps import mesh
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.noise_covariance import data_per_force, slide_responses
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.worker.executors import one_thread
from palpate.validate.blind.cases import simulated
from palpate.validate.blind.patient import Made
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.recipes import StudyOptions, recipes_of
from palpate.validate.blind.write_case import write_case


def main() -> None:
    """Prints one JSON object a case, then one of the mean squares' ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=45)
    parser.add_argument("--seed", type=int, default=4)
    args = parser.parse_args()
    one_thread()
    squares: dict[str, list[tuple[float, float]]] = {}
    for recipe in recipes_of(StudyOptions(args.cases, args.seed)):
        if recipe.effects:
            continue
        try:
            found = slides(recipe)
        except (ConvergenceError, InputError) as error:  # a patient that the study replaces too
            print(json.dumps({"case": recipe.name, "error": str(error)}), flush=True)
            continue
        print(json.dumps({"case": recipe.name} | {k: [round(x, 3) for x in v] for k, v in found.items()}), flush=True)
        for name, (did, said) in found.items():
            squares.setdefault(name, []).append((did**2, said**2))
    ratios = {name: np.sum(pairs, axis=0) for name, pairs in squares.items()}
    print(json.dumps({name: round(float(did / said), 2) for name, (did, said) in ratios.items()}))


def slides(recipe: Recipe) -> dict[str, tuple[float, float]]:
    """Of every wall: what its true slide does to the organ and what is said of that, rms mm. Raises what `simulated` raises."""
    recipe, made = simulated(recipe)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / recipe.name
        write_case(recipe, made, path)
        case = CaseFolder(path)
        mesh.run(case)
        problem = data_of(case).problem
    geometry = SharedGeometry.of(problem, "p1p1")
    scene, theta = CompositionScene(geometry, Composition(problem)), np.log(recipe.G)
    found = scene.settle(theta).equilibrium
    if not found.converged:
        raise ConvergenceError(f"{recipe.name}: the plain model has no equilibrium at the true stiffness")
    data = DataVector.of(geometry.observation, None, NoiseModelOptions())
    out, per_force = {}, data_per_force(scene, data, found)
    for (name, motion), wall in zip(geometry.motions.items(), scene.walls, strict=True):
        missed = _missed(made, name, wall.rest, wall.points.displacements(found.u))
        # The last field is what truly happened; both go through the same model.
        response = slide_responses(scene, per_force, wall, np.concatenate([motion.unknown_at(wall.rest), missed]))
        size = np.sqrt((response[: data.n_modes] ** 2).sum(axis=0) / len(data.modes))
        out[name] = (float(size[-1]), float(np.linalg.norm(size[:-1])))
    return out


def _missed(made: Made, name: str, rest: FloatArray, found: FloatArray) -> FloatArray:
    """(1, w, 3) mm, true motion of a wall's points less that of the model."""
    return np.asarray(made.walls[name].displacement(rest) - found)[None]


if __name__ == "__main__":
    main()
