"""Identification of the same scene with another contour of the deformed organ.

The swarm's reduced model and the weights of the data are stored in the case. They give the stiffness for any deformed
surface of the organ in a fraction of a second, with the walls as the first identification settled them.
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
    """Result of a repeated identification.

    theta : (t,) as in `StiffnessParameters`. posterior : of theta. model_error_mm : estimated error of the reduced
    model at theta. points : (q, 3) mm, organ surface at rest. region : (q,) of each point. moved : (q, 3) mm, predicted
    deformed positions.
    """

    theta: FloatArray
    posterior: Posterior
    model_error_mm: float
    points: FloatArray
    region: IntArray
    moved: FloatArray


def scene_key(problem: IdentificationProblem, options: IdentifyOptions) -> str:
    """Hash of all inputs of the reduced model: the whole problem except the organ's deformed surface and landmarks."""
    arrays = problem.arrays()
    arrays["landmarks"] = problem.landmarks[:, :3]
    kept = [k for k in sorted(arrays) if not k.startswith("organ/deformed")]
    return scene_hash(
        options.boundary, options.element, float(options.split_mu), *(part for k in kept for part in (k, arrays[k]))
    )


def keep_for_again(folder: Path, misfit: Misfit, options: IdentifyOptions, fingerprint: str) -> None:
    """Write again.npz, the data weights, into `folder` beside the reduced model.

    fingerprint : that of the reduced model. Raises InputError when the file cannot be written.
    """
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
    """Stiffness of `problem` from the reduced model in `folder`; None for another scene or without a reduced model.

    Boundary "contact-force" takes its forces from the deformed surface, so its result is None.
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
    optimum = fit.fit(np.array([low + share * (high - low) for share in (0.3, 0.5, 0.7)]), bounds)
    error = float(model.error_estimate(optimum.theta))
    moved = fit.points + model.evaluate(optimum.theta)[: len(fit.points)]
    region = np.asarray(kept["region"], dtype=np.int64)
    return Again(optimum.theta, fit.posterior(optimum, bounds), error, fit.points, region, moved)


def _target(surface: Surface) -> SignedDistanceField:
    return SignedDistanceField.from_surface(surface.points, surface.faces)
