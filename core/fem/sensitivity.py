"""Derivatives of an equilibrium with respect to parameters and forces, from the factor of its tangent.

This is du/dmu of Eq 20 of Yang & Lin, MaterialCloning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.tangent import Tangent

# Region id -> rate of change of that region's law parameters, (k,) or (cells, k), per unit of the parameter theta.
Direction = Mapping[int, FloatArray]
# Right-hand sides that are solved at once: a dozen copies of all of them took a gigabyte.
_AT_ONCE = 32


def direct(tangent: Tangent, directions: Sequence[Direction]) -> FloatArray:
    """du/dtheta (t, n, 3) mm per unit of each theta, at the equilibrium of a tangent: one back-substitution each."""
    tangent.set_materials()
    return tangent.displacements(np.stack([-parameter_force(tangent, d) for d in directions], axis=1))


def response_to_forces(tangent: Tangent, forces: FloatArray) -> FloatArray:
    """du/ds (r, n, 3) mm when dead nodal forces (r, n, 3) mN per unit of s act in addition: one back-substitution
    each.
    """
    space = tangent.assembler.space
    out = np.empty((len(forces), space.n_displacements // 3, 3))
    for first in range(0, len(forces), _AT_ONCE):
        some = np.asarray(forces[first : first + _AT_ONCE], dtype=float)
        rhs = np.zeros((space.n_displacements + space.n_pressures, len(some)))
        rhs[: space.n_displacements] = some.reshape(len(some), -1).T
        out[first : first + _AT_ONCE] = tangent.displacements(rhs[tangent.assembler.kept])
    return out


def parameter_force(tangent: Tangent, direction: Direction) -> FloatArray:
    """dR/dtheta (kept,) for a parameter theta along which region r's law parameters change by direction[r] (k,) or
    (cells, k)."""
    return parameter_force_everywhere(tangent, direction)[tangent.assembler.kept]


def parameter_force_everywhere(tangent: Tangent, direction: Direction) -> FloatArray:
    """The same (3 n + n_p,) at every unknown, those that are held too.

    Uses that every law is linear in its parameters, so the derivative of the residual is the residual of the direction.
    """
    assembler, state = tangent.assembler, tangent.state
    F = assembler.deformation_gradients(state.u)
    r_u, scale = np.zeros_like(state.u), np.zeros_like(state.u)
    r_p = np.zeros(assembler.space.n_pressures)
    regions = assembler.space.mesh.regions
    for g in assembler.groups:
        rate = np.zeros_like(g.values)
        for region, d in direction.items():
            here = regions[g.cells] == region
            if here.any():
                rate[here] = d
        touched = np.abs(rate).sum(axis=1) > 0.0
        cells, rate, held = g.cells[touched], np.ascontiguousarray(rate[touched]), g.values[touched]
        if len(cells) == 0:
            continue
        v = g.law.evaluate(F[cells], rate, 1)
        stress, kappa_rate = v.P, g.law.kappa_of(rate)
        if assembler.pressures.exists:
            kappa = (assembler.kappa[cells], kappa_rate)
            shear = (g.law.shear_modulus_of(held), g.law.shear_modulus_of(rate))
            assembler.pressures.add_rate(cells, kappa, shear, state.p, r_p)
        else:
            stress = stress + (kappa_rate[:, None] * v.g)[..., None, None] * v.G
        assembler.add_internal_force(stress, cells, r_u, scale)
    return np.concatenate([r_u.reshape(-1), r_p])
