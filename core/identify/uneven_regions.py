"""Heterogeneity error: effect on the organ's surface of stiffness variation within a region.

Within a region ln G is the region's value plus a random field with a correlation length of 6 mm, the size of a focus.
To first order the region's effective stiffness changes by the mean of that field under the weight strain : mean strain.
This mean is subtracted. The rest leaves the effective stiffness unchanged but moves the surface. Counted as noise, it
keeps a focus in one region from biasing another. `amplitudes` estimates the amplitude of each region from exact data.
Contour noise hides it; `UNEVEN_SD`, a factor of four, is then assumed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.sensitivity import direct
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.identify.map.patches import Patches, cut
from palpate.core.observe.contour_noise import matern_3_2

# Number of patches of one region, and the correlation length of the field, mm.
PATCHES = 100
FIELD_MM = 6.0
# Standard deviation of ln G within a region, assumed where the data do not determine it.
UNEVEN_SD = float(np.log(4.0))
# Amplitudes that are compared.
_LEVELS = np.concatenate([[0.0], np.geomspace(0.02, 2.0, 19)])
_SWEEPS = 4


def uneven_responses(
    assembler: Assembler,
    parameters: StiffnessParameters,
    theta: FloatArray,
    equilibrium: Equilibrium,
    observe: Callable[[FloatArray], FloatArray],
) -> list[FloatArray]:
    """(q, m) mm for each region: factor R of the error covariance R R' of q data at unit amplitude.

    theta : as in `StiffnessParameters`. observe : change of the data (q,) for a change of nodal displacements (n, 3).
    Precondition: the equilibrium at theta was solved with its stability check.
    """
    columns = []
    for region, G in zip(parameters.regions, parameters.shear_moduli(theta), strict=True):
        patches = cut(assembler.space.mesh, (region,), PATCHES)
        unit = parameters.of_modulus(1.0)
        directions = [{region: np.where(patches.patch == j, G, 0.0)[:, None] * unit} for j in range(patches.n)]
        displacements = direct(equilibrium.tangent, directions)
        sensitivities = np.stack([observe(field) for field in displacements], axis=1)
        about = np.eye(patches.n) - _shares(assembler, equilibrium, patches)
        covariance = about @ matern_3_2(cdist(patches.centres, patches.centres), FIELD_MM) @ about.T
        values, vectors = np.linalg.eigh(covariance)
        columns.append(sensitivities @ (vectors * np.sqrt(np.maximum(values, 0.0))))
    return columns


def amplitudes(covariance: FloatArray, responses: Sequence[FloatArray], residual: FloatArray) -> FloatArray:
    """(regions,) standard deviation of ln G within each region that maximises the marginal likelihood of the residual
    (q,) mm.

    covariance : (q, q) mm2 of all other errors. Method: coordinate search on the evidence (MacKay 1992, Bayesian
    interpolation). A homogeneous region gets 0.
    """
    parts = [response @ response.T for response in responses]
    chosen = np.full(len(parts), 0.2)

    def surprise(sd: FloatArray) -> float:
        total = covariance + sum(s**2 * part for s, part in zip(sd, parts, strict=True))
        factor = np.linalg.cholesky(total)
        return float((solve_triangular(factor, residual, lower=True) ** 2).sum() + 2.0 * np.log(np.diag(factor)).sum())

    for _ in range(_SWEEPS):
        before = chosen.copy()
        for k in range(len(parts)):
            tried = [np.where(np.arange(len(parts)) == k, level, chosen) for level in _LEVELS]
            chosen = min(tried, key=surprise)
        if (chosen == before).all():
            break
    return np.asarray(chosen, dtype=np.float64)


def _shares(assembler: Assembler, equilibrium: Equilibrium, patches: Patches) -> FloatArray:
    """(n,) weight of each patch in its region's effective stiffness, with sum 1: volume times strain : mean strain."""
    F, weight = assembler.deformation_gradients(equilibrium.u)[patches.cells], assembler.weight[patches.cells]
    strain = 0.5 * (F + np.swapaxes(F, 2, 3)) - np.eye(3)
    strain -= np.trace(strain, axis1=2, axis2=3)[..., None, None] / 3.0 * np.eye(3)
    of_cells = np.einsum("cq,cqij->cij", weight, strain)
    along = np.einsum("cij,ij->c", of_cells, of_cells.sum(axis=0))
    share = np.bincount(patches.patch, along, patches.n)
    return np.asarray(share / share.sum(), dtype=np.float64)
