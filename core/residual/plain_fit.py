"""The plain model where it fits best: one stiffness for all deformed states, with its uncertainty.

A quick element finds the fit, a better one corrects its residual where it ends (defect correction): at the end the
residual is the better element's own. The data are weighed by the inverse of the covariance of all that is no effect,
whose sizes the case's own data choose. `identify` reports this fit, and `diagnose` starts from it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.inference.evidence import Directions
from palpate.core.inference.posterior import Posterior, laplace, prior_precision
from palpate.core.inference.starts import spread_starts
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import StateData
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.element_error import ElementErrors, FineSolution, element_errors, scatter_mm
from palpate.core.residual.exploration import posterior_of
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.joint_states import JointLinearisation, JointModel, apart
from palpate.core.residual.linearised_model import SolveCount
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes, organ_errors
from palpate.core.residual.noise_estimation import NoiseGrid, fit_noise
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.optimum import Optimum, best_of, solved
from palpate.core.residual.organ_shape import shape_response
from palpate.core.residual.remeshing import Remeshed, left_by_all
from palpate.core.residual.state_models import joint_model
from palpate.core.residual.unknown_field import UnknownDiscrepancy
from palpate.core.statistics import rms
from palpate.core.worker.progress import Progress, part, silent

# How often the better element's correction is taken anew where the fit has moved, at most, and the move of ln G, in its
# standard deviations, from which on it is.
_CORRECTIONS, _MOVED_SD = 3, 0.1
# A ln G as near to a bound as this is held there.
_AT_BOUND = 1e-6
# Response (n, m) of the data to further errors of unit variance, at a model's linearisation.
FurtherErrors = Callable[[JointModel, JointLinearisation], FloatArray]


@dataclass(frozen=True, eq=False)
class PlainFit:
    """The plain model where it fits best.

    model : of all deformed states. linearisation : at the best fit of the quick element, corrected by the mean of what the
    better element changes on `meshes` (the fewest of any state). on_own_mesh (n,) : mm that it changes on the case's own
    mesh, None where it has no equilibrium. scatter_mm : rms along the surface of one mesh about that mean in the first
    state, NaN for one mesh. noise : all sizes that it may have. sizes : estimated ones. weighting : of the data vector.
    posterior : of theta. shapes : of each state, what the organ's contour at rest does through the model's geometry (n, q), as in
    `noise`; none where it does nothing.
    """

    model: JointModel
    linearisation: JointLinearisation
    on_own_mesh: FloatArray | None
    meshes: int
    scatter_mm: float
    noise: NoiseGrid
    sizes: NoiseSizes
    weighting: Weighting
    posterior: Posterior
    shapes: tuple[FloatArray, ...] = field(default=(), kw_only=True)

    @property
    def options(self) -> NoiseModelOptions:
        """Numbers of the noise model."""
        return self.noise.options

    @property
    def count(self) -> SolveCount:
        """Work done so far with the model, by whoever solved it."""
        return self.model.first.count

    @cached_property
    def residual(self) -> FloatArray:
        """Weighted residual (n,)."""
        return self.weighting.whiten(self.linearisation.residual)

    @cached_property
    def jacobian(self) -> FloatArray:
        """Derivative (n, t) of the weighted residual in theta."""
        return self.weighting.whiten(self.linearisation.in_theta)

    @property
    def bounds(self) -> FloatArray:
        """Bounds (t, 2) of theta."""
        return self.linearisation.first.scene.parameters.bounds

    @property
    def organ_drawn(self) -> bool:
        """Whether somebody drew the deformed organ in any state. Where nobody did, the images alone are data."""
        return any(data.n_modes > 0 for data in self.model.data_vectors)

    @property
    def noise_rms_mm(self) -> list[float]:
        """What noise leaves on each state's surface, mm rms; where the organ is no datum, what its two surfaces say of their
        difference, and their extraction."""
        variance, out = np.diag(self.weighting.covariance), []
        for rows, data, at in zip(self.model.rows, self.model.data_vectors, self.linearisation.each, strict=True):
            if data.n_modes:
                out.append(float(np.sqrt(variance[rows.start : rows.start + data.n_modes].sum() / len(data.modes))))
            else:
                errors = organ_errors(at.scene, at.equilibrium.u)
                out.append(rms(np.hypot(errors.difference, self.sizes.per_mode)))
        return out

    @cached_property
    def log_evidence(self) -> float:
        """Log evidence of the plain model, averaged over the noise."""
        r, J = self.linearisation.residual[:, None], self.linearisation.in_theta
        low, high = self.bounds.T
        free = (self.linearisation.theta > low + _AT_BOUND) & (self.linearisation.theta < high - _AT_BOUND)
        return float(self.noise.log_evidence(r, J, prior_precision(self.bounds), [Directions.none(len(r))], free)[0, 0])


@dataclass(frozen=True, eq=False)
class FoundFit(PlainFit):
    """A fit with the way to it. fine : the better element's solution of every state, None where it has no equilibrium.

    optimum : of the search with the quick element.
    """

    fine: tuple[FineSolution | None, ...]
    optimum: Optimum


def fit_plain(
    pairs: Sequence[StateData],
    remeshed: Sequence[Remeshed] = (),
    progress: Progress = silent,
    options: NoiseModelOptions | None = None,
    walls: WallMotionOptions | None = None,
    how: FitOptions | None = None,
    further: FurtherErrors | None = None,
    start: FloatArray | None = None,
) -> FoundFit:
    """Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved.

    pairs : for each deformed state the problem and the bones. remeshed : other meshes of the same labels; the better
    element's prediction is the mean over all of them. options, walls, how : the program's own where none are given.
    further : errors beside those of the noise model. start (t,) : a theta to start from beside the usual ones.
    """
    how = how or FitOptions()
    options = (options or NoiseModelOptions()).for_case(pairs[0][0])
    progress(0.0, "plain model: surfaces and distances")
    model = joint_model(pairs, options, walls or WallMotionOptions(), how)
    optimum = _quick_optimum(model, options, how, start, part(progress, 0.1, 0.4))
    model, here, errors = _with_better_element(model, optimum, remeshed, how.element, part(progress, 0.4, 0.7))
    progress(0.7, "plain model: noise of this case's contours")
    shapes = _shapes(model, here, options)
    grid, sizes, weighting = _noise(model, here, errors, options, further, shapes)
    model, here, errors = _settled(model, weighting, here, errors, how.element, part(progress, 0.75, 0.9))
    return FoundFit(
        model=model,
        linearisation=here,
        on_own_mesh=_on_own_mesh(errors),
        meshes=min(len(e.every) for e in errors),
        scatter_mm=scatter_mm(errors[0].every, model.first.data),
        noise=grid,
        sizes=sizes,
        weighting=weighting,
        posterior=posterior_of(model, weighting, here, model.bounds, part(progress, 0.9, 1.0)),
        fine=tuple(e.own for e in errors),
        optimum=optimum,
        shapes=shapes,
    )


def _quick_optimum(
    model: JointModel, options: NoiseModelOptions, how: FitOptions, start: FloatArray | None, progress: Progress
) -> Optimum:
    """Where the quick element fits best, with the weights that are taken before the case's own noise is known."""
    progress(0.0, "plain model: stiffness with the quick element")
    starts = np.vstack([spread_starts(model.bounds, how.starts), *([] if start is None else [start])])
    first = solved_somewhere(model, starts)
    return best_of(model, _first_weights(model, first, options), starts, first, progress)


