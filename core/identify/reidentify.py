"""Identification of the same scene with another contour of the deformed organ.

The swarm's reduced model and the weights of the data are stored in the case. They give the stiffness for any deformed
surface of the organ in a fraction of a second, with the walls as the first identification settled them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.options import IdentifyOptions
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.inference.posterior import Posterior, laplace
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.motion_observation import MotionObservation
from palpate.core.observe.motion_rows import MotionRows
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.problem import IdentificationProblem
from palpate.core.reduced.reduced_model import ReducedModel, scene_hash
from palpate.core.residual.contours_alone import misleading_contours
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.surfaces.distance_field import SignedDistanceField
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint

FILE = "again.npz"
# Starts of the search, shares of the way from the lower to the upper bound.
_STARTS = (0.3, 0.5, 0.7)
_OF_CORRECTION = ("theta", "value", "slope")
_OF_SURFACE = ("points", "normals", "region", "area")


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


def keep_for_again(folder: Path, fit: PlainFit, options: IdentifyOptions, fingerprint: str) -> None:
    """Write again.npz, the data and their weights, into `folder` beside the reduced model.

    fingerprint : that of the reduced model. Bones, which tell nothing of the stiffness, are left out. Raises InputError
    when the file cannot be written.
    """
    first, data = fit.linearisation.first, fit.model.first.data
    observation, n = first.scene.observation, data.motion.stop
    correction = fit.model.correction.of(slice(n))
    arrays: dict[str, NDArray[np.generic]] = {
        "modes": data.modes,
        "motion_covariance": data.motion_covariance,
        "weights": fit.weighting.covariance[:n, :n],
        **{f"correction/{key}": getattr(correction, key) for key in _OF_CORRECTION},
        "bounds": fit.bounds,
        "model": np.array(fingerprint),
        "untold": np.array(misleading_contours(fit)),
    }
    arrays |= {f"surface/{key}": getattr(observation, key) for key in _OF_SURFACE}
    # The reader has weighed the rows: their covariance, by far the largest of all, is not asked for again.
    rows = replace(observation.motion.rows, covariance=np.zeros((0, 0)))
    arrays |= {f"motion/rows/{key}": values for key, values in rows.arrays().items()}
    arrays["motion/reader"] = observation.motion.reader
    save_checkpoint(folder / FILE, arrays, scene_key(first.scene.problem, options))


def identify_again(folder: Path, problem: IdentificationProblem, options: IdentifyOptions) -> Again | None:
    """Stiffness of `problem` from the reduced model in `folder`; None for another scene or without a reduced model.

    Boundary "contact-force" takes its forces from the deformed surface, so its result is None. Raises ConvergenceError
    where the search has no answer, InputError where the first contours mislead: the weights are theirs.
    """
    if options.boundary != "coupled":
        return None
    kept = load_checkpoint(folder / FILE, scene_key(problem, options))
    model = None if kept is None else ReducedModel.load(folder / "reduced.npz", str(kept["model"]))
    if kept is None or model is None or "untold" not in kept:  # an earlier version did not ask
        return None
    if untold := str(kept["untold"]):
        raise InputError(f"{folder.parent}: {untold}; run `palpate identify` with them")
    misfit, bounds = _misfit(kept, problem), np.asarray(kept["bounds"], dtype=float)
    correction = ElementCorrection(*(np.asarray(kept[f"correction/{key}"], dtype=float) for key in _OF_CORRECTION))

    def linearise(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        v = [model.evaluate(theta)]
        r = misfit.residual(v, correction.at(theta))
        return r, misfit.jacobian(v, [model.gradient(theta)], correction.in_theta(theta))

    low, high = bounds.T
    ends = [gauss_newton(linearise, low + share * (high - low), bounds, tolerance=1e-4) for share in _STARTS]
    optima = [end for end in ends if end is not None]
    if not optima:
        raise ConvergenceError("the reduced model gives no residual; run identify again")
    best = min(optima, key=lambda end: end.misfit)
    observation = misfit.observations[0]
    moved = observation.points + observation.parts_of(model.evaluate(best.theta))[0]
    posterior = laplace(best.theta, best.residual, best.jacobian, bounds)
    error = float(model.error_estimate(best.theta))
    return Again(best.theta, posterior, error, observation.points, observation.region, moved)


def _misfit(kept: Mapping[str, NDArray[np.generic]], problem: IdentificationProblem) -> Misfit:
    """Misfit of the problem's deformed organ, with the data and weights that were kept."""
    deformed, nowhere = problem.organ.deformed, MotionObservation.empty()
    rows = {key.removeprefix("motion/rows/"): values for key, values in kept.items() if key.startswith("motion/rows/")}
    motion = replace(nowhere, rows=MotionRows.from_arrays(rows), reader=np.asarray(kept["motion/reader"]))
    observation = SurfaceObservation(
        **{key: np.asarray(kept[f"surface/{key}"]) for key in _OF_SURFACE},
        operator=nowhere.operator,
        target=SignedDistanceField.from_surface(deformed.points, deformed.faces),
        landmarks=problem.landmarks,
        landmark_operator=nowhere.operator,
        motion=motion,
    )
    modes, covariance = (np.asarray(kept[key], dtype=float) for key in ("modes", "motion_covariance"))
    data = DataVector(modes, len(problem.landmarks), None, covariance)
    weighting = Weighting(np.asarray(kept["weights"], dtype=float))
    return Misfit((observation,), (data,), weighting)
