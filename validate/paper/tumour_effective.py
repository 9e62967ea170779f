"""How stiff a half with a tumour is as a whole: a body that is not uniform has no one answer, so three are given.

- Mean stress over mean strain, without their mean normal parts (Hill 1963, J. Mech. Phys. Solids 11, 357): the uniform half that
  carries the same mean stress at the same mean strain. It needs no second body, and is what "effective" means where nothing is added.
- The uniform half that, in its place, makes the whole body store the same energy (generalised self-consistent, Christensen and Lo 1979).
- The uniform half that stores the same energy when its whole surface moves as it does (Huet 1990's apparent modulus). Each wrinkle of
  the surface counts: a soft rim over a hard core makes it low.

All in their place, under this load made small, because a modulus is one of small strain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.newton import Equilibrium, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.validate.paper.tumour_scene import LEFT, TUMOUR, DrivenScene, organ_material

_CLOSE = 1e-4  # ln mu


@dataclass(frozen=True)
class Effective:
    """mu of the left half as a whole, kPa; energies nan where they were not asked for."""

    stress_over_strain: float
    energy_in_place: float = np.nan
    energy_of_its_surface: float = np.nan


def effective(scene: DrivenScene, normal_mu: float, right_mu: float, tumour_mu: float, energies: bool) -> Effective:
    """scene : of little strain, its mesh with a `TUMOUR`. energies : the other two as well.

    Raises ConvergenceError when there is no equilibrium.
    """
    found = _solve(scene, normal_mu, right_mu, tumour_mu)
    first = _stress_over_strain(scene, found, normal_mu, tumour_mu)
    if not energies:
        return Effective(first)
    half = _Half(scene)
    stored = scene.assembler.energy(found.u, 1.0)  # before another material is set
    own = half.energy(found.u, normal_mu, tumour_mu)
    state, x = State(found.u, found.p), np.log(first)
    for _ in range(6):
        mu = float(np.exp(x))
        uniform = _solve(scene, mu, right_mu, mu, state)
        # A stiffness changes the stored energy as if nothing moved: the slope in ln mu is the half's own energy.
        step = (stored - scene.assembler.energy(uniform.u, 1.0)) / half.energy(uniform.u, mu, mu)
        x, state = x + float(np.clip(step, -0.5, 0.5)), State(uniform.u, uniform.p)
        if abs(step) < _CLOSE:
            break
    return Effective(first, float(np.exp(x)), own / half.least_energy(found.u))


def _solve(
    scene: DrivenScene, normal_mu: float, right_mu: float, tumour_mu: float, start: State | None = None
) -> Equilibrium:
    found = scene.solve_with_tumour(np.log([4.0 * normal_mu, 4.0 * right_mu]), 4.0 * tumour_mu, start)
    if not found.converged:
        raise ConvergenceError(f"the generator found no equilibrium at small strain: {found.reason}")
    return found


def _stress_over_strain(scene: DrivenScene, found: Equilibrium, normal_mu: float, tumour_mu: float) -> float:
    mesh = scene.mesh
    here = np.isin(mesh.regions, (LEFT, TUMOUR))
    F, weight = scene.assembler.deformation_gradients(found.u)[here], scene.assembler.weight[here]
    strain = 0.5 * (F + np.swapaxes(F, 2, 3)) - np.eye(3)
    strain -= np.trace(strain, axis1=2, axis2=3)[..., None, None] / 3.0 * np.eye(3)
    mu = np.where(mesh.regions[here] == TUMOUR, tumour_mu, normal_mu)
    mean = np.einsum("cq,cqij->ij", weight, strain)
    stress_over_8 = np.einsum("cq,cqij->ij", weight * mu[:, None], strain)
    return float((stress_over_8 * mean).sum() / (mean * mean).sum())


class _Half:
    """The left half cut out of its scene, element by element as it was there."""

    def __init__(self, scene: DrivenScene) -> None:
        mesh, _ = scene.mesh.submesh((LEFT, TUMOUR))
        self.space = Space.of(mesh, scene.element)
        self._nodes = _places(self.space.nodes, scene.space.nodes)
        faces, _ = mesh.boundary
        free = np.ones(self.space.n_nodes, dtype=bool)
        free[np.unique(self.space.face_nodes(faces))] = False
        self._assembler = Assembler(self.space, np.repeat(free, 3))

    def energy(self, u: FloatArray, normal_mu: float, tumour_mu: float) -> float:
        """Of the half where the scene's nodes are displaced by u (n, 3)."""
        self._assembler.set_materials({LEFT: organ_material(4.0 * normal_mu), TUMOUR: organ_material(4.0 * tumour_mu)})
        return self._assembler.energy(u[self._nodes], 1.0)

    def least_energy(self, u: FloatArray) -> float:
        """Of a uniform half of mu = 1 kPa whose surface moves as in u; energy is proportional to mu."""
        one = organ_material(4.0)
        at = u[self._nodes]
        found = solve_equilibrium(self._assembler, {LEFT: one, TUMOUR: one}, at.ravel(), start=at)
        if not found.converged:
            raise ConvergenceError(f"no equilibrium of the half by itself: {found.reason}")
        return self._assembler.energy(found.u, 1.0)


def _places(nodes: FloatArray, among: FloatArray) -> IntArray:
    """Index (k,) in `among` of each of nodes (k, 3)."""
    order = {tuple(x): i for i, x in enumerate(np.round(among, 6).tolist())}
    return np.array([order[tuple(x)] for x in np.round(nodes, 6).tolist()], dtype=np.int64)
