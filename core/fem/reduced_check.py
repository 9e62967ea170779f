"""Asks the equations themselves how far a predicted displacement is from equilibrium: one Newton correction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.linear_solvers import FactorisationError
from palpate.core.fem.materials import Material
from palpate.core.fem.state import State

FloatArray = NDArray[np.float64]


def newton_correction(assembler: Assembler, materials: Mapping[int, Material], u: FloatArray) -> FloatArray | None:
    """What one Newton step would add to nodal displacements u (n, 3) mm, as (n, 3) mm; None where no step exists.

    Its size is the error of u up to the error's square, so this checks a reduced model of all nodes without any calibration, at
    the price of one assembly and one factorisation instead of the five or more of a full solve. u plus the correction is the
    better answer. Constrained unknowns of u must already have their values. Raises nothing: an inverted u gives None.
    """
    assembler.set_materials(materials)
    if not np.isfinite(u).all() or not assembler.min_jacobian(u) > 0.0:
        return None
    state = State(u, assembler.balanced_pressure(u))
    residual = assembler.residual(state, 1.0)
    values, _ = assembler.tangent(state, 1.0)
    try:
        assembler.solver.factorise(values)
    except FactorisationError:
        return None
    step = assembler.solver.solve(-np.concatenate([residual.r_u, residual.r_p])[assembler.kept])
    n = assembler.space.n_displacements
    full = np.zeros(n + assembler.space.n_pressures)
    full[assembler.kept] = step
    return full[:n].reshape(-1, 3)
