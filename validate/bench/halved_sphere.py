"""Two unknown stiffnesses, for benchmarks and tests: the sphere in a cube, its halves regions 1 and 2, strained from outside."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import ORGAN, TISSUE, sphere_in_cube
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.scenes import FAR_STRAIN, TISSUE_G, TISSUE_NU
from palpate.core.fem.sensitivity import direct
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.mesh import TetMesh

BOUNDS = np.log([[5.0, 500.0], [5.0, 500.0]])


class HalvedSphere:
    """theta = ln G of both halves; `observed` are the sphere's surface nodes."""

    def __init__(self, divisions: tuple[int, int, int] = (2, 1, 2), element: str = "p1p1", strain: float = 1.0) -> None:
        mesh = sphere_in_cube(*divisions)
        centre = mesh.points[mesh.cells].mean(axis=1)
        second = (mesh.regions == ORGAN) & (centre @ np.array([1.0, 0.4, -0.2]) > 0.5)
        self.space = Space.of(TetMesh(mesh.points, mesh.cells, np.where(second, 2, mesh.regions)), element)
        surface = np.isclose(np.abs(self.space.nodes).max(axis=1), np.abs(mesh.points).max())
        self.assembler = Assembler(self.space, np.repeat(~surface, 3))
        self.prescribed = np.where(surface[:, None], strain * self.space.nodes @ FAR_STRAIN.T, 0.0).ravel()
        self.observed = np.unique(self.space.mesh.region_boundary((1, 2))[0])

    def materials(self, theta: FloatArray) -> dict[int, Material]:
        """Mooney-Rivlin halves in linear tissue."""
        tissue = Material(LINEAR, np.array([TISSUE_G, bulk_modulus(TISSUE_G, TISSUE_NU)]))
        return {TISSUE: tissue, **{r: Material(MOONEY_RIVLIN, v) for r, v in self._rates(theta).items()}}

    def solve(
        self, theta: FloatArray, start: State | FloatArray | None = None, options: NewtonOptions | None = None
    ) -> Equilibrium:
        """Equilibrium at theta (2,)."""
        return solve_equilibrium(self.assembler, self.materials(theta), self.prescribed, start, options)

    def sensitivities(self, theta: FloatArray, found: Equilibrium) -> FloatArray:
        """du/dtheta (2, n, 3) mm at the equilibrium `found` of theta (2,)."""
        directions = [{region: rate} for region, rate in self._rates(theta).items()]
        return direct(found.tangent, directions)

    def _rates(self, theta: FloatArray) -> dict[int, FloatArray]:
        moduli = np.exp(np.asarray(theta, dtype=float))
        return {r: mooney_rivlin_parameters(G, bulk_modulus(G, 0.495)) for r, G in zip((1, 2), moduli, strict=True)}
