"""A composition ready to be solved: the coupled scene with whatever the composition adds to it."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.elements import EDGES
from palpate.core.fem.materials import Material
from palpate.core.fem.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.sensitivity import Direction, direct
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import PointForce, nodal_force
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import SlidingWall, wall_points
from palpate.core.gap.composition import Composition
from palpate.core.gap.opened import OpenedProblem, open_problem, sliding_springs
from palpate.core.gap.wall_motion import WallMotion
from palpate.core.identify.coupled import WALL_STIFFNESS, CoupledScene
from palpate.core.identify.parameters import StiffnessParameters
from palpate.core.mesh import TetMesh
from palpate.core.observe.distance_field import SignedDistanceField
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.problem import IdentificationProblem

FloatArray = NDArray[np.float64]

# Stiffness across an opened interface over the tissue's shear modulus, 1/mm: the two sides stay within 0.03 mm.
ACROSS = 200.0
# Largest compliance that counts as tied, over that of `ACROSS`.
_STEP = 1e-4


@dataclass(eq=False)
class Stage:
    """What all compositions of one problem share: distance fields, walls' likeliest motions, and scenes' structures by need.

    element : see core.fem.elements.
    """

    problem: IdentificationProblem
    element: str
    observation: SurfaceObservation
    fields: dict[str, tuple[SignedDistanceField, SignedDistanceField]]
    motions: dict[str, WallMotion] = field(default_factory=dict)
    assemblers: dict[bool, Assembler] = field(default_factory=dict)
    _opened: OpenedProblem | None = None

    @classmethod
    def of(cls, problem: IdentificationProblem, element: str, like: Stage | None = None) -> Stage:
        """A stage with another element shares the distance fields of `like`."""
        space = Space.of(problem.mesh, element)
        if like is not None:
            return cls(problem, element, _moved(like.observation, space, problem), like.fields, like.motions)
        fields = {
            name: (
                SignedDistanceField.from_surface(pair.rest.points, pair.rest.faces),
                SignedDistanceField.from_surface(pair.deformed.points, pair.deformed.faces),
            )
            for name, pair in problem.walls.items()
            if name in problem.boundary and len(pair.rest.faces) and len(pair.deformed.faces)
        }
        stage = cls(problem, element, SurfaceObservation.of(problem, space), fields)
        for name in fields:
            wall = _wall(stage, problem, name, space, space.nodes)
            stage.motions[name] = WallMotion.of(wall, problem.facts.noise_sd_mm)
        return stage

    @property
    def opened(self) -> OpenedProblem:
        """The problem with the organ cut from its surroundings."""
        if self._opened is None:
            self._opened = open_problem(self.problem)
        return self._opened

    def scene(self, composition: Composition) -> GapScene:
        """The composition, ready to be solved."""
        return GapScene(self, composition)


class GapScene(CoupledScene):
    """`CoupledScene` of a composition. Nodal displacements are counted from the stress-free mesh; `seen` from the scanned one."""

    def __init__(self, stage: Stage, composition: Composition) -> None:
        self.stage, self.composition = stage, composition
        opened = stage.opened if composition.interface > 0.0 else None
        self.problem = stage.problem if opened is None else opened.problem
        self.parameters = StiffnessParameters(self.problem.regions, self.problem.facts)
        scanned = self.problem.mesh
        shift = np.zeros_like(scanned.points) if composition.geometry is None else composition.geometry
        shift = shift if opened is None else shift[opened.original]
        mesh = scanned if not shift.any() else TetMesh(scanned.points + shift, scanned.cells, scanned.regions)
        self.space = Space.of(mesh, stage.element)
        self.shift = _at_nodes(shift, self.space)
        scanned_nodes = self.space.nodes - self.shift
        self.walls = [_wall(stage, self.problem, name, self.space, scanned_nodes) for name in stage.fields]
        self.drags = self._drags(np.zeros_like(self.shift), 1.0)
        self.loads: tuple[Term, ...] = (dead_load(self.space, [make(self.space) for make in composition.load]),)
        if opened is not None:
            G = self.problem.facts.tissue_shear_modulus_kpa
            across = ACROSS * G
            along = 1.0 / (composition.interface + 1.0 / across)
            self.loads = (*self.loads, sliding_springs(self.space, opened.split, across, along))
        held = self.held_nodes()
        free = np.ones((self.space.n_nodes, 3), dtype=bool)
        free[held] = False
        self.prescribed = self._prescribed(scanned_nodes)
        self.observation = stage.observation if opened is None else _moved(stage.observation, self.space, self.problem)
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
        super().linearise(u, way)
        self.drags = self._drags(u, way)
        self.assembler.terms = self.terms

    @property
    def terms(self) -> tuple[Term, ...]:
        """All that acts on the body."""
        return (*self.walls, *self.drags, *self.loads)

    def _drags(self, u: FloatArray, way: float) -> list[Springs]:
        shear = self.problem.facts.tissue_shear_modulus_kpa
        motions = self.stage.motions.values()
        return [
            motion.drag(wall, wall.points.displacements(self.shift), u, way, shear)
            for wall, motion in zip(self.walls, motions, strict=True)
        ]

    def materials(self, theta: FloatArray) -> dict[int, Material]:
        """The composition's materials at ln G = theta (t,)."""
        composition = replace(self.composition, problem=self.problem)
        return composition.materials(self.parameters.materials(theta))

    def directions(self, theta: FloatArray) -> list[Direction]:
        """For each ln G, how the composition's material values change with it: central differences of smooth functions."""
        out: list[Direction] = []
        for k in range(len(theta)):
            h = np.zeros(len(theta))
            h[k] = _STEP
            high, low = self.materials(theta + h), self.materials(theta - h)
            out.append({r: (np.asarray(high[r].values) - np.asarray(low[r].values)) / (2.0 * _STEP) for r in high})
        return out

    def displacement_sensitivities(self, theta: FloatArray, found: Equilibrium) -> FloatArray:
        """See `CoupledScene.displacement_sensitivities`."""
        self.assembler.set_materials(self.materials(theta))
        return direct(self.assembler, State(found.u, found.p), self.directions(theta))

    def seen(self, u: FloatArray) -> FloatArray:
        """Nodal displacements (n, 3) mm from the scanned rest state, for u from the stress-free one."""
        return u + self.shift

    def _prescribed(self, scanned_nodes: FloatArray) -> FloatArray:
        """(3 n,) mm: bones move as the composition says, from where the scan at rest shows them."""
        out = -self.shift.copy()
        faces = self.problem.boundary.get("bone")
        if faces is not None and self.composition.support:
            bone = np.unique(self.space.face_nodes(faces))
            out[bone] += self.composition.bone_motion(scanned_nodes[bone])
        return out.ravel()

    def _assembler(self, free: NDArray[np.bool_]) -> Assembler:
        """All compositions with the same unknowns share one matrix structure and one solver, whatever their loads and rest shape."""
        key = self.composition.interface > 0.0
        if key not in self.stage.assemblers:
            self.stage.assemblers[key] = Assembler(self.space, free, self.terms)
        shared = self.stage.assemblers[key]
        return shared if shared.space.mesh is self.space.mesh else _on_other_shape(shared, self.space)


