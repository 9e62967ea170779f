"""A stiffness map of the organ beside the regional values: Gauss-Newton on patches under a smoothness prior, with its own doubts.

For a linear model the estimate is m = m0 + A r with A = (J' J + C^-1)^-1 J' and the resolution R = A J (Backus & Gilbert;
Tarantola 2005, Inverse Problem Theory, 3.2): row i of R says of which places the value at i is an average. The spread counts both
what the smoothing cannot follow and what the noise does, (I - R) C (I - R)' + A A'.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import Equilibrium, solve_equilibrium
from palpate.core.fem.sensitivity import Direction, direct
from palpate.core.fem.state import State
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.parameters import TISSUE
from palpate.core.identify.map.patches import Patches, cut
from palpate.core.identify.map.smoothness_prior import SmoothPrior
from palpate.core.identify.misfit import Misfit
from palpate.core.laws import MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.worker.progress import Progress, silent

PATCHES = 60
# Smallest reduction of the local prior variance, as a share, at which a place is shown.
TOLD = 0.3
_STEPS = 6
_CLOSE = 0.03  # ln G; a smaller step ends the iteration
_HALVINGS = 4


@dataclass(frozen=True, eq=False)
class StiffnessMap:
    """ln_G (n,) of the patches (G in kPa), covariance (n, n), resolution (n, n) = R.

    gain (n,) : share of the variance about the organ's level that the scans took away, 0 to 1. blur_mm (n,) : how far from
    a patch the places lie whose stiffness its value averages. steps : Gauss-Newton steps taken. settled : whether the last was small.
    """

    patches: Patches
    prior: SmoothPrior
    ln_G: FloatArray
    covariance: FloatArray
    resolution: FloatArray
    gain: FloatArray
    blur_mm: FloatArray
    steps: int
    settled: bool

    @property
    def sd(self) -> FloatArray:
        """(n,) standard deviation of ln G."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def told(self) -> BoolArray:
        """(n,) patches where the data reduce the prior variance by at least TOLD."""
        return self.gain >= TOLD

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Arrays of the map's file; `painted` evaluates them."""
        prior = self.prior
        weights = np.linalg.solve(prior.covariance(self.patches.centres, self.patches.centres), self.ln_G - prior.mean)
        return {
            "centres": self.patches.centres,
            "volumes_mm3": self.patches.volumes,
            "ln_G": self.ln_G,
            "sd": self.sd,
            "gain": self.gain,
            "told": self.told,
            "blur_mm": self.blur_mm,
            "resolution": self.resolution,
            "weights": weights,
            "prior": np.array([prior.mean, prior.level_sd, prior.local_sd, prior.length_mm]),
            "cells": self.patches.cells,
            "cell_patch": self.patches.patch,
        }


def painted(arrays: Mapping[str, NDArray[np.generic]], points: FloatArray) -> tuple[FloatArray, BoolArray]:
    """G (p,) kPa at points (p, 3) mm of the organ, between patches as the prior has it, and whether their patch is told."""
    prior = SmoothPrior(*(float(v) for v in np.asarray(arrays["prior"], dtype=float)))
    centres = np.asarray(arrays["centres"], dtype=float)
    ln_G = prior.mean + prior.covariance(points, centres) @ np.asarray(arrays["weights"], dtype=float)
    return np.exp(ln_G), np.asarray(arrays["told"], dtype=bool)[nearest_patch(arrays, points)]


def nearest_patch(arrays: Mapping[str, NDArray[np.generic]], points: FloatArray) -> IntArray:
    """(p,) patch with the nearest centre to each of points (p, 3) mm."""
    return np.asarray(cdist(points, np.asarray(arrays["centres"], dtype=float)).argmin(axis=1), dtype=np.int64)


def stiffness_map(
    fit: PlainFit,
    scene: CompositionScene,
    equilibrium: Equilibrium,
    count: int = PATCHES,
    progress: Progress = silent,
) -> StiffnessMap | None:
    """The map of a fit's first deformed state; None where it has no equilibrium.

    scene, equilibrium : of the first state at the fit, walls where they are. count : of patches. Noise is widened as
    that of the regional values (`Posterior.scale`).
    """
    problem = scene.problem
    patches = cut(problem.mesh, problem.regions, count)
    prior = SmoothPrior.of_bounds(problem.facts.bounds_kpa)
    C = prior.covariance(patches.centres, patches.centres)
    precision = np.asarray(np.linalg.inv(C), dtype=np.float64)
    body = _Body(fit, scene, equilibrium, patches)
    theta = fit.linearisation.theta
    m = patches.means(_regional(scene, patches, theta), problem.mesh.volumes[patches.cells])
    state = body.at(m, equilibrium)
    if state is None:
        return None
    settled, stuck, steps = False, False, 0
    while not (settled or stuck) and steps < _STEPS:
        progress(steps / _STEPS, f"stiffness map, step {steps + 1}")
        r, J = state.residual, body.jacobian(m, state.equilibrium)
        H = J.T @ J + precision
        full = np.asarray(-np.linalg.solve(H, J.T @ r + precision @ (m - prior.mean)), dtype=np.float64)
        m, state, step = body.descend(m, full, state, precision, prior.mean)
        # Where no step lowers the objective, the iteration has converged only if the full step is small.
        settled, stuck = bool(np.abs(step if step.any() else full).max() <= _CLOSE), not step.any()
        steps += 1
    J = body.jacobian(m, state.equilibrium)
    return _judged(body, patches, prior, m, J, C, precision, steps, settled)


