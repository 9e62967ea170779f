"""Covariance of everything that is not an effect: contours of organ and walls, where walls slid, the mesh, landmarks.

Its sizes are those of `NoiseModelOptions`, calibrated on cases without a hidden effect only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.sensitivity import response_to_forces
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.observe.contour_noise import covariance_between, noise_modes, smooth_covariance
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.joint_states import apart, rows_of
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.noise_model_options import NoiseModelOptions

# Share of the variance of the walls' contour noise whose modes are carried through the model: a truncation.
_KEPT = 0.97


@dataclass(frozen=True)
class NoiseSizes:
    """Standard deviations, mm. along : factor on what is not known of the walls' motion along themselves (`WallMotion`).

    own : of every surface mode (extraction, voxels). landmark : per axis. contour : factor on the contour noise the case states.
    length : its correlation length. mesh : share of the difference between two elements that may be left in the better one.
    offset : of the whole contour, one scan's against the other's, beyond what its noise adds up to. model : of a smooth error of the
    model itself, over a gap of typical size (`ForceFields`).
    """

    along: float
    own: float
    landmark: float
    contour: float
    length: float
    mesh: float
    offset: float
    model: float

    @classmethod
    def of(cls, options: NoiseModelOptions) -> NoiseSizes:
        """Before the case's own are estimated."""
        return cls(
            along=options.along,
            own=options.own_mm,
            landmark=options.landmark_mm,
            contour=options.contour,
            length=options.length_mm,
            mesh=options.mesh,
            offset=options.offset_mm,
            model=options.model,
        )


@dataclass(frozen=True, eq=False)
class NoiseParts:
    """What the covariance (n, n) mm2 is put together from, of all deformed states.

    contour : of all contours as wide as the case states, one for each of `options.lengths_mm`; along : of walls' motion along themselves;
    own, marks : unit variances; floor : of bone registration; offset : 1 mm of the whole contour. The scan at rest was read once: half
    of what two readings add up to is the same in every state.
    """

    contour: tuple[FloatArray, ...]
    along: FloatArray
    own: FloatArray
    marks: FloatArray
    floor: FloatArray
    offset: FloatArray
    options: NoiseModelOptions

    @classmethod
    def of(
        cls, points: Sequence[Linearisation], sights: Sequence[DataVector], options: NoiseModelOptions
    ) -> NoiseParts:
        """At points, one for each state."""
        rows, sd = rows_of(sights), points[0].scene.problem.facts.noise_sd_mm
        length = options.wall_mode_length_mm
        read = [_read(p.scene, sight, p.equilibrium, length) for p, sight in zip(points, sights, strict=True)]
        return cls(
            tuple(_contours(read, rows, sd, length) for length in options.lengths_mm),
            apart([_along(point.scene, sight, point.equilibrium) for point, sight in zip(points, sights, strict=True)]),
            _read_twice([np.eye(s.n)[:, : s.n_modes] for s in sights]),
            _read_twice(_of_marks([p.scene.observation.landmarks[:, :3] for p in points], sights)),
            apart([_floor(s) for s in sights]),
            _read_twice([s.wider[:, None] for s in sights]),
            options,
        )

    def covariance(self, sizes: NoiseSizes, left: FloatArray) -> FloatArray:
        """(n, n); left : (n, m) columns whose outer products are what meshes and elements leave uncertain (`remeshing`).

        The nearest of `options.lengths_mm` is taken.
        """
        contour = self.contour[int(np.argmin(np.abs(np.array(self.options.lengths_mm) - sizes.length)))]
        out = sizes.contour**2 * contour + sizes.along**2 * self.along + sizes.own**2 * self.own
        out = out + sizes.landmark**2 * self.marks + sizes.offset**2 * self.offset
        return out + self.floor + left @ left.T


@dataclass(frozen=True, eq=False)
class _Contour:
    """One contour of a state: its points at rest (q, 3) and what each changes in the state's data (n, q) when it lies 1 mm too far out."""

    points: FloatArray
    response: FloatArray


