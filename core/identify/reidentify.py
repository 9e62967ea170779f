"""The same scene, another deformed surface: a contour of the organ was redrawn, nothing else changed.

A swarm leaves its reduced model behind, and beside it what the data were weighed by. Together they answer for any deformed
surface of the organ in a fraction of a second, with the walls where the first identification settled them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.reduced_fit import ReducedFit
from palpate.core.inference.posterior import Posterior
from palpate.core.observe.contour_noise import Weighting
from palpate.core.problem import IdentificationProblem
from palpate.core.reduced.reduced_model import ReducedModel, scene_hash
from palpate.core.surfaces.distance_field import SignedDistanceField
from palpate.core.surfaces.surface import Surface
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint

FILE = "again.npz"


@dataclass(frozen=True, eq=False)
class Again:
    """theta (t,) as in `StiffnessParameters`, its posterior, and the reduced model's own estimate of its error at theta, mm.

    points, moved (q, 3) mm : of the organ's surface at rest and where the model puts them; region (q,) of each.
    """

    theta: FloatArray
    posterior: Posterior
    model_error_mm: float
    points: FloatArray
    region: IntArray
    moved: FloatArray


def scene_key(problem: IdentificationProblem, options: IdentifyOptions) -> str:
    """Hash of all that the reduced model depends on: of the problem but for what the second scan shows of the organ and in it."""
    arrays = problem.arrays()
    arrays["landmarks"] = problem.landmarks[:, :3]
    kept = [k for k in sorted(arrays) if not k.startswith("organ/deformed")]
    return scene_hash(
        options.boundary, options.element, float(options.split_mu), *(part for k in kept for part in (k, arrays[k]))
    )


def keep_for_again(folder: Path, misfit: Misfit, options: IdentifyOptions, fingerprint: str) -> None:
    """Write folder/again.npz beside the reduced model. fingerprint : that of the reduced model."""
    problem = misfit.scene.problem
    arrays: dict[str, NDArray[np.generic]] = {
        "points": misfit.scene.observation.points,
        "region": misfit.scene.observation.region,
        "weights": misfit.surface.covariance.astype(np.float32),
        "noise": misfit.noise.astype(np.float32),
        "bounds": misfit.scene.parameters.bounds,
        "expected": np.array(misfit.expected),
        "model": np.array(fingerprint),
    }
    save_checkpoint(folder / FILE, arrays, scene_key(problem, options))


def identify_again(folder: Path, problem: IdentificationProblem, options: IdentifyOptions) -> Again | None:
    """The stiffness of `problem`, whose scene was identified in `folder`; None where it was another scene or left no reduced model.

    Boundary "contact-force" reads its forces from the deformed surface, so None.
    """
    if options.boundary != "coupled":
        return None
    kept = load_checkpoint(folder / FILE, scene_key(problem, options))
    model = None if kept is None else ReducedModel.load(folder / "reduced.npz", str(kept["model"]))
    if kept is None or model is None:
        return None
    fit = ReducedFit(
        model,
        np.asarray(kept["points"], dtype=float),
        _target(problem.organ.deformed),
        Weighting(np.asarray(kept["weights"], dtype=float)),
        np.asarray(kept["noise"], dtype=float),
        expected=float(kept["expected"].item()),
        landmarks=problem.landmarks,
    )
    bounds = np.asarray(kept["bounds"], dtype=float)
    low, high = bounds.T
    found = fit.fit(np.array([low + share * (high - low) for share in (0.3, 0.5, 0.7)]), bounds)
    error = float(model.error_estimate(found.theta))
    moved = fit.points + model.evaluate(found.theta)[: len(fit.points)]
    region = np.asarray(kept["region"], dtype=np.int64)
    return Again(found.theta, fit.posterior(found, bounds), error, fit.points, region, moved)


def _target(surface: Surface) -> SignedDistanceField:
    return SignedDistanceField.from_surface(surface.points, surface.faces)
