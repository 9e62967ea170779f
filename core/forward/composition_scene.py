"""The coupled scene of a composition: with its laws, loads, interface, supports and stress-free geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.sensitivity import Direction, direct
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.forward.composition import Composition, Patch
from palpate.core.forward.coupled_scene import CoupledScene
from palpate.core.forward.cut_interface import sliding_springs
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.forward.scene_parts import dead_load, moved_observation, on_other_shape, prolonged, wall_of
from palpate.core.forward.shared_geometry import SharedGeometry, WallsAt
from palpate.core.mesh import TetMesh
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem

# Stiffness across an opened interface over the tissue's shear modulus, 1/mm: the two sides stay within 0.03 mm.
ACROSS = 200.0
# Step of ln G in central differences of the materials.
_STEP = 1e-4


class CompositionScene(CoupledScene):
    """`CoupledScene` of a composition.

    Nodal displacements are counted from the stress-free mesh; `seen` counts them from the scanned one. Raises
    InputError when the problem has nothing that deforms the organ or nothing that holds it.
    """

    def __init__(self, geometry: SharedGeometry, composition: Composition) -> None:
        self.geometry, self.composition = geometry, composition
        cut = geometry.cut if composition.interface > 0.0 else None
        self.problem = geometry.problem if cut is None else cut.problem
        self.parameters = StiffnessParameters(self.problem.regions, self.problem.facts, geometry.split_mu)
        scanned = self.problem.mesh
        shift = np.zeros_like(scanned.points) if composition.geometry is None else composition.geometry
        shift = shift if cut is None else shift[cut.original]
        mesh = scanned if not shift.any() else TetMesh(scanned.points + shift, scanned.cells, scanned.regions)
        self.space = geometry.space if mesh is geometry.problem.mesh else Space.of(mesh, geometry.element)
        self.shift = prolonged(shift, self.space)
        scanned_nodes = self.space.nodes - self.shift
        if not geometry.fields and not composition.on_bench:
            raise InputError("the case shows neither bladder nor rectum in both scans: nothing drives the organ")
        self._set_walls("at rest", np.zeros_like(self.shift), 1.0, lambda: self._walls_at_rest(scanned_nodes))
        self.loads: tuple[Term, ...] = (dead_load(self.space, [make(self.space) for make in composition.load]),)
        if cut is not None:
            G = self.problem.facts.tissue_shear_modulus_kpa
            across = ACROSS * G
            along = 1.0 / (composition.interface + 1.0 / across)
            self.loads = (*self.loads, sliding_springs(self.space, cut.split, across, along))
        held = self.held_nodes()
        free = np.ones((self.space.n_nodes, 3), dtype=bool)
        free[held] = False
        for patch in composition.patches:
            free[np.ix_(self._nodes_of(patch), patch.axes)] = False
        if free.all():
            raise InputError("the case has no bone and no fixed outer surface: nothing holds the organ in place")
        self.prescribed = self._prescribed(scanned_nodes)
        self.observation = (
            geometry.observation if cut is None else moved_observation(geometry.observation, self.space, self.problem)
        )
        self.assembler = self._assembler(free.ravel())
        self.linearised_at = np.zeros((self.space.n_nodes, 3))

    def solve(
        self, theta: FloatArray, start: State | FloatArray | None = None, options: NewtonOptions | None = None
    ) -> Equilibrium:
        """Equilibrium at ln G = theta (t,)."""
        self.assembler.terms = self.terms
        return solve_equilibrium(self.assembler, self.materials(theta), self.prescribed, start, options)

    def linearise(self, u: FloatArray, way: float = 1.0) -> None:
        """See `CoupledScene.linearise`."""
        self.linearised_at = u
        self._set_walls("last", u, way, lambda: [wall.linearised(u, way) for wall in self.walls])
        self.assembler.terms = self.terms

    def _set_walls(self, when: str, u: FloatArray, way: float, made: Callable[[], list[SlidingWall]]) -> None:
        """Walls and drags linearised at u (n, 3) mm: those that another scene on the scanned mesh has there, else made anew."""
        memory = self.geometry.walls_at if self.space.mesh is self.geometry.problem.mesh else {}
        known, motions = memory.get(when), tuple(self.geometry.motions.values())
        if known is None or not known.fits(u, way, motions):
            self.walls = made()
            known = memory[when] = WallsAt(u.copy(), way, motions, tuple(self.walls), tuple(self._drags(u, way)))
        self.walls, self.drags = list(known.walls), list(known.drags)

    def _walls_at_rest(self, scanned_nodes: FloatArray) -> list[SlidingWall]:
        fields = self.geometry.fields.items()
        return [wall_of(pair, self.problem, name, self.space, scanned_nodes) for name, pair in fields]

    @property
    def terms(self) -> tuple[Term, ...]:
        """All terms that act on the body: walls, drags along them, loads and interface."""
        return (*self.walls, *self.drags, *self.loads)

    def _drags(self, u: FloatArray, way: float) -> list[Springs]:
        shear = self.problem.facts.tissue_shear_modulus_kpa
        motions = self.geometry.motions.values()
        return [
            motion.drag(wall, wall.points.displacements(self.shift), u, way, shear)
            for wall, motion in zip(self.walls, motions, strict=True)
        ]

    def materials(self, theta: FloatArray) -> dict[int, Material]:
        """The composition's materials at ln G = theta (t,)."""
        composition = replace(self.composition, problem=self.problem)
        return composition.materials(self.parameters.materials(theta))

    def directions(self, theta: FloatArray) -> list[Direction]:
        """Derivatives of the composition's material values in each ln G, by central differences."""
        out: list[Direction] = []
        for k in range(len(theta)):
            h = np.zeros(len(theta))
            h[k] = _STEP
            high, low = self.materials(theta + h), self.materials(theta - h)
            out.append({r: (np.asarray(high[r].values) - np.asarray(low[r].values)) / (2.0 * _STEP) for r in high})
        return out

    def displacement_sensitivities(self, theta: FloatArray, equilibrium: Equilibrium) -> FloatArray:
        """du/dtheta (t, n, 3) mm at the equilibrium of theta (t,), solved with its stability check."""
        return direct(equilibrium.tangent, self.directions(theta))

    def seen(self, u: FloatArray) -> FloatArray:
        """Nodal displacements (n, 3) mm from the scanned rest state, for u from the stress-free one."""
        return u + self.shift

    def _prescribed(self, scanned_nodes: FloatArray) -> FloatArray:
        """Prescribed displacements (3 n,) mm: the bones' motion, and its share at the region's edge near them."""
        out = -self.shift.copy()
        faces, edge_mm = self.problem.boundary.get("bone"), self.composition.edge_mm
        if faces is not None and self.composition.support:
            bone = np.unique(self.space.face_nodes(faces))
            out[bone] += self.composition.bone_motion(scanned_nodes[bone])
            outer = self.problem.boundary.get("outer")
            if edge_mm > 0.0 and outer is not None:
                edge = np.setdiff1d(self.space.face_nodes(outer), bone)
                apart = cKDTree(scanned_nodes[bone]).query(scanned_nodes[edge])[0]
                share = np.exp(-0.5 * (apart / edge_mm) ** 2)
                out[edge] += share[:, None] * self.composition.bone_motion(scanned_nodes[edge])
        for patch in self.composition.patches:
            moved = np.array(patch.displacement, dtype=np.float64)
            out[np.ix_(self._nodes_of(patch), patch.axes)] = moved[patch.axes]
        return out.ravel()

    def _nodes_of(self, patch: Patch) -> IntArray:
        return np.unique(self.space.face_nodes(patch.faces))

    def _assembler(self, free: BoolArray) -> Assembler:
        """Assembler of the composition; those with the same unknowns share matrix structure and solver."""
        key = self.composition.interface > 0.0
        if key not in self.geometry.assemblers:
            self.geometry.assemblers[key] = Assembler(self.space, free, self.terms)
        shared = self.geometry.assemblers[key]
        return shared if shared.space.mesh is self.space.mesh else on_other_shape(shared, self.space)


def plain_scene(
    problem: IdentificationProblem,
    element: str = "p2p1",
    split_mu: bool = False,
    walls: WallMotionOptions | None = None,
) -> CompositionScene:
    """Scene of the empty composition. split_mu : see `StiffnessParameters`. walls : see `SharedGeometry.of`."""
    return CompositionScene(SharedGeometry.of(problem, element, walls=walls, split_mu=split_mu), Composition(problem))
