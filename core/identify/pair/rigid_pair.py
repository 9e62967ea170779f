"""Rigid motion of everything that two scans show.

Iterated closest points, point to plane (Chen and Medioni 1992), give the rigid motion of all surfaces together. The
residual distances are compared with those of two contours of an unchanged body. A pair that such a motion explains is laid
on itself before the fit, whose region's edge stands still; whether the pair tells a stiffness, the posterior says.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_noise import EXTRACTION_MM
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.statistics import rms
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.surface import Surface
from palpate.core.surfaces.triangle_tree import TriangleTree

# Largest ratio of residual to expected distance. A surface has some 30 independent points, so its rms has a standard
# deviation of 13 %; the tolerance is two of them.
TOLERANCE = 1.26
# Spacing of the points on each surface, mm.
_SPACING_MM = 4.0
_ROUNDS, _STILL = 60, 1e-5
# Largest motion reported as none, below the error of an alignment on bone.
_NO_ANGLE_DEG, _NO_SHIFT_MM = 0.3, 0.3


@dataclass(frozen=True, eq=False)
class RigidPair:
    """rotation (3, 3) and translation (3,) mm : x -> rotation x + translation. centre (3,) mm : of the organ at rest.

    left_mm : surface name -> rms distance that this motion leaves, mm; "landmarks" too where there are any.
    expected_mm : the same names -> what contours that err as the case says would leave of a body that did not change.
    """

    rotation: FloatArray
    translation: FloatArray
    centre: FloatArray
    left_mm: dict[str, float]
    expected_mm: dict[str, float]

    @property
    def nothing_deformed(self) -> bool:
        """Whether the residual distance of every surface is within TOLERANCE times that of an unchanged body."""
        return all(left <= TOLERANCE * self.expected_mm[name] for name, left in self.left_mm.items())

    @property
    def angle_deg(self) -> float:
        """Angle of the rotation, degrees."""
        return float(np.degrees(np.linalg.norm(Rotation.from_matrix(self.rotation).as_rotvec())))

    @property
    def shift_mm(self) -> float:
        """Displacement of the organ's centre, mm."""
        return float(np.linalg.norm(self.moved(self.centre) - self.centre))

    def moved(self, x: FloatArray) -> FloatArray:
        """Points (n, 3) or (3,) mm after the motion."""
        return np.asarray(x @ self.rotation.T + self.translation, dtype=np.float64)

    @property
    def in_words(self) -> str:
        """Sentence on the motion, for a pair whose surfaces tell no stiffness."""
        left = max(self.left_mm.values())
        noise = f"what is left of their surfaces ({left:.2f} mm rms at most) is within the contours' own error"
        if self.angle_deg < _NO_ANGLE_DEG and self.shift_mm < _NO_SHIFT_MM:
            return f"by its contours, the second scan shows the same as the first; {noise}"
        return (
            f"by its contours, the second scan may show the first one moved as a whole, by {self.shift_mm:.1f} mm and "
            f"{self.angle_deg:.1f} degrees; {noise}"
        )

    def undone(self, problem: IdentificationProblem) -> IdentificationProblem:
        """The problem with the motion taken off its deformed scan. Precondition: it has no matched motion."""

        def back(surface: Surface) -> Surface:
            return replace(surface, points=(surface.points - self.translation) @ self.rotation)

        def moved_back(pair: SurfacePair) -> SurfacePair:
            return replace(pair, deformed=back(pair.deformed))

        landmarks = problem.landmarks.copy()
        landmarks[:, 3:] = (landmarks[:, 3:] - self.translation) @ self.rotation
        walls = {name: moved_back(pair) for name, pair in problem.walls.items()}
        return replace(problem, walls=walls, organ=moved_back(problem.organ), landmarks=landmarks)


def rigid_pair(problem: IdentificationProblem) -> RigidPair:
    """Rigid motion of all surfaces of a problem together, with residual and expected distances."""
    parts = {name: _Part.of(pair) for name, pair in _pairs(problem)}
    rotation, shift, centre = _motion(list(parts.values()), problem.organ)
    motion = RigidPair(rotation, centre + shift - rotation @ centre, centre, {}, _expected(problem))
    residual_mm = {name: _rms(part.met(motion.moved(part.points))[1]) for name, part in parts.items()}
    if len(problem.landmarks):
        residual_mm["landmarks"] = _rms(motion.moved(problem.landmarks[:, :3]) - problem.landmarks[:, 3:])
    return RigidPair(motion.rotation, motion.translation, centre, residual_mm, motion.expected_mm)


def rigid_motion(pair: SurfacePair, start: FloatArray | None = None) -> FloatArray:
    """(4, 4) rigid motion from the rest surface of one pair onto its deformed one, mm.

    start : (3, 3) rotation to start from, identity by default.
    """
    rotation, shift, centre = _motion([_Part.of(pair)], pair, start)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, centre + shift - rotation @ centre
    return matrix


def _motion(
    parts: list[_Part], about: SurfacePair, start: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rotation, shift and the centre they are about (of `about` at rest) that take all parts together onto their targets."""
    centre = about.rest.points.mean(axis=0)
    rotation = np.eye(3) if start is None else start
    shift = about.deformed.points.mean(axis=0) - centre
    for _ in range(_ROUNDS):
        rows, values = [], []
        for part in parts:
            x = (part.points - centre) @ rotation.T + centre + shift
            x, distance, normal = part.met(x)
            rows.append(np.hstack([np.cross(x - centre - shift, normal), normal]))
            values.append(distance)
        # Truncated least squares: rotations that the surfaces do not determine (ball, plane) stay zero.
        step, *_ = np.linalg.lstsq(np.vstack(rows), -np.concatenate(values), rcond=1e-3)
        rotation = Rotation.from_rotvec(step[:3]).as_matrix() @ rotation
        shift = shift + step[3:]
        if np.abs(step * np.array([10.0, 10.0, 10.0, 1.0, 1.0, 1.0])).max() < _STILL:
            break
    return rotation, shift, centre


@dataclass(frozen=True, eq=False)
class _Part:
    points: FloatArray
    target: TriangleTree

    @classmethod
    def of(cls, pair: SurfacePair) -> _Part:
        return cls(
            sample_surface(pair.rest, _SPACING_MM)[0], TriangleTree.of(pair.deformed.points, pair.deformed.faces)
        )

    def met(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Those of x (n, 3) mm that have a partner, not beyond the end of an open surface: signed distance, unit normal."""
        near = closest_points(self.target, x)
        inside = ~self.target.rim[near.triangle, near.part]
        normal = self.target.normals[near.triangle, near.part][inside]
        return x[inside], near.signed[inside], normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]


def _pairs(problem: IdentificationProblem) -> Iterator[tuple[str, SurfacePair]]:
    yield "organ", problem.organ
    for name, pair in problem.walls.items():
        if len(pair.rest.faces) and len(pair.deformed.faces):
            yield name, pair


def _expected(problem: IdentificationProblem) -> dict[str, float]:
    sd = {name: pair.noise_sd_mm(problem.facts.noise_sd_mm) for name, pair in _pairs(problem)}
    contours = {name: float(np.hypot(np.sqrt(2.0) * each, EXTRACTION_MM)) for name, each in sd.items()}
    return {**contours, "landmarks": NoiseModelOptions().landmark_mm}


def _rms(values: FloatArray) -> float:
    return rms(values) if values.size else 0.0
