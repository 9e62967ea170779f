"""The scene of the paper's studies (its Figs 7 and 9): an organ of two halves in a block of tissue, a tumour in the left half.

The block's surface is strained, so the drive is known exactly; the organ's surface is what is seen. Sizes are a prostate's: a
ball of 20 mm radius, because what contours of 0.4 mm error tell depends on the organ's size. The paper's kPa are mu; here as there
mu1 = mu2 = mu, so G = 4 mu, the tissue's 20 kPa too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler, State
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import sphere_in_cube
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.scenes import FAR_STRAIN
from palpate.core.fem.sensitivity import direct
from palpate.core.fem.space import Space
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.laws import MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.mesh import TetMesh
from palpate.core.problem import Facts

RADIUS_MM, HALF_MM = 20.0, 50.0
LEFT, RIGHT, TISSUE, TUMOUR = 1, 2, 3, 7
REGIONS: Mapping[int, str] = {LEFT: "prostate_left", RIGHT: "prostate_right"}
NORMAL_MU, TUMOUR_MU, TISSUE_MU = 30.0, 70.0, 20.0
FACTS = Facts(tissue_shear_modulus_kpa=4.0 * TISSUE_MU, bounds_kpa=(20.0, 4000.0), noise_sd_mm=0.4)
# Centre of mass of the left half-ball (x > 0 is the patient's left), about which a tumour grows.
_HEART = np.array([0.375 * RADIUS_MM, 0.0, 0.0])


@dataclass(frozen=True)
class Divisions:
    """Of `meshes.sphere_in_cube`. n is even, so that a plane of the mesh halves the ball."""

    n: int = 4
    shells: int = 2
    layers: int = 4

    @property
    def cells(self) -> int:
        """Number of tetrahedra."""
        return 6 * self.n**2 * (self.n + 6 * self.shells + 6 * self.layers)


def halved_ball(divisions: Divisions, volume: float | None = None) -> TetMesh:
    """Halves `LEFT` (x > 0) and `RIGHT` in tissue. volume : mm3 the ball shall have; a coarse ball's flat faces cut some off."""
    mesh = sphere_in_cube(divisions.n, divisions.shells, divisions.layers, RADIUS_MM, HALF_MM)
    if volume is not None:
        radius = RADIUS_MM * (volume / organ_volume(mesh)) ** (1.0 / 3.0)
        mesh = sphere_in_cube(divisions.n, divisions.shells, divisions.layers, radius, HALF_MM)
    centre = mesh.points[mesh.cells].mean(axis=1)
    return TetMesh(
        mesh.points, mesh.cells, np.where(mesh.regions == TISSUE, TISSUE, np.where(centre[:, 0] > 0.0, LEFT, RIGHT))
    )


def organ_volume(mesh: TetMesh) -> float:
    """mm3 of all that is not tissue."""
    return float(mesh.volumes[mesh.regions != TISSUE].sum())


def with_tumour(mesh: TetMesh, share: float) -> TetMesh:
    """The mesh with the inmost cells of the left half, `share` of its volume, as region `TUMOUR`: the half-ball made smaller."""
    left = np.flatnonzero(mesh.regions == LEFT)
    y = mesh.points[mesh.cells[left]].mean(axis=1) - _HEART
    order = np.argsort(_gauge(y), kind="stable")
    volume = mesh.volumes[left[order]]
    inside = np.cumsum(volume) - 0.5 * volume <= share * volume.sum()
    regions = mesh.regions.copy()
    regions[left[order[inside]]] = TUMOUR
    return TetMesh(mesh.points, mesh.cells, regions)


def _gauge(y: FloatArray) -> FloatArray:
    """Least s for which y / s (k, 3), seen from the half-ball's centre of mass, lies in the half-ball."""
    plane = -y[:, 0] / _HEART[0]
    a = (y**2).sum(axis=1)
    b = y @ _HEART
    c = RADIUS_MM**2 - _HEART @ _HEART
    sphere = (b + np.sqrt(b**2 + a * c)) / c
    return np.maximum(plane, sphere)


@dataclass(eq=False)
class DrivenScene:
    """A mesh of organ regions in tissue with its outer surface strained; to be solved for any stiffness.

    strain : share of `FAR_STRAIN`. parameters : of the regions 1 and 2; a tumour's stiffness is told apart in `solve`.
    """

    mesh: TetMesh
    element: str = "p2p1"
    strain: float = 1.0
    facts: Facts = FACTS
    space: Space = field(init=False)
    assembler: Assembler = field(init=False)
    parameters: StiffnessParameters = field(init=False)

    def __post_init__(self) -> None:
        self.space = Space.of(self.mesh, self.element)
        outer = np.isclose(np.abs(self.space.nodes).max(axis=1), np.abs(self.mesh.points).max())
        self.prescribed = np.where(outer[:, None], self.strain * self.space.nodes @ FAR_STRAIN.T, 0.0).ravel()
        self.assembler = Assembler(self.space, np.repeat(~outer, 3))
        self.parameters = StiffnessParameters(tuple(REGIONS), self.facts)

    def solve(self, theta: FloatArray, start: State | None = None, options: NewtonOptions | None = None) -> Equilibrium:
        """Equilibrium at theta = ln G (2,) of the halves."""
        return solve_equilibrium(self.assembler, self.parameters.materials(theta), self.prescribed, start, options)

    def solve_with_tumour(self, theta: FloatArray, tumour_G: float, start: State | None = None) -> Equilibrium:
        """Equilibrium with G kPa in region `TUMOUR`, theta (2,) elsewhere in the halves."""
        materials = self.parameters.materials(theta) | {TUMOUR: organ_material(tumour_G, self.facts)}
        return solve_equilibrium(self.assembler, materials, self.prescribed, start)

    def displacement_sensitivities(self, theta: FloatArray, found: Equilibrium) -> FloatArray:
        """du/dtheta (2, n, 3) mm at the equilibrium `found` of theta (2,)."""
        return direct(found.tangent, self.parameters.directions(theta))


def organ_material(G: float, facts: Facts = FACTS) -> Material:
    """Mooney-Rivlin with mu1 = mu2 and the organ's fixed Poisson ratio."""
    return Material(MOONEY_RIVLIN, mooney_rivlin_parameters(G, bulk_modulus(G, facts.organ_poisson_ratio)))
