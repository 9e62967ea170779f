"""Reference scenes with one call: the paper's sphere in a cube (its Fig 7), driven by traction or by prescribed
displacement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import ORGAN, TISSUE, sphere_in_cube
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.base import Term, face_points
from palpate.core.fem.terms.loads import PointForce
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, bulk_modulus
from palpate.core.mesh import TetMesh

DRIVES = ("traction", "displacement")
MU = 10.0  # kPa, mu1 = mu2 of the sphere
TISSUE_G, TISSUE_NU = 20.0, 0.49
CAP_TRACTION = 60.0  # kPa outward along z at both poles: the sphere grows longer by a quarter
CAP_COSINE = 0.4  # a cap is where |z| / r exceeds this
# Far strain of the cube's surface, no change of volume: -15 % along a skew axis.
FAR_STRAIN = np.array([[0.09, 0.05, -0.03], [0.05, 0.06, 0.04], [-0.03, 0.04, -0.15]])


@dataclass(frozen=True, eq=False)
class Scene:
    """Something to solve: an assembler, materials by region, prescribed displacements (3 n,) mm."""

    assembler: Assembler
    materials: Mapping[int, Material]
    prescribed: FloatArray

    @property
    def space(self) -> Space:
        """The discrete space."""
        return self.assembler.space

    def solve(self, options: NewtonOptions | None = None, start: FloatArray | State | None = None) -> Equilibrium:
        """See `solve_equilibrium`."""
        return solve_equilibrium(self.assembler, self.materials, self.prescribed, start, options)


def sphere_materials(ratio: float, mu: float = MU) -> dict[int, Material]:
    """Mooney-Rivlin sphere with mu1 = mu2 = mu kPa and v1 = ratio mu; linear tissue."""
    tissue = np.array([TISSUE_G, bulk_modulus(TISSUE_G, TISSUE_NU)])
    return {ORGAN: Material(MOONEY_RIVLIN, np.array([mu, mu, ratio * mu])), TISSUE: Material(LINEAR, tissue)}


def sphere_scene(
    mesh: TetMesh,
    element: str,
    ratio: float = 200.0,
    drive: str = "traction",
    solver: str = "auto",
) -> Scene:
    """The sphere of region 1 in the cube of region 3 (`meshes.sphere_in_cube` or a refinement of it).

    drive : "traction" pulls both caps of the sphere apart with no net force, the cube's surface fixed; "displacement"
    strains the cube's surface. Raises InputError for another drive.
    """
    if drive not in DRIVES:
        raise InputError(f"drive '{drive}' is unknown; choose one of {', '.join(DRIVES)}")
    space = Space.of(mesh, element)
    surface = np.isclose(np.abs(space.nodes).max(axis=1), np.abs(mesh.points).max())
    prescribed = np.zeros((space.n_nodes, 3))
    terms: list[Term] = []
    if drive == "traction":
        faces, _ = mesh.region_boundary((ORGAN,))
        terms.append(cap_pull(space, faces))
    else:
        prescribed[surface] = space.nodes[surface] @ FAR_STRAIN.T
    free = np.repeat(~surface, 3)
    return Scene(Assembler(space, free, terms, solver), sphere_materials(ratio), prescribed.ravel())


def cap_pull(space: Space, faces: IntArray) -> PointForce:
    """Dead load on the sphere's faces (f, 3): along z, outwards on both caps, smoothly from nothing at their edge; no
    net force.
    """
    points = face_points(space.nodes, space.face_nodes(faces), 4)
    x = points.positions(space.nodes)
    cosine = x[:, 2] / np.linalg.norm(x, axis=1)
    share = np.maximum(0.0, (np.abs(cosine) - CAP_COSINE) / (1.0 - CAP_COSINE)) ** 2
    pull = points.measure * CAP_TRACTION * share
    upper = cosine > 0.0
    pull[~upper] *= -pull[upper].sum() / pull[~upper].sum()
    return PointForce(points, pull[:, None] * np.array([0.0, 0.0, 1.0]))


def standard_sphere_mesh(cells: int = 4000) -> TetMesh:
    """A sphere in a cube with about this many cells."""
    choices = [(n, max(1, n // 2), layers) for n in range(1, 17) for layers in (n, n + 1, n + 2)]
    best = min(choices, key=lambda c: abs(6 * c[0] ** 2 * (c[0] + 6 * c[1] + 6 * c[2]) - cells))
    return sphere_in_cube(*best)
