"""How far walls that move straight put the organ off: ``python tests/benchmarks/walls.py DATA case_004 case_006 ... [--element p2p1]``.

DATA holds `cases` and `answers`, as a folder of synthetic cases with answers does. Of each case: the plain model at the true stiffness
against the answers' displacement without an effect, rms mm along the normal, at their points.
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
from palpate.core.errors import ConvergenceError
from palpate.core.forward.composition import Composition
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.linearised_model import NOTHING, PLAIN, StateModel
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.worker.executors import one_thread


def main() -> None:
    """Prints one JSON object a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("cases", nargs="+")
    parser.add_argument("--element", default="p2p1")
    args = parser.parse_args()
    one_thread()
    for name in args.cases:
        print(json.dumps({"case": name, "rms_mm": round(error_mm(args.data, name, args.element), 3)}), flush=True)


def error_mm(data: Path, name: str, element: str) -> float:
    """rms mm; raises ConvergenceError when the model cannot be solved."""
    truth = json.loads((data / "answers" / f"{name}.json").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder:
        lone = shutil.copytree(data / "cases" / name, Path(folder) / name, copy_function=shutil.copyfile)
        lone.chmod(0o755)
        case = CaseFolder(lone)
        mesh.run(case)
        problem = data_of(case).problem
    geometry = SharedGeometry.of(problem, element)
    vector = DataVector.of(geometry.observation, None, NoiseModelOptions())
    theta = np.log([truth["true_G_kpa"][label] for label in ("1", "2")])
    point = StateModel(geometry, vector, Composition(problem), ElementCorrection.none(vector.n)).solve(
        PLAIN, theta, NOTHING, None
    )
    if point is None:
        raise ConvergenceError(f"{name}: the plain model has no equilibrium at the true stiffness")
    with np.load(data / "answers" / f"{name}_surface.npz", allow_pickle=False) as surface:
        operator = point.scene.space.interpolation(surface["surface_rest"], problem.regions)
        off = ((operator @ point.equilibrium.u - surface["u_baseline"]) * surface["normal_rest"]).sum(axis=1)
    return float(np.sqrt((off**2).mean()))


if __name__ == "__main__":
    main()
