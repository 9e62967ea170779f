"""Covariance of everything that is not an effect: contours of organ and walls, where walls slid, the mesh, landmarks.

Calibrated on cases without a hidden effect only: `mesh`, `offset`, `model` and the walls' slides (`WallMotion`) are those under which the
residuals of such cases of two simulators are likeliest together (restricted likelihood; `tests/benchmarks/gap_noise.py`): `mesh` and
`offset` of 31 with 0.35 mm of contour noise, `model` and the slides of 16 with 0.12 to 0.4 mm. `along` is of no residuals: in nine
effect-free cases the walls' true motions moved the organ by so much more than `WallMotion` said (mean squares 2.2 times those said for the
rectum, 1.6 for the bladder; `tests/benchmarks/slides.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.sensitivity import response_to_forces
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.gap.scene import GapScene
from palpate.core.gap.sight import Sight
from palpate.core.gap.wall_motion import DRAG
from palpate.core.observe.noise import noise_modes, smooth_covariance

FloatArray = NDArray[np.float64]

# Correlation lengths of contour noise that are told apart, mm.
LENGTHS_MM = (4.0, 5.0, 6.0, 7.0, 8.0, 9.0)


@dataclass(frozen=True)
class NoiseSizes:
    """Standard deviations, mm. along : factor on what is not known of the walls' motion along themselves (`WallMotion`).

    own : of every surface mode (extraction, voxels). landmark : per axis. contour : factor on the contour noise the case states.
    length : its correlation length. mesh : share of the difference between two elements that may be left in the better one.
    offset : of the whole contour, one scan's against the other's, beyond what its noise adds up to. model : of a smooth error of the
    model itself, over a gap of typical size (`ForceFields`).
    """

    along: float = 1.4
    own: float = 0.2
    landmark: float = 0.45
    contour: float = 1.0
    length: float = 7.0
    mesh: float = 0.45
    offset: float = 0.1
    model: float = 0.25


@dataclass(frozen=True, eq=False)
class NoiseParts:
    """What the covariance (n, n) mm2 is put together from.

    contour : of all contours as wide as the case states, one for each of LENGTHS_MM; along : of walls' motion along themselves;
    own, marks : unit variances; floor : of bone registration; offset : 1 mm of the whole contour.
    """

    contour: tuple[FloatArray, ...]
    along: FloatArray
    own: FloatArray
    marks: FloatArray
    floor: FloatArray
    offset: FloatArray

    @classmethod
    def of(cls, scene: GapScene, sight: Sight, u: FloatArray) -> NoiseParts:
        """At the equilibrium u, whose tangent must be factorised."""
        n, k = sight.n, sight.n_modes
        own, marks, floor = (np.zeros((n, n)) for _ in range(3))
        own[np.arange(k), np.arange(k)] = 1.0
        at = np.arange(sight.marks.start, sight.marks.stop)
        marks[at, at] = 1.0
        if sight.bone is not None:
            floor[-6:, -6:] = sight.bone.covariance(0.0, 1.0)
        walls = _WallNoise.of(scene, sight, u)
        contour = tuple(_contour(scene, sight, walls, length) for length in LENGTHS_MM)
        return cls(contour, _along(scene, sight, u), own, marks, floor, np.outer(sight.wider, sight.wider))

    def covariance(self, sizes: NoiseSizes, left: FloatArray) -> FloatArray:
        """(n, n); left : (n, m) columns whose outer products are what meshes and elements leave uncertain (`remeshed`).

        The nearest of LENGTHS_MM is taken.
        """
        contour = self.contour[int(np.argmin(np.abs(np.array(LENGTHS_MM) - sizes.length)))]
        out = sizes.contour**2 * contour + sizes.along**2 * self.along + sizes.own**2 * self.own
        out = out + sizes.landmark**2 * self.marks + sizes.offset**2 * self.offset
        return out + self.floor + left @ left.T


@dataclass(frozen=True, eq=False)
class _WallNoise:
    """Per wall: points (w, 3), orthonormal modes (w, m) and what each moves (n, m) when the wall is read 1 mm too far out."""

    walls: list[tuple[FloatArray, FloatArray, FloatArray]]

    @classmethod
    def of(cls, scene: GapScene, sight: Sight, u: FloatArray) -> _WallNoise:
        out = []
        for wall in scene.walls:
            modes = noise_modes(wall.rest, 1.0, LENGTHS_MM[1], 0.97)
            modes = modes / np.linalg.norm(modes, axis=0)
            weight = (wall.stiffness * wall.points.measure)[:, None] * wall.normal
            forces = np.array([_on_nodes(scene, wall.points.nodes[:, 0], weight * m[:, None]) for m in modes.T])
            response = sight.response(scene, u, response_to_forces(scene.assembler, forces))
            out.append((wall.rest, modes, response))
        return cls(out)


def _contour(scene: GapScene, sight: Sight, walls: _WallNoise, length: float) -> FloatArray:
    """(n, n) for both scans' contours of everything, correlated over `length` mm."""
    sd = scene.problem.facts.noise_sd_mm
    n, k = sight.n, sight.n_modes
    out = np.zeros((n, n))
    out[:k, :k] = organ_contours(sight, scene.observation.points, sd, length)
    for rest, modes, response in walls.walls:
        out += 2.0 * response @ (modes.T @ smooth_covariance(rest, sd, length) @ modes) @ response.T
    if sight.bone is not None:
        out[-6:, -6:] += sight.bone.covariance(sd, length) - sight.bone.covariance(0.0, length)
    return out


def organ_contours(sight: Sight, points: FloatArray, sd_mm: float, length: float) -> FloatArray:
    """(k, k) mm2 of the surface's modes, for the organ's two contours at points (q, 3), correlated over `length` mm."""
    return np.asarray(2.0 * sight.modes.T @ smooth_covariance(points, sd_mm, length) @ sight.modes)


def _on_nodes(scene: GapScene, nodes: NDArray[np.int64], force: FloatArray) -> FloatArray:
    full = np.zeros((scene.space.n_nodes, 3))
    np.add.at(full, nodes, force)
    return full


def _along(scene: GapScene, sight: Sight, u: FloatArray) -> FloatArray:
    """Covariance of the residual for what is not known of the walls' motion along themselves."""
    total = np.zeros((sight.n, sight.n))
    for wall, motion in zip(scene.walls, scene.stage.motions.values(), strict=True):
        unknown = motion.unknown_at(wall.rest - wall.points.displacements(scene.shift))
        R = slide_responses(scene, sight, u, wall, unknown)
        total += R @ R.T
    return total


def slide_responses(scene: GapScene, sight: Sight, u: FloatArray, wall: SlidingWall, moved: FloatArray) -> FloatArray:
    """(n, r) change of the residual when a wall's points move by moved (r, w, 3) mm more, of which only what is along the wall counts.

    u : the equilibrium, whose tangent must be factorised.
    """
    along = moved - np.einsum("rqi,qi->rq", moved, wall.normal)[..., None] * wall.normal
    pulls = DRAG * scene.problem.facts.tissue_shear_modulus_kpa * wall.points.measure[:, None] * along
    forces = np.array([_on_nodes(scene, wall.points.nodes[:, 0], pull) for pull in pulls])
    return sight.response(scene, u, response_to_forces(scene.assembler, forces))
