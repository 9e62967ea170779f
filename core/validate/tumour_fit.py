"""Identification of the studies' scene: one reduced model of a mesh and element, then a fit of every surface in milliseconds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import State
from palpate.core.fem.reduced import ReducedModel
from palpate.core.fem.reduced_design import ReducedOptions, Snapshot
from palpate.core.identify.gauss_newton import GaussNewtonResult
from palpate.core.identify.posterior import Posterior
from palpate.core.identify.reduced_fit import ReducedFit
from palpate.core.identify.uneven import uneven_response
from palpate.core.observe.distance_field import SignedDistanceField
from palpate.core.observe.noise import (
    Weighting,
    contour_covariance,
    smooth_covariance,
    weighting_covariance,
)
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.problem import Surface
from palpate.core.validate.tumour_data import DATA_DIVISIONS, TumourData
from palpate.core.validate.tumour_scene import Divisions, DrivenScene, halved_ball, organ_volume
from palpate.core.worker.progress import Progress, silent

FloatArray = NDArray[np.float64]

# Points of the organ's surface, about as far apart as this, mm.
SPACING_MM = 2.0
# What two meshes and elements leave of each other on a uniform organ, mm rms (measured: 0.008), with room.
MESHES_MM = 0.02
# Rounds in which the error of an uneven half is taken at the stiffness found.
_ROUNDS = 2
# Of the least displacement in the box, 0.2 mm where the organ is hard: some thousandths of a millimetre.
REDUCED = ReducedOptions(tolerance=0.01, max_snapshots=120)


@dataclass(frozen=True, eq=False)
class Found:
    """mu (2,) kPa of the left and the right half, 95 % interval (2, 2), and the fit they come from."""

    mu: FloatArray
    interval: FloatArray
    fit: GaussNewtonResult
    posterior: Posterior


class TumourFit:
    """A mesh and element that identify, ready for any deformed surface of the same organ.

    rest : the organ's surface at rest, as the data show it. Raises ConvergenceError when most stiffnesses have no equilibrium.
    """

    def __init__(
        self,
        rest: Surface,
        divisions: Divisions | None = None,
        element: str = "p2p1",
        data: Divisions = DATA_DIVISIONS,
        strain: float = 1.0,
        progress: Progress = silent,
        model: ReducedModel | None = None,
    ) -> None:
        self._prepare(rest, divisions or Divisions(), element, data, strain)
        self.model: ReducedModel | None = model or ReducedModel.build(
            self.snapshots, self.scene.parameters.bounds, "", REDUCED, progress
        )

    @classmethod
    def without_model(cls, rest: Surface, divisions: Divisions, element: str, data: Divisions) -> TumourFit:
        """For full solves only."""
        fit = cls.__new__(cls)
        fit.model = None
        fit._prepare(rest, divisions, element, data, 1.0)
        return fit

    def _prepare(self, rest: Surface, divisions: Divisions, element: str, data: Divisions, strain: float) -> None:
        volume = organ_volume(halved_ball(data))
        self.scene = DrivenScene(halved_ball(divisions, volume), element, strain)
        self.points = sample_surface(rest, SPACING_MM)[0]
        self._operator = self.scene.space.interpolation(self.points, (1, 2))
        self.set_noise(self.scene.facts.noise_sd_mm)

    def set_noise(self, sd_mm: float) -> None:
        """What one contour errs by."""
        length = self.scene.facts.noise_correlation_mm
        self.sd_mm = sd_mm
        self.noise = contour_covariance(self.points, sd_mm, length)
        self.weighting = Weighting(weighting_covariance(self.points, sd_mm, length))
        self.expected = float(np.trace(self.weighting.apply(self.noise)))

    def snapshots(self, thetas: FloatArray) -> list[Snapshot | None]:
        """Full solves at thetas (m, 2), with sensitivities, on the organ's surface points."""
        return [self.solve(theta)[0] for theta in thetas]

    def solve(self, theta: FloatArray, start: State | None = None) -> tuple[Snapshot | None, State | None]:
        """One full solve, and where it ended; none where there is no equilibrium."""
        found = self.scene.solve(theta, start)
        if not found.converged:
            return None, None
        slopes = [self._operator @ s for s in self.scene.displacement_sensitivities(theta, found)]
        return Snapshot(self._operator @ found.u, np.stack(slopes)), State(found.u, found.p)

    def of(self, deformed: Surface | SignedDistanceField, error_mm: FloatArray | None = None) -> ReducedFit:
        """The fit of one deformed surface; error_mm (q,) : of its contours, drawn by `draw`."""
        target = (
            deformed
            if isinstance(deformed, SignedDistanceField)
            else SignedDistanceField.from_surface(deformed.points, deformed.faces)
        )
        error = np.zeros(0) if error_mm is None else error_mm
        return ReducedFit(self.model, self.points, target, self.weighting, self.noise, error, self.expected)

    def identify(self, data: TumourData | ReducedFit, error_mm: FloatArray | None = None) -> Found:
        """The stiffness of both halves."""
        fit = data if isinstance(data, ReducedFit) else self.of(data.organ.deformed, error_mm)
        low, high = self.scene.parameters.bounds.T
        optimum = fit.fit(np.array([low + 0.4 * (high - low), low + 0.7 * (high - low)]), self.scene.parameters.bounds)
        posterior = fit.posterior(optimum, self.scene.parameters.bounds)
        return Found(np.exp(optimum.theta) / 4.0, posterior.interval() / 4.0, optimum, posterior)

    def identify_uneven(self, data: TumourData, error_mm: FloatArray | None = None) -> Found:
        """The stiffness of both halves, neither taken to be uniform: see `identify.uneven`. error_mm (q,) as in `of`.

        Without it the data are weighed as exact but for what two meshes leave of each other.
        """
        one = self.of(data.organ.deformed, error_mm)
        found = self.identify(one)
        length = self.scene.facts.noise_correlation_mm
        if error_mm is None:
            weights = weighting_covariance(self.points, MESHES_MM, length, 0.375 * MESHES_MM)
            noise = weights
        else:
            weights, noise = self.weighting.covariance, self.noise
        for _ in range(_ROUNDS):
            uneven = self._uneven(found.fit.theta, one.target)
            both = uneven @ uneven.T
            found = self.identify(replace(one, weighting=Weighting(weights + both), noise=noise + both, expected=None))
        return found

    def _uneven(self, theta: FloatArray, target: SignedDistanceField) -> FloatArray:
        """(q, m) mm, see `uneven_response`."""
        found = self.scene.solve(theta)
        if not found.converged:
            raise ConvergenceError(f"the stiffness found has no equilibrium: {found.reason}")
        _, normal = target.value_and_gradient(self.points + self._operator @ found.u)
        return uneven_response(
            self.scene.assembler,
            self.scene.parameters,
            theta,
            found,
            lambda x: ((self._operator @ x) * normal).sum(axis=1),
        )

    def draw(self, rng: np.random.Generator, count: int = 1, extraction: bool = True) -> FloatArray:
        """(count, q) mm errors of the residual from both contours; extraction : with that of voxels and surface extraction."""
        sd, length = self.sd_mm, self.scene.facts.noise_correlation_mm
        covariance = self.noise if extraction else 2.0 * smooth_covariance(self.points, sd, length)
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(rng.standard_normal((count, len(values))) @ root.T)