def _with_better_element(
    model: JointModel, optimum: Optimum, remeshed: Sequence[Remeshed], element: str, progress: Progress
) -> tuple[JointModel, JointLinearisation, list[ElementErrors]]:
    """The quick element's optimum, corrected by what a better one changes there."""
    progress(0.0, f"plain model: element {element}")
    here = optimum.linearisation
    each = zip(model.each, here.each, strict=True)
    errors = [element_errors(m, p, remeshed, element, progress) for m, p in each]
    return *_corrected(model, here, errors), errors


def _settled(
    model: JointModel,
    weighting: Weighting,
    here: JointLinearisation,
    errors: list[ElementErrors],
    element: str,
    progress: Progress,
) -> tuple[JointModel, JointLinearisation, list[ElementErrors]]:
    """The fit with the case's own weights, the better element's correction taken anew where it moved."""
    at = here.theta
    for k in range(_CORRECTIONS):
        progress(k / _CORRECTIONS, "plain model: stiffness with the noise of this case")
        here = best_of(model, weighting, here.theta[None], here).linearisation
        sd = laplace(here.theta, weighting.whiten(here.residual), weighting.whiten(here.in_theta), model.bounds).sd
        if (np.abs(here.theta - at) < _MOVED_SD * sd).all():
            break
        errors = [e.moved_to(m, p, element) for e, m, p in zip(errors, model.each, here.each, strict=True)]
        model, here = _corrected(model, here, errors)
        at = here.theta
    return model, solved(model, here.theta, here), errors  # lets the walls settle further