def _read(scene: CompositionScene, sight: DataVector, found: Equilibrium, wall_length_mm: float) -> dict[str, _Contour]:
    """The contours of organ, walls and bones at an equilibrium."""
    organ = np.zeros((sight.n, len(sight.modes)))
    organ[: sight.n_modes] = sight.modes.T
    out = {"organ": _Contour(scene.observation.points, organ)}
    for name, wall in zip(scene.stage.fields, scene.walls, strict=True):
        modes = noise_modes(wall.rest, 1.0, wall_length_mm, _KEPT)
        modes = modes / np.linalg.norm(modes, axis=0)
        weight = (wall.stiffness * wall.points.measure)[:, None] * wall.normal
        forces = np.array([_on_nodes(scene, wall.points.nodes[:, 0], weight * m[:, None]) for m in modes.T])
        response = sight.response(scene, found.u, response_to_forces(found.tangent, forces))
        out[name] = _Contour(wall.rest, response @ modes.T)
    if sight.bone is not None:
        bone = np.zeros((sight.n, len(sight.bone.points)))
        bone[-6:] = sight.bone.reader
        out["bone"] = _Contour(sight.bone.points, bone)
    return out


def _contours(read: Sequence[Mapping[str, _Contour]], rows: Sequence[slice], sd: float, length: float) -> FloatArray:
    """(n, n) for all scans' contours of everything, correlated over `length` mm."""
    out = np.zeros((rows[-1].stop, rows[-1].stop))
    for s, ours in enumerate(read):
        for t, theirs in enumerate(read[: s + 1]):
            for name in ours.keys() & theirs.keys():
                a, b = ours[name], theirs[name]
                block = a.response @ covariance_between(a.points, b.points, sd, length) @ b.response.T
                out[rows[s], rows[t]] += 2.0 * block if s == t else block
            out[rows[t], rows[s]] = out[rows[s], rows[t]].T
    return out


def _read_twice(responses: Sequence[FloatArray]) -> FloatArray:
    """(n, n) of errors that two readings make, each half of their unit variances: at rest, the same in all states, and deformed.

    responses : of each state's data (n, m) to the same m errors.
    """
    common = np.vstack(responses)
    return np.asarray(0.5 * common @ common.T + 0.5 * apart([a @ a.T for a in responses]))


def _of_marks(at_rest: Sequence[FloatArray], sights: Sequence[DataVector]) -> list[FloatArray]:
    """For each state (n, 3 m): which of all m landmarks, told by where they are at rest (k, 3) mm, are which of its data."""
    _, number = np.unique(np.vstack(at_rest).round(6), axis=0, return_inverse=True)
    names, out, first = number.ravel(), [], 0
    for sight in sights:
        one = np.zeros((sight.n, 3 * (len(np.unique(names)))))
        for k, name in enumerate(names[first : first + sight.n_marks]):
            for axis in range(3):
                one[sight.marks.start + 3 * k + axis, 3 * name + axis] = 1.0
        first += sight.n_marks
        out.append(one)
    return out


def _floor(sight: DataVector) -> FloatArray:
    out = np.zeros((sight.n, sight.n))
    if sight.bone is not None:
        out[-6:, -6:] = sight.bone.floor
    return out


def organ_contours(sight: DataVector, points: FloatArray, sd_mm: float, length: float) -> FloatArray:
    """(k, k) mm2 of the surface's modes, for the organ's two contours at points (q, 3), correlated over `length` mm."""
    return np.asarray(2.0 * sight.modes.T @ smooth_covariance(points, sd_mm, length) @ sight.modes)


def _on_nodes(scene: CompositionScene, nodes: IntArray, force: FloatArray) -> FloatArray:
    full = np.zeros((scene.space.n_nodes, 3))
    np.add.at(full, nodes, force)
    return full


def _along(scene: CompositionScene, sight: DataVector, found: Equilibrium) -> FloatArray:
    """Covariance of the residual for what is not known of the walls' motion along themselves."""
    total = np.zeros((sight.n, sight.n))
    for wall, motion in zip(scene.walls, scene.stage.motions.values(), strict=True):
        unknown = motion.unknown_at(wall.rest - wall.points.displacements(scene.shift))
        R = slide_responses(scene, sight, found, wall, unknown)
        total += R @ R.T
    return total


def slide_responses(
    scene: CompositionScene, sight: DataVector, found: Equilibrium, wall: SlidingWall, moved: FloatArray
) -> FloatArray:
    """(n, r) change of the residual when a wall's points move by moved (r, w, 3) mm more, of which only what is along the wall counts.

    found : the equilibrium, solved with its stability check.
    """
    along = moved - np.einsum("rqi,qi->rq", moved, wall.normal)[..., None] * wall.normal
    drag = scene.stage.walls.drag_per_mm
    pulls = drag * scene.problem.facts.tissue_shear_modulus_kpa * wall.points.measure[:, None] * along
    forces = np.array([_on_nodes(scene, wall.points.nodes[:, 0], pull) for pull in pulls])
    return sight.response(scene, found.u, response_to_forces(found.tangent, forces))
