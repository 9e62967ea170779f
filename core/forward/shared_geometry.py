"""Geometry that all compositions of one problem share, so that another composition costs no more than its solve."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import PointSet
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.forward.cut_interface import CutProblem, cut_problem
from palpate.core.forward.known_geometry import KnownGeometry
from palpate.core.forward.scene_parts import DistanceFields, distance_fields, driving_walls, moved_observation
from palpate.core.observe.contour_errors import ContourErrors
from palpate.core.observe.surface_observation import SurfaceObservation, sample_surface
from palpate.core.observe.wall_motion import POINTS, WallMotion
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.core.surfaces.triangles import areas

# Cubes of a surface's own spacing that its area fills, over area / spacing^2.
_CUBES = 1.5


@dataclass(frozen=True, eq=False)
class WallsAt:
    """Walls and the drags along them where they were linearised last: at nodal displacements u (n, 3) mm, a share `way` of the
    distance left, with these motions."""

    u: FloatArray
    way: float
    motions: tuple[WallMotion, ...]
    walls: tuple[SlidingWall, ...]
    drags: tuple[Springs, ...]

    def fits(self, u: FloatArray, way: float, motions: tuple[WallMotion, ...]) -> bool:
        """Whether they are those of other arguments."""
        same = len(motions) == len(self.motions) and all(a is b for a, b in zip(motions, self.motions, strict=True))
        return same and way == self.way and np.array_equal(u, self.u)


@dataclass(eq=False)
class SharedGeometry:
    """Distance fields, posterior motions of the walls, and matrix structures (made when needed) of one problem.

    element : see core.fem.elements. walls : what is taken to be known of their motions. split_mu : see
    `StiffnessParameters`.
    """

    problem: IdentificationProblem
    element: str
    observation: SurfaceObservation
    fields: dict[str, DistanceFields]
    walls: WallMotionOptions
    motions: dict[str, WallMotion] = field(default_factory=dict)
    assemblers: dict[bool, Assembler] = field(default_factory=dict)
    split_mu: bool = False
    _cut: CutProblem | None = None
    # Not copied by `replace`: a geometry with other motions has finer ones of its own.
    _finer: dict[str, SharedGeometry] = field(default_factory=dict, init=False)
    # Of scenes on the scanned mesh, "at rest" and "last": most compositions differ in what does not touch the walls.
    walls_at: dict[str, WallsAt] = field(default_factory=dict, init=False)

    @classmethod
    def of(
        cls,
        problem: IdentificationProblem,
        element: str,
        like: SharedGeometry | None = None,
        walls: WallMotionOptions | None = None,
        split_mu: bool = False,
        known: KnownGeometry | None = None,
    ) -> SharedGeometry:
        """Geometry of a problem with an element; distance fields and walls' motions are those of `like` where given.

        walls : priors of the walls' motion; the program's own where None. known : of this problem, found before. walls,
        split_mu, known : not read with `like`.
        """
        space = Space.of(problem.mesh, element)
        if like is not None:
            observation = moved_observation(like.observation, space, problem)
            return cls(problem, element, observation, like.fields, like.walls, like.motions, split_mu=like.split_mu)
        walls = walls or WallMotionOptions()
        if problem.states_errors:
            walls = replace(walls, noise_length_mm=problem.facts.noise_correlation_mm)
        driving = driving_walls(problem)
        target, reader = (None, None) if known is None else (known.target, known.reader)
        fields = {name: distance_fields(driving[name]) if known is None else known.fields[name] for name in driving}
        observation = SurfaceObservation.of(problem, space, target=target, reader=reader)
        geometry = cls(problem, element, observation, fields, walls, split_mu=split_mu)
        for name in fields:
            visible, at_rest = (
                _seen(problem, name, fields[name], walls.seen_within_mm),
                fields[name][0].value_and_gradient,
            )
            # How the wall moved is not known yet: the nearest place of the deformed wall stands for its own.
            errors = ContourErrors.of(problem.walls[name], visible.rest, visible.rest, problem.facts.noise_sd_mm)
            motion = WallMotion.of(visible, at_rest, errors, walls)
            geometry.motions[name] = motion if known is None else replace(motion, slip=known.slips[name])
        return geometry

    def with_element(self, element: str) -> SharedGeometry:
        """The same problem and walls with another element; made once, so that its matrices are analysed once."""
        if element not in self._finer:
            self._finer[element] = SharedGeometry.of(self.problem, element, self)
        return self._finer[element]

    @property
    def known(self) -> KnownGeometry:
        """What `of` need not find again."""
        slips, seen = {n: m.slip for n, m in self.motions.items()}, self.observation
        return KnownGeometry(seen.target, self.fields, slips, seen.motion.reader)

    @cached_property
    def space(self) -> Space:
        """The element's space on the problem's own mesh."""
        return Space.of(self.problem.mesh, self.element)

    @property
    def cut(self) -> CutProblem:
        """The problem with the organ cut from its surroundings; made once."""
        if self._cut is None:
            self._cut = cut_problem(self.problem)
        return self._cut


def _seen(problem: IdentificationProblem, name: str, fields: DistanceFields, within_mm: float) -> SlidingWall:
    """A wall as the scans show it, where the mesh has it.

    Its points do not depend on the mesh, so that the motion learnt from them is the same on every mesh.
    """
    surface, faces = problem.walls[name].rest, problem.boundary[name]
    X = problem.mesh.points[faces]
    area = float(areas(X).sum())
    spacing = max(0.5 * float(np.round(2.0 * np.sqrt(_CUBES * area / POINTS))), 1.0)
    points = sample_surface(surface, spacing)[0]
    near = closest_points(TriangleTree.of(problem.mesh.points, faces), points).distance < within_mm
    points = points[near] if near.any() else X.mean(axis=1)
    one = PointSet(np.arange(len(points))[:, None], np.ones((len(points), 1)), np.ones(len(points)))
    return SlidingWall.between(one, points, fields[0].value_and_gradient, fields[1].value_and_gradient, 1.0)