def _shapes(model: JointModel, linearisation: JointLinearisation, options: NoiseModelOptions) -> tuple[FloatArray, ...]:
    """What the organ's contour at rest does through the model's geometry, by state; none on the paper's boundary, whose
    loads come from that contour themselves."""
    if model.first.only is not None:
        return ()
    return tuple(
        shape_response(at.scene, data, at.tangent, options.mode_length_mm, options.mode_least)
        for at, data in zip(linearisation.each, model.data_vectors, strict=True)
    )


def _on_own_mesh(errors: Sequence[ElementErrors]) -> FloatArray | None:
    own = [c for e in errors if (c := e.on_own_mesh) is not None]
    return np.concatenate(own) if len(own) == len(errors) else None


def solved_somewhere(model: JointModel, starts: FloatArray) -> JointLinearisation:
    """The model solved at the first of the starts (s, t) where it has an equilibrium.

    Raises ConvergenceError when it has none at any.
    """
    for start in starts[:-1]:
        linearisation = model.plain(start, None)
        if linearisation is not None:
            return linearisation
    return solved(model, starts[-1], None)


def _first_weights(model: JointModel, first: JointLinearisation, options: NoiseModelOptions) -> Weighting:
    noise = NoiseParts.of(first.each, model.data_vectors, options)
    return Weighting(noise.covariance(NoiseSizes.of(options), np.zeros((model.n, 1))))


def _corrected(
    model: JointModel, linearisation: JointLinearisation, errors: Sequence[ElementErrors]
) -> tuple[JointModel, JointLinearisation]:
    """Model and linearisation with the better element's correction in place of the one they had."""
    correction = ElementCorrection.stacked([e.correction for e in errors])
    return model.corrected(correction), linearisation.corrected(model.correction, correction)


def _noise(
    model: JointModel,
    linearisation: JointLinearisation,
    errors: Sequence[ElementErrors],
    options: NoiseModelOptions,
    further: FurtherErrors | None,
    shapes: Sequence[FloatArray],
) -> tuple[NoiseGrid, NoiseSizes, Weighting]:
    """All sizes that the noise may have, the likely ones, and the weights that follow."""
    sizes, differences = NoiseSizes.of(options), [e.every for e in errors]
    found = [e.own.responses for e in errors if e.own is not None and e.own.responses is not None]
    better = found if len(found) == len(errors) else None
    parts = NoiseParts.of(linearisation.each, model.data_vectors, options, better, shapes or None)
    gap = UnknownDiscrepancy.around(linearisation, model.data_vectors, options)
    columns = [left_by_all(differences, sizes.mesh), _of_the_model(gap, differences, options)]
    if further is not None:
        columns.append(further(model, linearisation))
    left = np.hstack(columns)
    r, J = linearisation.residual, np.hstack([linearisation.in_theta, _free(model.data_vectors)])
    grid = NoiseGrid.of(parts, left, r, J, gap.free)
    fitted = fit_noise(grid, r, J, gap.free)
    return grid, fitted.sizes, Weighting(fitted.covariance)


def _of_the_model(gap: UnknownDiscrepancy, differences: Sequence[FloatArray], options: NoiseModelOptions) -> FloatArray:
    """Columns (n, m) of the model's own smooth error: half of its variance common to all states, half of each state
    alone.

    Where no better element could be solved, it is larger by what that element typically changes.
    """
    unsolved = float(np.hypot(options.model, options.unsolved_mesh_mm / options.force_typical_mm))
    each = [(options.model if len(d) else unsolved) * f.response for f, d in zip(gap.each, differences, strict=True)]
    return np.sqrt(0.5) * np.hstack([np.vstack(each), apart(each)])


def _free(data_vectors: Sequence[DataVector]) -> FloatArray:
    """Columns (n, k) of what may move each state's data by any amount besides noise and a gap: an offset of the contour, the bones."""
    each = []
    for data in data_vectors:
        bones = np.eye(data.n)[:, -6:] if data.bone is not None else np.zeros((data.n, 0))
        each.append(np.column_stack([data.dilation, bones]))
    return apart(each)
