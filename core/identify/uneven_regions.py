"""What a region that is not quite uniform does at the organ's surface: the error of a model with one stiffness a region.

Within a region ln G departs from the region's own value by a field, correlated over half a centimetre: a focus.
To first order a region's mean stress over its mean strain then changes by the field's mean under the weight strain : mean strain,
so that mean is taken off: what is left does not change the region's effective stiffness, yet moves the surface. Counted as noise,
it keeps what one region holds out of the value of another. How uneven each region is, exact data say themselves (`amplitudes`);
contour noise hides it, and then a factor of four is allowed for (`UNEVEN_SD`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import solve_triangular

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.sensitivity import direct
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.identify.map.patches import Patches, cut
from palpate.core.identify.map.smoothness_prior import SmoothPrior
from palpate.core.laws import bulk_modulus, mooney_rivlin_parameters

# Patches of one region on which the field is told apart, and the field, of unit standard deviation and this long, mm.
PATCHES = 100
FIELD = SmoothPrior(0.0, 0.0, 1.0, 6.0)
# Standard deviation of ln G within a region where the data cannot say.
UNEVEN_SD = float(np.log(4.0))
# Those that are compared.
_LEVELS = np.concatenate([[0.0], np.geomspace(0.02, 2.0, 19)])
_SWEEPS = 4


def uneven_responses(
    assembler: Assembler,
    parameters: StiffnessParameters,
    theta: FloatArray,
    found: Equilibrium,
    observe: Callable[[FloatArray], FloatArray],
) -> list[FloatArray]:
    """(q, m) mm for each region: columns whose outer products add up to the covariance of that error in q data at unit amplitude.

    theta : as in `StiffnessParameters`, found : the equilibrium there, solved with its stability check. observe : change of the data (q,)
    for a change of nodal displacements (n, 3).
    """
    columns = []
    for region, G in zip(parameters.regions, parameters.shear_moduli(theta), strict=True):
        patches = cut(assembler.space.mesh, (region,), PATCHES)
        unit = mooney_rivlin_parameters(1.0, bulk_modulus(1.0, parameters.facts.organ_poisson_ratio), 0.5)
        directions = [{region: np.where(patches.patch == j, G, 0.0)[:, None] * unit} for j in range(patches.n)]
        moved = direct(found.tangent, directions)
        seen = np.stack([observe(field) for field in moved], axis=1)
        about = np.eye(patches.n) - _shares(assembler, found, patches)
        covariance = about @ FIELD.local_covariance(patches.centres, patches.centres) @ about.T
        values, vectors = np.linalg.eigh(covariance)
        columns.append(seen @ (vectors * np.sqrt(np.maximum(values, 0.0))))
    return columns


def amplitudes(covariance: FloatArray, responses: Sequence[FloatArray], residual: FloatArray) -> FloatArray:
    """(regions,) standard deviation of ln G within each region under which the residual (q,) mm is most probable.

    covariance : (q, q) mm2 of all other errors. By the marginal likelihood (MacKay 1992, Bayesian interpolation), one region after
    the other: a region that is uniform gets none, and is then known as well as if it had been taken for uniform.
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


def _shares(assembler: Assembler, found: Equilibrium, patches: Patches) -> FloatArray:
    """(n,) of each patch in its region's effective stiffness, adding up to 1: volume times strain : mean strain."""
    F, weight = assembler.deformation_gradients(found.u)[patches.cells], assembler.weight[patches.cells]
    strain = 0.5 * (F + np.swapaxes(F, 2, 3)) - np.eye(3)
    strain -= np.trace(strain, axis1=2, axis2=3)[..., None, None] / 3.0 * np.eye(3)
    of_cells = np.einsum("cq,cqij->cij", weight, strain)
    along = np.einsum("cij,ij->c", of_cells, of_cells.sum(axis=0))
    share = np.bincount(patches.patch, along, patches.n)
    return np.asarray(share / share.sum(), dtype=np.float64)
