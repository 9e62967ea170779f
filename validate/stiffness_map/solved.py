"""Data of a body that has the case's walls and a focus of its own: solved with an element and a mesh that the fit does not use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.state import State
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.material_changes import scaled
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.mesh import TetMesh
from palpate.core.residual.remeshing import Remeshed
from palpate.validate.stiffness_map.case_map import CaseMap

ELEMENT = "p2p0"
# Points in a cell by which it is told how much of it a focus fills.
_SAMPLES = 200


@dataclass(frozen=True)
class Focus:
    """A ball within one half. centre : mm. times : its stiffness over its half's."""

    centre: tuple[float, float, float]
    diameter_mm: float
    times: float

    def ln_times(self, points: FloatArray) -> FloatArray:
        """(p,) deviation of ln G at points (p, 3) mm."""
        inside = np.linalg.norm(points - np.array(self.centre), axis=1) < 0.5 * self.diameter_mm
        return np.where(inside, np.log(self.times), 0.0)


class OtherBody:
    """The case's body on another mesh. Raises ConvergenceError where it has no equilibrium without a focus."""

    def __init__(self, of: CaseMap, mesh: Remeshed) -> None:
        self._of, problem = of, mesh.problem(of.problem)
        self._geometry = SharedGeometry.of(problem, ELEMENT)
        self.mesh, space = problem.mesh, self._geometry.space
        seen = of.fit.linearisation.first.scene.observation
        marks = space.interpolation(seen.landmarks[:, :3], problem.regions)
        parts = [space.interpolation(seen.points, problem.regions), marks, seen.motion.on(space).operator]
        self._points = sp.vstack(parts).tocsr()
        self.theta = of.fit.linearisation.theta
        self._start: State | None = None
        self._start = self._solved(self.theta, np.ones(len(self.mesh.cells)))

    def residual(self, step: FloatArray, focus: Focus | None = None) -> FloatArray:
        """Weighted residual (n,) of the case's fit against data of this body, its halves stiffer by `step` (t,) of ln G, without
        noise. Raises ConvergenceError."""
        factor = np.ones(len(self.mesh.cells)) if focus is None else np.exp(self.means(focus, self.mesh))
        state = self._solved(self.theta + step, factor)
        fit = self._of.fit
        here = fit.linearisation.first.scene.observation
        seen = fit.model.data_vectors[0].residual_of(here, self._points @ state.u)
        return self._of.weighted(fit.linearisation.residual - self._without_bones(seen))

    def ball_centres(self, region: int, diameter_mm: float) -> FloatArray:
        """(k, 3) mm centres of cells about which a ball lies within its region."""
        centres = self.mesh.points[self.mesh.cells].mean(axis=1)
        other = cKDTree(centres[self.mesh.regions != region])
        mine = centres[self.mesh.regions == region]
        return np.asarray(mine[other.query(mine)[0] > 0.5 * diameter_mm], dtype=np.float64)

    @staticmethod
    def means(focus: Focus, mesh: TetMesh) -> FloatArray:
        """(cells,) mean deviation of ln G in each cell of a mesh."""
        rng = np.random.default_rng(1)
        shares = rng.dirichlet(np.ones(4), _SAMPLES)
        near = np.flatnonzero(
            np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - focus.centre, axis=1)
            < focus.diameter_mm + 2.0 * np.cbrt(mesh.volumes)
        )
        out = np.zeros(len(mesh.cells))
        points = np.einsum("sk,cki->csi", shares, mesh.points[mesh.cells[near]])
        out[near] = focus.ln_times(points.reshape(-1, 3)).reshape(len(near), -1).mean(axis=1)
        return out

    def _without_bones(self, seen: FloatArray) -> FloatArray:
        """Data rows with the bones' as the fit has them: a focus does not move them."""
        out, data = seen.copy(), self._of.fit.model.data_vectors[0]
        if data.bone is not None:
            out[data.motion.stop :] = self._of.fit.linearisation.residual[data.motion.stop :]
        return out

    def _solved(self, theta: FloatArray, factor: FloatArray) -> State:
        problem = self._geometry.problem
        composition = Composition(problem).with_law(scaled(problem.regions, factor))
        settled = CompositionScene(self._geometry, composition).settle(
            theta, self._start, rounds=8 if self._start is None else 2
        )
        if not settled.equilibrium.converged:
            raise ConvergenceError(
                f"{self._of.case.path}: no equilibrium of the other body ({settled.equilibrium.reason})"
            )
        return State(settled.equilibrium.u, settled.equilibrium.p)
