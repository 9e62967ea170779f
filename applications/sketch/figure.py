"""A drawn figure as an elastic body: an extruded mesh that moves in its plane, with smooth forces on its rim."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.applications.sketch.outline import Outline
from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.sensitivity import direct, response_to_forces
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.base import PointSet, Term, face_points
from palpate.core.fem.terms.loads import PointForce, nodal_force
from palpate.core.fem.terms.springs import Springs
from palpate.core.laws import MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.mesh import TetMesh
from palpate.core.surfaces.triangles import normals

ELEMENT = "p2"
# Unit of force coefficients over the first part's shear modulus.
FORCE_UNIT = 0.05
# Distance from a held side, in figure sizes, within which nodes are fixed.
HELD_BAND = 0.02
# Stiffness of the springs under a figure that is held nowhere, times its size squared over its shear modulus.
_BED = 0.5
_OPTIONS = NewtonOptions(rtol=1e-7, max_factorisations=60, min_load_step=1.0 / 16.0)


@dataclass(frozen=True)
class FigureOptions:
    """held : fixed sides; with none the figure rests on soft springs. poisson_ratio : of all parts."""

    held: tuple[str, ...] = ("bottom",)
    poisson_ratio: float = 0.4
    element: str = ELEMENT


class Figure:
    """The first keyframe, ready to be solved for any stiffness and rim forces.

    mesh : extruded along z, regions 1 .. P are its parts. outline : points (q, 2) of its rim that are observed.
    Parameters: theta (P - 1,) = ln of each further part's shear modulus over the first one's, and force coefficients c
    (r,), see `force_basis`. The first part's modulus is 1 kPa: shapes depend on forces over stiffness only.
    """

    def __init__(self, mesh: TetMesh, outline: Outline, options: FigureOptions | None = None) -> None:
        self.options = options or FigureOptions()
        self.outline = outline
        self.space = Space.of(mesh, self.options.element)
        self.parts = sorted(set(mesh.regions.tolist()))
        self.thickness = float(np.ptp(mesh.points[:, 2]))
        middle = 0.5 * (mesh.points[:, 2].min() + mesh.points[:, 2].max())
        rim = np.column_stack([outline.points, np.full(len(outline.points), middle)])
        self.rim = self.space.interpolation(rim)
        held = held_points(self.space.nodes[:, :2], outline, self.options.held)
        free = np.ones((self.space.n_nodes, 3), dtype=bool)
        free[:, 2] = False  # plane strain
        free[held] = False
        faces = _side_faces(mesh)
        faces = faces[~held[faces].all(axis=1)]
        self._rim_points = face_points(self.space.nodes, self.space.face_nodes(faces), 2 * self.space.element.degree)
        self._bed: tuple[Term, ...] = () if held.any() else (self._springs(),)
        every = np.arange(self.space.n_nodes)
        self._nothing = nodal_force(every, np.zeros((self.space.n_nodes, 3)))
        q = len(outline.points)
        self._slack = Springs(PointSet.of_matrix(self.rim, np.ones(q)), np.zeros((3, 3)), np.zeros((q, 3)))
        self.assembler = Assembler(self.space, free.ravel(), (self._nothing, self._slack, *self._bed))

    def force_basis(self, degree: int) -> FloatArray:
        """(r, n, 3) mN on the nodes for a unit of each coefficient, r = (degree + 1) (degree + 2).

        Dead tractions on the free rim, in FORCE_UNIT kPa: products of Legendre polynomials of x and y over the figure's
        box, along x and along y, sorted by total degree so that more degrees only add coefficients.
        """
        x = self._rim_points.positions(self.space.nodes)[:, :2]
        low, high = self.outline.points.min(axis=0), self.outline.points.max(axis=0)
        size = float((high - low).max())
        scaled = np.clip(2.0 * (x - 0.5 * (low + high)) / size, -1.0, 1.0)
        values = [np.polynomial.legendre.legvander(scaled[:, k], degree) for k in range(2)]
        shapes = [values[0][:, a - b] * values[1][:, b] for a in range(degree + 1) for b in range(a + 1)]
        basis = np.zeros((2 * len(shapes), self.space.n_nodes, 3))
        for k, shape in enumerate(shapes):
            nodal = np.zeros(self.space.n_nodes)
            weight = (FORCE_UNIT * self._rim_points.measure * shape)[:, None] * self._rim_points.weights
            np.add.at(nodal, self._rim_points.nodes, weight)
            basis[2 * k, :, 0] = basis[2 * k + 1, :, 1] = nodal
        return basis

    def materials(self, theta: FloatArray) -> Mapping[int, Material]:
        """Mooney-Rivlin of every part, kPa."""
        moduli = np.exp(np.concatenate([[0.0], theta]))
        return {part: Material(MOONEY_RIVLIN, self._law(G)) for part, G in zip(self.parts, moduli, strict=True)}

    def solve(self, theta: FloatArray, force: FloatArray, start: State | None = None) -> Equilibrium:
        """Equilibrium under nodal forces (n, 3) mN."""
        self.loaded(force)
        return self.equilibrium(theta, start)

    def equilibrium(self, theta: FloatArray, start: State | None = None) -> Equilibrium:
        """Equilibrium under what `loaded` has put on the figure."""
        return solve_equilibrium(self.assembler, self.materials(theta), start=start, options=_OPTIONS)

    def loaded(self, force: FloatArray, goal: FloatArray | None = None, stiffness: float = 0.0) -> None:
        """Put dead nodal forces (n, 3) mN on the figure, and springs that pull the observed points of its rim to
        displacements goal (q, 3) mm; stiffness : of the springs, over the first part's shear modulus and the figure's
        size.
        """
        points: PointSet = self._nothing.points
        springs = self._slack if goal is None else self.springs(goal, stiffness)
        self.assembler.terms = (PointForce(points, force), springs, *self._bed)

    def springs(self, goal: FloatArray, stiffness: float) -> Springs:
        """See `loaded`."""
        area = self.outline.length / len(goal) * self.thickness
        points = PointSet(self._slack.points.nodes, self._slack.points.weights, np.full(len(goal), area))
        return Springs(points, stiffness / self.outline.size * np.diag([1.0, 1.0, 0.0]), goal)

    def pull(self, u: FloatArray, goal: FloatArray, stiffness: float) -> FloatArray:
        """(3,) mN, what the springs of `loaded` pull with in all."""
        springs = self.springs(goal, stiffness)
        _, gradient, _ = springs.evaluate(u, 1.0, 1)
        return -np.asarray(gradient.reshape(-1, 3).sum(axis=0))

    def sensitivities(self, theta: FloatArray, equilibrium: Equilibrium, basis: FloatArray) -> FloatArray:
        """Derivative (q, 2, P - 1 + r) mm of the rim's points in every parameter, at an equilibrium."""
        moves = [self.rim @ s for s in response_to_forces(equilibrium.tangent, basis)]
        if len(theta):
            own = direct(equilibrium.tangent, self._directions(theta))
            moves = [self.rim @ s for s in own] + moves
        return np.stack(moves, axis=2)[:, :2]

    def rim_at(self, u: FloatArray) -> Outline:
        """The rim at nodal displacements u (n, 3) mm."""
        points = self.outline.points + (self.rim @ u)[:, :2]
        ends = np.cumsum([len(loop) for loop in self.outline.loops])[:-1]
        return Outline(tuple(np.split(points, ends)))

    def _law(self, G: float) -> FloatArray:
        return mooney_rivlin_parameters(G, bulk_modulus(G, self.options.poisson_ratio))

    def _directions(self, theta: FloatArray) -> list[dict[int, FloatArray]]:
        return [{part: self._law(float(np.exp(t)))} for part, t in zip(self.parts[1:], theta, strict=True)]

    def _springs(self) -> Springs:
        share = np.zeros(self.space.n_nodes)
        nodes = self.space.cell_nodes
        np.add.at(share, nodes, np.repeat(self.space.mesh.volumes[:, None] / nodes.shape[1], nodes.shape[1], axis=1))
        every = PointSet(np.arange(len(share))[:, None], np.ones((len(share), 1)), share)
        return Springs(every, _BED / self.outline.size**2 * np.eye(3), np.zeros((len(share), 3)))


def held_points(x: FloatArray, outline: Outline, sides: tuple[str, ...], band: float = HELD_BAND) -> BoolArray:
    """(n,) whether points (n, 2) lie at one of the sides of the outline's box, within `band` figure sizes."""
    low, high = outline.points.min(axis=0), outline.points.max(axis=0)
    away = {"bottom": x[:, 1] - low[1], "top": high[1] - x[:, 1], "left": x[:, 0] - low[0], "right": high[0] - x[:, 0]}
    held = np.zeros(len(x), dtype=bool)
    for side in sides:
        held |= away[side] < band * outline.size
    return held


def _side_faces(mesh: TetMesh) -> IntArray:
    """Boundary faces (f, 3) that are not the flat front or back of the extrusion."""
    faces, _ = mesh.boundary
    return faces[np.abs(normals(mesh.points[faces])[:, 2]) < 0.5]
