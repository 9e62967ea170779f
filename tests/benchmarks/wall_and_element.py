"""What walls and element do to ln G: ``python tests/benchmarks/wall_and_element.py CASE ...``.

Each CASE is a case folder without a hidden effect that holds `truth.json` with `{"G": [left, right]}`, kPa. At the true stiffness
the residual of the plain model moves ln G, to first order and with one fixed weighting, by so much: with walls that go with what
moves them (held) and without friction (free), for the quick element and the better one.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from pathlib import Path

import numpy as np

from palpate.case.case_data import data_of
from palpate.case.case_folder import CaseFolder
from palpate.case.steps import mesh
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.forward.composition import Composition
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.fit_options import GOOD, QUICK
from palpate.core.residual.linearised_model import NOTHING, PLAIN, StateModel
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.worker.executors import one_thread

WALLS = {"held": WallMotionOptions(), "free": WallMotionOptions(drag_per_mm=0.0)}


def main() -> None:
    """Prints one JSON object a case, then the means of all halves and of what changes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+", type=Path)
    one_thread()
    moved: dict[str, list[FloatArray]] = {}
    for path in parser.parse_args().cases:
        truth = np.log(json.loads((path / "truth.json").read_text(encoding="utf-8"))["G"])
        here = moves(problem_of(path), truth)
        print(json.dumps({"case": str(path)} | {k: v.round(2).tolist() for k, v in here.items()}), flush=True)
        for name, value in here.items():
            moved.setdefault(name, []).append(value)
    mean = {name: float(np.mean(values)) for name, values in moved.items()}
    changes = {
        "free walls": mean[f"free {GOOD}"] - mean[f"held {GOOD}"],
        "quick element": mean[f"held {QUICK}"] - mean[f"held {GOOD}"],
    }
    print(json.dumps({k: round(v, 2) for k, v in (mean | changes).items()}))


def problem_of(path: Path) -> IdentificationProblem:
    """The problem of a copy of the case."""
    with tempfile.TemporaryDirectory() as folder:
        lone = shutil.copytree(path, Path(folder) / path.name, copy_function=shutil.copyfile)
        lone.chmod(0o755)
        case = CaseFolder(lone)
        if not case.has("mesh.json"):
            mesh.run(case)
        return data_of(case).problem


def moves(problem: IdentificationProblem, theta: FloatArray) -> dict[str, FloatArray]:
    """ln G found less its truth (t,), by walls and element. Raises ConvergenceError without an equilibrium at theta."""
    options, weighting, out = NoiseModelOptions(), None, {}
    for walls, how in WALLS.items():
        for element in (GOOD, QUICK):
            geometry = SharedGeometry.of(problem, element, walls=how)
            data = DataVector.of(geometry.observation, None, options)
            model = StateModel(geometry, data, Composition(problem), ElementCorrection.none(data.n))
            at = model.solve(PLAIN, theta, NOTHING, None)
            if at is None:
                raise ConvergenceError(f"the plain model has no equilibrium ({walls}, {element})")
            if weighting is None:
                noise = NoiseParts.of([at], [data], options)
                weighting = Weighting(noise.covariance(NoiseSizes.of(options), np.zeros((data.n, 0))))
            r, J = weighting.whiten(at.residual), weighting.whiten(at.in_theta)
            out[f"{walls} {element}"] = -np.linalg.lstsq(J, r, rcond=None)[0]
    return out


if __name__ == "__main__":
    main()