def _on_other_shape(assembler: Assembler, space: Space) -> Assembler:
    """The same structure and solver on a mesh of the same cells whose points lie elsewhere."""
    out = copy.copy(assembler)
    out.space = space
    out.total_volume = float(space.mesh.volumes.sum())
    out.weight = np.ascontiguousarray(space.mesh.volumes[:, None] * space.element.weights)
    return out


def dead_load(space: Space, loads: Sequence[Term]) -> PointForce:
    """All dead loads as forces on nodes; there even when it is zero, so that a load changes no matrix structure."""
    force = np.zeros((space.n_nodes, 3))
    for load in loads:
        np.add.at(force.reshape(-1), load.unknowns, -load.evaluate(np.zeros_like(force), 1.0, 1)[1])
    return nodal_force(np.arange(space.n_nodes), force)


def _wall(
    stage: Stage, problem: IdentificationProblem, name: str, space: Space, scanned_nodes: FloatArray
) -> SlidingWall:
    points = wall_points(space.face_nodes(problem.boundary[name]), scanned_nodes)
    at_rest, deformed = stage.fields[name]
    scanned = points.positions(scanned_nodes)
    stiffness = WALL_STIFFNESS * problem.facts.tissue_shear_modulus_kpa
    wall = SlidingWall.between(points, scanned, at_rest.value_and_gradient, deformed.value_and_gradient, stiffness)
    moved = replace(wall, rest=points.positions(space.nodes))
    return moved.linearised_at(np.zeros_like(scanned))


def _at_nodes(vertices: FloatArray, space: Space) -> FloatArray:
    """Nodal values (n, 3) of vertex values (v, 3)."""
    if space.element.degree == 1:
        return vertices.copy()
    out = np.empty((space.n_nodes, 3))
    out[: len(vertices)] = vertices
    out[space.cell_nodes[:, 4:]] = vertices[space.mesh.cells[:, EDGES]].mean(axis=2)
    return out


def _moved(observation: SurfaceObservation, space: Space, problem: IdentificationProblem) -> SurfaceObservation:
    """The same observation of another space."""
    marks = observation.landmarks
    operator: sp.csr_matrix = space.interpolation(observation.points, problem.regions)
    return replace(observation, operator=operator, landmark_operator=space.interpolation(marks[:, :3], problem.regions))
