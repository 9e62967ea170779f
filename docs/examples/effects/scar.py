"""Scar around a point: organ and tissue near it are stiffer alike."""

import numpy as np

from palpate.core.diagnose.effects import Effect, Parameter, Variant
from palpate.core.forward.material_changes import scaled

RADIUS_MM = 12.0


def variants(around):
    """Where it could be: about every 14 mm in the organ."""
    problem = around.problem
    inside = np.isin(problem.mesh.regions, problem.regions)
    centres = around.spread_points(around.cell_centres[inside], 14.0)
    return [variant(around.cell_centres, centre) for centre in centres]


def variant(cells, centre):
    share = np.exp(-0.5 * ((cells - centre) ** 2).sum(axis=1) / RADIUS_MM**2)

    def change(composition, phi):
        everything = (*composition.problem.regions, 3)
        return composition.with_law(scaled(everything, np.exp(phi[0] * share)))

    return Variant(change, "at ({:.0f}, {:.0f}, {:.0f})".format(*centre), tuple(centre.tolist()))


EFFECT = Effect(
    id="scar",
    words="a scar has stiffened organ and tissue around one place",
    parameters=(Parameter("log_contrast", unit="1", scale=1.0, low=-3.0, high=3.0),),
    variants=variants,
    settled_by="an elastography of the scarred place",
)
