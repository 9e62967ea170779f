"""Reference scenes with one call: the paper's sphere in a cube (its Fig 7), driven by traction or by prescribed displacement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler, State
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import ORGAN, TISSUE, sphere_in_cube
from palpate.core.fem.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import traction
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, bulk_modulus
from palpate.core.mesh import TetMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

DRIVES = ("traction", "displacement")
MU = 10.0  # kPa, mu1 = mu2 of the sphere
TISSUE_G, TISSUE_NU = 20.0, 0.49
CAP_TRACTION = 30.0  # kPa outward along z on both caps: the sphere of ratio 200 grows longer by a quarter
CAP_COSINE = 0.7  # a cap is where |z| / r exceeds this
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

    def solve(
        self, options: NewtonOptions | None = None, start: FloatArray | State | None = None
    ) -> Equilibrium:
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
    coarse: TetMesh | None = None,
) -> Scene:
    """The sphere of region 1 in the cube of region 3 (`meshes.sphere_in_cube` or a refinement of it).

    drive : "traction" pulls both caps of the sphere apart with no net force, the cube's surface fixed; "displacement" strains
    the cube's surface. coarse : the mesh this one refines, so that both carry the same load. Raises InputError for another drive.
    """
    if drive not in DRIVES:
        raise InputError(f"drive '{drive}' is unknown; choose one of {', '.join(DRIVES)}")
    space = Space.of(mesh, element)
    surface = np.isclose(np.abs(space.nodes).max(axis=1), np.abs(mesh.points).max())
    prescribed = np.zeros((space.n_nodes, 3))
    terms: list[Term] = []
    if drive == "traction":
        faces, _ = mesh.region_boundary((ORGAN,))
        terms.append(traction(space, faces, cap_traction(mesh, faces, coarse or mesh)))
    else:
        prescribed[surface] = space.nodes[surface] @ FAR_STRAIN.T
    free = np.repeat(~surface, 3)
    return Scene(Assembler(space, free, terms, solver), sphere_materials(ratio), prescribed.ravel())


def cap_traction(mesh: TetMesh, faces: IntArray, coarse: TetMesh) -> FloatArray:
    """(f, 3) kPa on the sphere's faces (f, 3): along z on both caps of `coarse`, zero elsewhere, no net force."""
    coarse_faces, _ = coarse.region_boundary((ORGAN,))
    X = coarse.points[coarse_faces]
    area = 0.5 * np.linalg.norm(np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0]), axis=1)
    centre = X.mean(axis=1)
    cosine = centre[:, 2] / np.linalg.norm(centre, axis=1)
    upper, lower = cosine > CAP_COSINE, cosine < -CAP_COSINE
    t = np.zeros((len(X), 3))
    t[upper, 2] = CAP_TRACTION
    t[lower, 2] = -CAP_TRACTION * area[upper].sum() / area[lower].sum()
    return t[_parents(mesh.points[faces].mean(axis=1), X)]


def _parents(centres: FloatArray, X: FloatArray) -> IntArray:
    """Coarse triangle (c, 3, 3) that holds each point (p, 3): the nearest plane among triangles with the point inside."""
    k = min(12, len(X))
    _, near = cKDTree(X.mean(axis=1)).query(centres, k=k)
    near = near.reshape(len(centres), k)
    A, e1, e2 = X[near, 0], X[near, 1] - X[near, 0], X[near, 2] - X[near, 0]
    d = centres[:, None] - A
    normal = np.cross(e1, e2)
    nn = (normal**2).sum(axis=2)
    s = np.einsum("pki,pki->pk", np.cross(d, e2), normal) / nn
    t = np.einsum("pki,pki->pk", np.cross(e1, d), normal) / nn
    outside = np.maximum(0.0, -np.minimum(np.minimum(s, t), 1.0 - s - t))
    height = np.abs(np.einsum("pki,pki->pk", d, normal)) / nn**0.75
    return near[np.arange(len(near)), np.argmin(outside + height, axis=1)]


def standard_sphere_mesh(cells: int = 4000) -> TetMesh:
    """A sphere in a cube with about this many cells."""
    choices = [(n, max(1, n // 2), layers) for n in range(1, 17) for layers in (n, n + 1, n + 2)]
    best = min(choices, key=lambda c: abs(6 * c[0] ** 2 * (c[0] + 6 * c[1] + 6 * c[2]) - cells))
    return sphere_in_cube(*best)
