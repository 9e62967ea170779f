"""Pressures q at the quadrature points as further unknowns of elements that have none; see `mixed`."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem import kernels
from palpate.core.fem.assembly import Assembler


def point_pressures(assembler: Assembler, u: FloatArray) -> FloatArray:
    """kappa g (m, points) kPa."""
    F = assembler.deformation_gradients(u)
    out = np.empty(assembler.weight.shape)
    for g in assembler.groups:
        out[g.cells] = assembler.kappa[g.cells, None] * g.law.evaluate(F[g.cells], g.values, 0).g
    return out


def pressure_slopes(assembler: Assembler, u: FloatArray) -> FloatArray:
    """G0 = dg/dF (m, points, 3, 3)."""
    F = assembler.deformation_gradients(u)
    out = np.empty_like(F)
    for g in assembler.groups:
        out[g.cells] = g.law.evaluate(F[g.cells], g.values, 1).G
    return out


def pressure_step(assembler: Assembler, slopes: FloatArray, lag: FloatArray, du: FloatArray) -> FloatArray:
    """What q (m, points) gains where nodes move by du (n, 3): lag + kappa G0 : grad du."""
    out = np.empty_like(lag)
    space = assembler.space
    kernels.volume_rates(du, space.cell_nodes, space.element.dN, space.inverse_jacobians, slopes, out)
    return lag + assembler.kappa[:, None] * out
