"""Stiffness-proportional damping without drag on rotation: sigma = 2 beta G d, with d the rate of deformation.

For small strains it is the stiffness-proportional part of Rayleigh damping, C = beta K, on the shear: a mode of angular
frequency w has the damping ratio beta w / 2. Written with Edot = sym(F' Fdot), a rigid motion dissipates nothing,
however fast it turns.
"""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem import kernels
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.linear.pattern import scatter


class Viscosity:
    """Damping of an assembler's body with its present materials.

    beta : s, time of relaxation; the shear viscosity of a cell is beta G, kPa s.
    """

    def __init__(self, assembler: Assembler, beta: float) -> None:
        self._assembler, self.beta = assembler, beta
        self._eta = np.zeros(len(assembler.space.mesh.cells))
        for group in assembler.groups:
            self._eta[group.cells] = beta * group.law.shear_modulus_of(group.values)

    def values(self, u: FloatArray) -> FloatArray:
        """Upper triangle (nnz,) of the damping matrix of the kept unknowns where displacements are u (n, 3), mN s/mm.

        With b = F F', the force's derivative with respect to the rate of F is eta (b_ik delta_JL + F_iL F_kJ).
        """
        a, space = self._assembler, self._assembler.space
        F = a.deformation_gradients(u)
        m, q = F.shape[:2]
        b = np.einsum("mqiM,mqkM->mqik", F, F)
        A = np.einsum("mqik,JL->mqiJkL", b, np.eye(3)) + np.einsum("mqiL,mqkJ->mqiJkL", F, F)
        A = np.ascontiguousarray((self._eta[:, None, None, None, None, None] * A).reshape(m, q, 9, 9))
        e, cells = space.element, np.arange(m)
        d = 3 * e.n_nodes + e.n_pressures
        blocks = np.empty((m, d, d))
        nothing = np.zeros((m, e.n_pressures, e.n_pressures))
        kernels.tangent_blocks(
            A, np.zeros_like(F), e.Np, e.dN, space.inverse_jacobians, a.weight, cells, nothing, blocks
        )
        out = np.zeros(len(a.pattern.indices))
        scatter(blocks, a.pattern.slots[0], out)
        return out
