"""Data of the paper's studies: the organ's two surfaces from a fine mesh of another element, and how stiff its halves really are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.validate.paper.tumour_effective import Effective, effective
from palpate.validate.paper.tumour_scene import (
    LEFT,
    NORMAL_MU,
    RIGHT,
    TUMOUR,
    Divisions,
    DrivenScene,
    halved_ball,
    with_tumour,
)

# Another element than any that identifies, on a finer mesh.
DATA_ELEMENT = "p2p0"
DATA_DIVISIONS = Divisions(6, 3, 5)
# Share of the far strain at which a half's effective stiffness is taken.
SMALL = 0.02


@dataclass(frozen=True, eq=False)
class TumourData:
    """organ : surface at rest and deformed. share : of the left half that is tumour. effective_mu : (2,) kPa, what the left
    and the right half really have as a whole, mean stress over mean strain. left : the left one by its other definitions too,
    where they were asked for."""

    organ: SurfacePair
    share: float
    tumour_mu: float
    effective_mu: FloatArray
    left: Effective


def tumour_data(
    share: float, tumour_mu: float, divisions: Divisions = DATA_DIVISIONS, normal_mu: float = NORMAL_MU,
    right_mu: float | None = None, strain: float = 1.0, energies: bool = False,
) -> TumourData:  # fmt: skip
    """A pair of which the stiffness is known. energies : see `tumour_effective`.

    Raises ConvergenceError when the generator finds no equilibrium.
    """
    mesh = with_tumour(halved_ball(divisions), share)
    scene = DrivenScene(mesh, DATA_ELEMENT, strain)
    right_mu = normal_mu if right_mu is None else right_mu
    found = scene.solve_with_tumour(np.log([4.0 * normal_mu, 4.0 * right_mu]), 4.0 * tumour_mu)
    if not found.converged:
        raise ConvergenceError(f"the generator found no equilibrium: {found.reason}")
    whole = mesh.volumes[np.isin(mesh.regions, (LEFT, TUMOUR))].sum()
    really = float(mesh.volumes[mesh.regions == TUMOUR].sum() / whole)
    left = Effective(normal_mu, normal_mu, normal_mu)
    if really > 0.0:
        left = effective(DrivenScene(mesh, DATA_ELEMENT, SMALL), normal_mu, right_mu, tumour_mu, energies)
    has = np.array([left.stress_over_strain, right_mu])
    return TumourData(_surfaces(scene, found), really, tumour_mu, has, left)


def _surfaces(scene: DrivenScene, found: Equilibrium) -> SurfacePair:
    """The organ's outer surface, each quadratic face as four triangles, the faces of the tumour's half marked as the left's."""
    mesh = scene.mesh
    faces, owner = mesh.region_boundary((LEFT, RIGHT, TUMOUR))
    nodes = scene.space.face_nodes(faces)
    four = nodes[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)
    used, inverse = np.unique(four, return_inverse=True)
    region = np.where(mesh.regions[owner] == RIGHT, RIGHT, LEFT)
    triangles, label = inverse.reshape(-1, 3), np.repeat(region, 4)
    at_rest = scene.space.nodes[used]
    return SurfacePair(Surface(at_rest, triangles, label), Surface(at_rest + found.u[used], triangles, label))
