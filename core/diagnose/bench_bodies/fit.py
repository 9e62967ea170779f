"""Plain fit of a body: the stiffness that explains all markers and reactions, by the fit that pairs have too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.marker_data import MarkerData
from palpate.core.diagnose.bench_bodies.model import bench_model, marker_data, noise_covariance
from palpate.core.diagnose.bench_bodies.problem import BodyProblem
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.errors import ConvergenceError
from palpate.core.inference.posterior import Posterior, laplace
from palpate.core.inference.starts import spread_starts
from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual.fit_options import GOOD, QUICK, FitOptions
from palpate.core.residual.joint_states import JointLinearisation, JointModel
from palpate.core.residual.noise_covariance import NoiseSizes
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.optimum import SAME_OPTIMUM, Optimum, best_of, solved
from palpate.core.residual.plain_fit import PlainFit, solved_somewhere
from palpate.core.worker.progress import Progress, part, silent

# How often the noise is carried through the model anew where the fit has moved, at most, and the move of ln G, in its
# standard deviations, from which on it is.
_CARRIED, _MOVED_SD = 3, 0.1
_NO_EQUILIBRIUM = "the body has no equilibrium under these loads; look at its supports, loads and stiffness bounds"


@dataclass(frozen=True, eq=False)
class BodyFit:
    """The plain model of a body where it fits best, as that of a pair."""

    problem: BodyProblem
    plain: PlainFit
    options: DiagnosisOptions

    @property
    def element(self) -> str:
        """The element that it was fitted with."""
        return self.plain.model.first.geometry.element

    @property
    def data(self) -> list[MarkerData]:
        """Data of every state."""
        return marker_data(self.plain.model)

    def missed(self, residual: FloatArray) -> list[FloatArray]:
        """Residuals (k, 3) mm of every state's markers, NaN where not seen, from those of all data (n,)."""
        return [d.missed(residual[rows]) for d, rows in zip(self.data, self.plain.model.rows, strict=True)]


def _normal(model: JointModel, at: JointLinearisation, weighting: Weighting) -> Posterior:
    """Markers tell a body's stiffness well enough for Laplace's approximation."""
    return laplace(at.theta, weighting.whiten(at.residual), weighting.whiten(at.in_theta), model.bounds)


def fit_body(
    problem: BodyProblem,
    options: DiagnosisOptions | None = None,
    progress: Progress = silent,
    how: FitOptions | None = None,
) -> BodyFit:
    """Fit of the plain model to all states: Gauss-Newton from several starts with a quick element, then with the good
    one from where those end.

    Raises InputError when nothing holds the body, ConvergenceError when it has no equilibrium.
    """
    options, how = options or DiagnosisOptions(), how or FitOptions()
    model = bench_model(problem, how.element, options.noise_model.markers_common)
    try:
        found = _searched(problem, model, options, how, progress).linearisation
        here = solved(model, found.theta, found)
    except ConvergenceError as error:
        raise ConvergenceError(_NO_EQUILIBRIUM) from error
    covariance = noise_covariance(problem, model, here)
    noise = options.noise_model
    plain = PlainFit(
        model,
        here,
        None,
        1,
        float("nan"),
        NoiseGrid.known(covariance, noise),
        NoiseSizes.of(noise),
        Weighting(covariance),
        _normal(model, here, Weighting(covariance)),
    )
    return BodyFit(problem, plain, options)


def _searched(
    problem: BodyProblem, model: JointModel, options: DiagnosisOptions, how: FitOptions, progress: Progress
) -> Optimum:
    """The optimum with the noise that belongs to it. Raises ConvergenceError when there is no equilibrium."""
    progress(0.0, "plain model: stiffness with the quick element")
    starts = _quick_ends(problem, options, how, part(progress, 0.0, 0.2))
    progress(0.2, f"plain model: element {how.element}")
    here = solved_somewhere(model, starts)
    best = None
    for k in range(_CARRIED):
        weights = Weighting(noise_covariance(problem, model, here))
        search = part(progress, 0.3 + 0.2 * k, 0.5 + 0.2 * k)
        best = best_of(model, weights, starts if best is None else here.theta[None], here, search)
        before, here = here.theta, best.linearisation
        sd = _normal(model, here, weights).sd
        if not _moves_patches(problem) or (np.abs(here.theta - before) < _MOVED_SD * sd).all():
            break
    assert best is not None
    return best


def _moves_patches(problem: BodyProblem) -> bool:
    """Whether the noise hangs on the stiffness: displacements that were prescribed have an error."""
    return any(sd > 0.0 for p in problem.patches for sd in p.facts.sd_mm)


def _quick_ends(problem: BodyProblem, options: DiagnosisOptions, how: FitOptions, progress: Progress) -> FloatArray:
    """Where Gauss-Newton with the quick element ends, each optimum once; the starts where it has no equilibrium."""
    model = bench_model(problem, QUICK if how.element == GOOD else how.element, options.noise_model.markers_common)
    starts = spread_starts(model.bounds, how.starts)
    try:
        first = solved_somewhere(model, starts)
        weights = Weighting(noise_covariance(problem, model, first))
        ends = best_of(model, weights, starts, first, progress).ends
    except ConvergenceError:
        return starts
    other = [k for k, end in enumerate(ends) if (np.abs(end - ends[:k]).max(axis=1) > SAME_OPTIMUM).all()]
    return ends[other]
