"""Identification of the studies' scene: one reduced model of a mesh and element, then a fit of every surface in milliseconds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import State
from palpate.core.identify.uneven_regions import UNEVEN_SD, amplitudes, uneven_responses
from palpate.core.inference.gauss_newton import GaussNewtonResult
from palpate.core.inference.posterior import Posterior
from palpate.core.observe.contour_noise import (
    Weighting,
    smooth_covariance,
)
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.reduced.greedy_design import ReducedOptions, Snapshot
from palpate.core.reduced.reduced_model import ReducedModel
from palpate.core.statistics import rms
from palpate.core.surfaces.distance_field import SignedDistanceField
from palpate.core.surfaces.surface import Surface
from palpate.core.worker.progress import Progress, silent
from palpate.validate.paper.contour_weights import contour_covariance, weighting_covariance
from palpate.validate.paper.reduced_fit import ReducedFit
from palpate.validate.paper.tumour_data import DATA_DIVISIONS, TumourData
from palpate.validate.paper.tumour_scene import Divisions, DrivenScene, halved_ball, organ_volume

# Points of the organ's surface, about as far apart as this, mm.
SPACING_MM = 2.0
# What two meshes and elements leave of each other where nobody has measured it, mm; and how much more than what they leave on a
# uniform organ (0.008 mm rms on the studies' meshes) is allowed for.
MESHES_MM, _ROOM = 0.02, 2.5
# Rounds in which the error of an uneven half is taken at the stiffness found.
_ROUNDS = 2
# Of the least displacement in the box, 0.2 mm where the organ is hard: some thousandths of a millimetre.
REDUCED = ReducedOptions(tolerance=0.01, max_snapshots=120)


@dataclass(frozen=True, eq=False)
class Found:
    """mu (2,) kPa of the left and the right half, 95 % interval (2, 2), and the fit they come from. uneven_sd : (2,) of ln G
    within each half that was allowed for; none where they were taken for uniform."""

    mu: FloatArray
    interval: FloatArray
    fit: GaussNewtonResult
    posterior: Posterior
    uneven_sd: FloatArray = field(default_factory=lambda: np.zeros(2))


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
        self.meshes_mm = MESHES_MM
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

    def learn_meshes(self, uniform: TumourData) -> None:
        """Take from a uniform organ what this mesh and element leave of the data's own."""
        left = self.of(uniform.organ.deformed).distance(self.identify(uniform).fit.theta)
        self.meshes_mm = _ROOM * rms(left)

    def identify_uneven(self, data: TumourData, error_mm: FloatArray | None = None) -> Found:
        """The stiffness of both halves, neither taken to be uniform: see `identify.uneven`. error_mm (q,) as in `of`.

        Without it the data are weighed as exact but for what two meshes leave of each other, and say how uneven each half is.
        """
        one = self.of(data.organ.deformed, error_mm)
        found = self.identify(one)
        weights, noise = self.weighting.covariance, self.noise
        if error_mm is None:
            length = self.scene.facts.noise_correlation_mm
            weights = noise = weighting_covariance(self.points, self.meshes_mm, length, 0.375 * self.meshes_mm)
        for _ in range(_ROUNDS):
            responses = self._uneven(found.fit.theta, one.target)
            for _ in range(1 if error_mm is not None else _ROUNDS):
                sd = np.full(len(responses), UNEVEN_SD)
                if error_mm is None:
                    sd = amplitudes(weights, responses, one.distance(found.fit.theta))
                both = sum((s**2 * (r @ r.T) for s, r in zip(sd, responses, strict=True)), np.zeros_like(weights))
                found = self.identify(
                    replace(one, weighting=Weighting(weights + both), noise=noise + both, expected=None)
                )
                found = replace(found, uneven_sd=sd)
        return found

    def _uneven(self, theta: FloatArray, target: SignedDistanceField) -> list[FloatArray]:
        """(q, m) mm of each half, see `uneven_responses`."""
        found = self.scene.solve(theta)
        if not found.converged:
            raise ConvergenceError(f"the stiffness found has no equilibrium: {found.reason}")
        _, normal = target.value_and_gradient(self.points + self._operator @ found.u)
        return uneven_responses(
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
