"""The `contact-force` boundary: the organ alone, loaded by the tissue's reaction (Eq 9 of Yang & Lin)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.contact_force import InterfaceMotion, organ_terms, tissue_reaction
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.parameters import TISSUE, StiffnessParameters
from palpate.core.forward.scene_parts import moved_observation, prolonged
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.forward.sliding_match import slide_onto
from palpate.core.laws import LINEAR, bulk_modulus
from palpate.core.observe.motion_observation import MotionObservation


class ContactForceScene(CompositionScene):
    """The plain model of one problem with the organ alone, loaded by contact forces.

    It has no walls: they act on the tissue. Raises ConvergenceError when the organ's surfaces cannot be matched or the
    tissue cannot follow.
    """

    def __init__(self, geometry: SharedGeometry, interface: FloatArray | None = None) -> None:
        """interface : (n, 3) mm, displacement of all vertices of the problem's mesh, read on the organ's surface; by
        default it comes from sliding the rest surface onto the deformed one at the least energy of a uniform organ."""
        problem = geometry.problem
        self.problem, self.composition = problem, Composition(problem)
        self.parameters = StiffnessParameters(problem.regions, problem.facts, geometry.split_mu)
        organ_mesh, vertices = problem.mesh.submesh(problem.regions)
        self.space = Space.of(organ_mesh, geometry.element)
        faces, _ = organ_mesh.region_boundary(problem.regions)
        if interface is None:
            u_s = slide_onto(self.space, faces, problem.organ, problem.facts.tissue_shear_modulus_kpa)
        else:
            u_s = prolonged(interface[vertices], self.space)
        nodes = np.unique(self.space.face_nodes(faces))
        motion = InterfaceMotion(nodes, u_s[nodes])
        force = self._reaction(geometry, motion)
        terms = organ_terms(self.space, motion, force, problem.facts.tissue_shear_modulus_kpa)
        self.assembler = Assembler(self.space, np.ones(self.space.n_displacements, dtype=bool), terms)
        seen = replace(geometry.observation, motion=MotionObservation.of(None, self.space))  # it lies in the tissue
        self.observation = moved_observation(seen, self.space, problem)
        self.geometry = replace(geometry, fields={}, motions={}, observation=self.observation)
        self.walls, self.drags, self.loads = [], [], ()
        self.shift = np.zeros((self.space.n_nodes, 3))
        self.linearised_at = u_s

    def solve(
        self, theta: FloatArray, start: State | FloatArray | None = None, options: NewtonOptions | None = None
    ) -> Equilibrium:
        """Equilibrium of the loaded organ at parameters theta; not converged, with its reason, where it is unstable."""
        materials = self.materials(theta)
        # Beyond buckling a dead load leads to another branch, far from the observed one: reported as a failure.
        options = replace(options or NewtonOptions(), follow_buckling=False)
        return solve_equilibrium(self.assembler, materials, start=start, options=options)

    def linearise(self, u: FloatArray, way: float = 1.0) -> None:
        """No effect but on `linearised_at`: there are no walls."""
        self.linearised_at = u

    def materials(self, theta: FloatArray) -> dict[int, Material]:
        """Those of the organ at theta (t,)."""
        return {r: m for r, m in self.parameters.materials(theta).items() if r != TISSUE}

    def _reaction(self, geometry: SharedGeometry, motion: InterfaceMotion) -> FloatArray:
        """Force on the organ's surface nodes from the tissue alone, with its walls where both scans show them."""
        coupled = CompositionScene(geometry, self.composition)
        mesh, _ = self.problem.mesh.submesh((TISSUE,))
        tissue = Space.of(mesh, geometry.element)
        shared = _same_points(tissue.nodes, self.space.nodes[motion.nodes])
        walls = [_moved_to(w, tissue, coupled.space) for w in coupled.walls]
        held = _same_points(tissue.nodes, coupled.space.nodes[coupled.held_nodes()], required=False)
        facts = self.problem.facts
        G = facts.tissue_shear_modulus_kpa
        material = {TISSUE: Material(LINEAR, np.array([G, bulk_modulus(G, facts.tissue_poisson_ratio)]))}
        return tissue_reaction(tissue, material, InterfaceMotion(shared, motion.u), held, walls)


def _same_points(nodes: FloatArray, wanted: FloatArray, required: bool = True) -> IntArray:
    """Indices in `nodes` of the wanted points; missing ones are left out.

    Raises ConvergenceError when they are required.
    """
    distance, index = cKDTree(nodes).query(wanted)
    same = distance < 1e-6
    if required and not same.all():
        raise ConvergenceError("organ and tissue do not share the nodes of the organ's surface; mesh again")
    return np.asarray(index[same], dtype=np.int64)


def _moved_to(wall: SlidingWall, tissue: Space, whole: Space) -> SlidingWall:
    """The same wall with the tissue's own node numbers."""
    nodes = _same_points(tissue.nodes, whole.nodes[wall.points.nodes[:, 0]])
    return replace(wall, points=replace(wall.points, nodes=nodes[:, None]))