def _judged(
    body: _Body,
    patches: Patches,
    prior: SmoothPrior,
    m: FloatArray,
    J: FloatArray,
    C: FloatArray,
    precision: FloatArray,
    steps: int,
    settled: bool,
) -> StiffnessMap:
    inverse = np.linalg.inv(J.T @ J + precision)
    R = inverse @ (J.T @ J)
    smoothing_error = np.eye(patches.n) - R
    noise = inverse @ (J.T @ J) @ inverse
    covariance = smoothing_error @ C @ smoothing_error.T + noise
    local = prior.local_covariance(patches.centres, patches.centres)
    # Variance of the differences from the common level, before and after the scans.
    share = patches.volumes / patches.volumes.sum()
    about = np.eye(patches.n) - share
    before, after = np.diag(about @ local @ about.T), np.diag(about @ covariance @ about.T)
    gain = np.clip(1.0 - after / before, 0.0, 1.0)
    reach = np.abs(R) * patches.volumes
    distance = cdist(patches.centres, patches.centres)
    blur = (reach * distance).sum(axis=1) / np.maximum(reach.sum(axis=1), 1e-300)
    return StiffnessMap(patches, prior, m, covariance, R, gain, blur, steps, settled)


@dataclass(frozen=True, eq=False)
class _Solved:
    equilibrium: Equilibrium
    residual: FloatArray


class _Body:
    """The scene with a stiffness for each patch."""

    def __init__(self, fit: PlainFit, scene: CompositionScene, equilibrium: Equilibrium, patches: Patches) -> None:
        self.scene, self.patches, self._scale = scene, patches, fit.posterior.scale
        # At the fit the residual is the fit's own, whatever element solves for the map.
        data, linearisation = fit.model.data_vectors[0], fit.linearisation.first
        self._misfit = Misfit.of(fit).first
        self._correction = linearisation.residual - data.residual(scene, equilibrium.u)
        facts = scene.problem.facts
        self._unit = mooney_rivlin_parameters(1.0, bulk_modulus(1.0, facts.organ_poisson_ratio), 0.5)
        regions = scene.problem.mesh.regions[patches.cells]
        self._rows = {r: np.flatnonzero(regions == r) for r in scene.problem.regions}
        self._tissue = scene.parameters.materials(np.zeros(scene.parameters.n))[TISSUE]

    def at(self, m: FloatArray, start: Equilibrium) -> _Solved | None:
        """Equilibrium for ln G (n,) of the patches; None where there is none."""
        G = np.exp(self.patches.of_cells(m))
        materials = {r: Material(MOONEY_RIVLIN, G[rows, None] * self._unit) for r, rows in self._rows.items()}
        equilibrium = solve_equilibrium(
            self.scene.assembler, {**materials, TISSUE: self._tissue}, start=State(start.u, start.p)
        )
        if not equilibrium.converged:
            return None
        return _Solved(
            equilibrium, self._misfit.residual([self._points @ equilibrium.u], self._correction) / self._scale
        )

    @property
    def _points(self) -> sp.csr_matrix:
        return self.scene.observation.all_points

    def jacobian(self, m: FloatArray, equilibrium: Equilibrium) -> FloatArray:
        """Whitened derivative (rows of the data vector, n) at the equilibrium of ln G = m (n,)."""
        G = np.exp(self.patches.of_cells(m))
        directions: list[Direction] = []
        for j in range(self.patches.n):
            rate = np.where(self.patches.patch == j, G, 0.0)
            directions.append({r: rate[rows, None] * self._unit for r, rows in self._rows.items() if rate[rows].any()})
        moves = np.stack([self._points @ s for s in direct(equilibrium.tangent, directions)])
        return self._misfit.jacobian([self._points @ equilibrium.u], [moves]) / self._scale

    def descend(
        self, m: FloatArray, full: FloatArray, before: _Solved, precision: FloatArray, mean: float
    ) -> tuple[FloatArray, _Solved, FloatArray]:
        """Longest of the halved steps that lowers the objective; a zero step where none does."""

        def objective(at: FloatArray, solved: _Solved) -> float:
            return float(solved.residual @ solved.residual + (at - mean) @ precision @ (at - mean))

        least = objective(m, before)
        for k in range(_HALVINGS):
            step = full * 0.5**k
            solved = self.at(m + step, before.equilibrium)
            if solved is not None and objective(m + step, solved) < least:
                return m + step, solved, step
        return m, before, np.zeros_like(m)


def _regional(scene: CompositionScene, patches: Patches, theta: FloatArray) -> FloatArray:
    """ln G (c,) of the organ's cells by region."""
    G = dict(zip(scene.problem.regions, scene.parameters.shear_moduli(theta), strict=True))
    regions = scene.problem.mesh.regions[patches.cells]
    return np.log(np.array([G[int(r)] for r in regions]))
