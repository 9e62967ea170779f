"""Covariance of all that is not an effect: contours of organ, walls and bones, the walls' sliding, the mesh, landmarks.

The sizes are those of `NoiseModelOptions`, calibrated on cases without a hidden effect only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.sensitivity import response_to_forces
from palpate.core.fem.tangent import Tangent
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.observe.contour_errors import ContourErrors
from palpate.core.observe.contour_noise import covariance_between
from palpate.core.observe.voxel_noise import VoxelNoise, voxel_covariance
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.image_errors import ImageErrors, ImageErrorSizes
from palpate.core.residual.joint_states import apart, rows_of
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.variance_model import NoisePart, VarianceModel


@dataclass(frozen=True)
class NoiseSizes:
    """Sizes of the noise's parts: standard deviations in mm, or factors.

    per_mode : of every surface mode (extraction, voxels), mm. landmark : per axis, mm. contour : factor on the contour noise that the
    case states. shares : of its variance, of each correlation length of `NoiseModelOptions.lengths_mm`. mesh : share of the difference
    between two elements that the better one may still err by. offset : of the whole contour of one scan against the other's, beyond what
    its noise adds up to, mm. model : of a smooth error of the model itself, over a discrepancy of typical size (`ForceFields`). image :
    of what the model errs by where images show the motion.
    """

    per_mode: float
    landmark: float
    contour: float
    shares: tuple[float, ...]
    mesh: float
    offset: float
    model: float
    image: ImageErrorSizes

    @classmethod
    def of(cls, options: NoiseModelOptions) -> NoiseSizes:
        """The likeliest sizes before the data speak."""
        lengths = len(options.lengths_mm)
        return cls(
            per_mode=options.own_mm,
            landmark=options.landmark_mm,
            contour=1.0,
            shares=(1.0 / lengths,) * lengths,
            mesh=options.mesh,
            offset=options.offset_mm,
            model=options.model,
            image=ImageErrorSizes.of(options),
        )

    @property
    def varying(self) -> FloatArray:
        """Coefficients of `NoiseParts.varying`, mm2 or squared factors."""
        of_contour = self.contour**2 * np.array(self.shares)
        return np.concatenate([of_contour, [self.per_mode**2], self.image.variances])

    def with_varying(self, coefficients: FloatArray) -> NoiseSizes:
        """The same with other coefficients; `varying` is the inverse."""
        k = len(self.shares)
        contour = float(coefficients[:k].sum())
        return replace(
            self,
            contour=float(np.sqrt(contour)),
            shares=tuple((coefficients[:k] / max(contour, 1e-300)).tolist()),
            per_mode=float(np.sqrt(coefficients[k])),
            image=self.image.with_variances(coefficients[k + 1 :]),
        )


@dataclass(frozen=True, eq=False)
class NoiseParts:
    """Parts of the covariance (n, n) mm2 of the data of all deformed states.

    contour : of contours as wide as the case states, one for each of `options.lengths_mm`. sliding : of the walls' motion
    along themselves. per_mode, marks : of unit variances. floor : of bone
    registration, of the motion that the images tell, and of the voxels that organ and walls were drawn in. offset : of 1 mm of
    the whole contour. image : see `ImageErrors`. The scan at rest was read once: half of the variance of two readings is
    common to all states.
    """

    contour: tuple[FloatArray, ...]
    sliding: FloatArray
    per_mode: FloatArray
    marks: FloatArray
    floor: FloatArray
    offset: FloatArray
    image: ImageErrors
    options: NoiseModelOptions

    @classmethod
    def of(
        cls,
        linearisations: Sequence[Linearisation],
        data_vectors: Sequence[DataVector],
        options: NoiseModelOptions,
        responses: Sequence[ContourResponses] | None = None,
        shapes: Sequence[FloatArray] | None = None,
    ) -> NoiseParts:
        """Parts at a model's linearisations, one for each state. responses : of each state's data to its contours, those of
        the linearisations where None. shapes : of each state's data to the organ's shape (`organ_shape`); where None, the
        shape is taken to be known."""
        rows = rows_of(data_vectors)
        each = list(zip(linearisations, data_vectors, strict=True))
        if responses is None:
            responses = [ContourResponses.of(p.scene, data, p.equilibrium.u, p.tangent) for p, data in each]
        contours = [r.contours for r in responses]
        if shapes is not None:
            shaped = zip(contours, shapes, strict=True)
            contours = [{**one, "organ": replace(one["organ"], shape=shape)} for one, shape in shaped]
        return cls(
            tuple(_contours(contours, rows, length) for length in options.lengths_mm),
            apart([r.sliding for r in responses]),
            _read_twice(_of_modes(data_vectors)),
            _read_twice(_of_marks([p.scene.observation.landmarks[:, :3] for p in linearisations], data_vectors)),
            apart([_floor(s) for s in data_vectors]) + _voxels(contours, rows, options.voxel_length_mm),
            _read_twice([s.dilation[:, None] for s in data_vectors]),
            ImageErrors.of(linearisations, data_vectors, options),
            options,
        )

    @cached_property
    def varying(self) -> FloatArray:
        """Covariances (b, n, n) of unit size of what a case's own data choose the size of: contours, one for each length; surface modes;
        motion of the region's edge; local errors, one for each length."""
        return np.stack([*self.contour, self.per_mode, self.image.edge, *self.image.local])

    def known(self, sizes: NoiseSizes, discretisation: FloatArray) -> FloatArray:
        """Covariance (n, n) mm2 of everything else.

        discretisation : (n, m) mm, columns whose outer products sum to the covariance of the discretisation error
        (`remeshing`).
        """
        out = self.sliding + sizes.landmark**2 * self.marks + sizes.offset**2 * self.offset
        return np.asarray(out + self.floor + self.image.alignment + discretisation @ discretisation.T)

    def covariance(self, sizes: NoiseSizes, discretisation: FloatArray) -> FloatArray:
        """Covariance (n, n) mm2 of the data for given sizes. discretisation : see `known`."""
        return np.asarray(self.known(sizes, discretisation) + np.tensordot(sizes.varying, self.varying, 1))

    def variance_model(self, sizes: NoiseSizes, discretisation: FloatArray) -> VarianceModel:
        """The parts whose sizes are unknown, with their priors. discretisation : see `known`."""
        o = self.options
        parts = [
            NoisePart(len(self.contour), 1.0, o.contour_prior),
            NoisePart(1, o.own_mm, o.contour_prior),
            NoisePart(1, o.edge_mm, o.size_spread),
            NoisePart(len(self.image.local), o.local_mm, o.size_spread),
        ]
        return VarianceModel(parts, self.varying, self.known(sizes, discretisation), o.length_spread)


@dataclass(frozen=True, eq=False)
class _Contour:
    """One contour of a state: its errors, and the change of the state's data (n, q) per mm outwards at each of their
    points at rest. voxels : errors of voxels there, None where they do not count. shape (n, q) : what 1 mm at rest changes
    beside that, through the model's geometry; None where it changes nothing.

    An error e at rest and f in the deformed scan change the data by (response + shape) e - response f.
    """

    errors: ContourErrors
    response: FloatArray
    voxels: VoxelNoise | None = None
    shape: FloatArray | None = None

    @property
    def at_rest(self) -> FloatArray:
        """Change (n, q) of the data per mm outwards of the contour at rest."""
        return self.response if self.shape is None else self.response + self.shape

    def covariance(self, other: _Contour, length_mm: float, same_state: bool) -> FloatArray:
        """Covariance (n, m) mm2 of the data of two states for the errors of their contours, which have the scan at rest in
        common. same_state : whether they are one state. length_mm : correlation length of the errors."""
        a, b = self.errors, other.errors
        kernel = covariance_between(a.points, b.points, 1.0, length_mm)
        out = (self.at_rest * a.rest) @ kernel @ (other.at_rest * b.rest).T
        if a.common.any() and b.common.any():
            out = out + self._of_common() @ kernel @ other._of_common().T
        if same_state:
            out = out + (self.response * a.deformed) @ kernel @ (other.response * b.deformed).T
        return np.asarray(out)

    def _of_common(self) -> FloatArray:
        """Change (n, q) of the data per unit of what both scans' errors have in common."""
        at_rest, later = self.errors.common
        return self.at_rest * at_rest - self.response * later


@dataclass(frozen=True, eq=False)
class ContourResponses:
    """What errors of one state's contours do to its data, with the element of a scene.

    contours : of organ, walls and bones. sliding (n, n) mm2 : covariance for the walls' motion along themselves. Where the
    tissue beside a wall is thin, linear elements pass on half as much of a wall's errors as quadratic ones.
    """

    contours: Mapping[str, _Contour]
    sliding: FloatArray

    @classmethod
    def of(cls, scene: CompositionScene, data: DataVector, u: FloatArray, tangent: Tangent) -> ContourResponses:
        """At nodal displacements u (nodes, 3) mm, where the tangent is taken; one back-substitution for each datum."""
        per_force = response_to_forces(tangent, data.loads(scene, u))
        return cls(_contours_of(scene, data, per_force, u), _along(scene, data, per_force))


def _contours_of(
    scene: CompositionScene, data: DataVector, per_force: FloatArray, u: FloatArray
) -> dict[str, _Contour]:
    """Contours of organ, walls and bones, and their responses. per_force (n, nodes, 3) : see `data_per_force`."""
    problem = scene.problem
    sd = problem.facts.noise_sd_mm
    out = {"organ": _organ_contour(scene, data, u)}
    for name, wall in zip(scene.geometry.fields, scene.walls, strict=True):
        force = (wall.stiffness * wall.points.measure)[:, None] * wall.normal
        moved = wall.rest + wall.points.displacements(u)
        errors = ContourErrors.of(problem.walls[name], wall.rest, moved, sd)
        response = np.einsum("nqi,qi->nq", per_force[:, wall.points.nodes[:, 0]], force)
        out[name] = _Contour(errors, response, VoxelNoise.of(problem.walls[name], wall.rest, moved))
    if data.bone is not None:
        bone = np.zeros((data.n, len(data.bone.points)))
        bone[-6:] = data.bone.reader
        out["bone"] = _Contour(ContourErrors.even(data.bone.points, sd), bone)
    return out


def _organ_contour(scene: CompositionScene, data: DataVector, u: FloatArray) -> _Contour:
    response = np.zeros((data.n, len(data.modes)))
    response[: data.n_modes] = data.modes.T
    points = scene.observation.points
    seen = VoxelNoise.of(scene.problem.organ, points, points + scene.observation.operator @ scene.seen(u))
    return _Contour(organ_errors(scene, u), response, seen)


def organ_errors(scene: CompositionScene, u: FloatArray) -> ContourErrors:
    """Errors of the organ's two contours at its observed points, for nodal displacements u (nodes, 3) mm."""
    points, problem = scene.observation.points, scene.problem
    moved = points + scene.observation.operator @ scene.seen(u)
    return ContourErrors.of(problem.organ, points, moved, problem.facts.noise_sd_mm)


def data_per_force(scene: CompositionScene, data: DataVector, equilibrium: Equilibrium) -> FloatArray:
    """Change (n, nodes, 3) of the data per unit force (mN) at every node: one back-substitution for each datum."""
    return response_to_forces(equilibrium.tangent, data.loads(scene, equilibrium.u))


def _contours(read: Sequence[Mapping[str, _Contour]], rows: Sequence[slice], length: float) -> FloatArray:
    """Covariance (n, n) mm2 of all scans' contours, with a given correlation length, mm."""
    out = np.zeros((rows[-1].stop, rows[-1].stop))
    for s, ours in enumerate(read):
        for t, theirs in enumerate(read[: s + 1]):
            for name in (name for name in ours if name in theirs):  # a set would change the order of sums
                out[rows[s], rows[t]] += ours[name].covariance(theirs[name], length, s == t)
            out[rows[t], rows[s]] = out[rows[s], rows[t]].T
    return out


def _read_twice(responses: Sequence[FloatArray]) -> FloatArray:
    """Covariance (n, n) of errors of two readings with half a unit of variance each: at rest, common to all states, and
    deformed.

    responses : of each state's data (n, m) to the same m errors.
    """
    common = np.vstack(responses)
    return np.asarray(0.5 * common @ common.T + 0.5 * apart([a @ a.T for a in responses]))


def _of_modes(data_vectors: Sequence[DataVector]) -> list[FloatArray]:
    """Responses (n, m) of each state's data to errors of the surface modes, of which a state without a drawn organ has none."""
    most = max(data.n_modes for data in data_vectors)
    return [np.eye(data.n, most) * (np.arange(data.n) < data.n_modes)[:, None] for data in data_vectors]


def _of_marks(at_rest: Sequence[FloatArray], data_vectors: Sequence[DataVector]) -> list[FloatArray]:
    """Responses (n, 3 m) of each state's data to errors of all m landmarks; a landmark is known by its place at rest
    (k, 3) mm."""
    _, number = np.unique(np.vstack(at_rest).round(6), axis=0, return_inverse=True)
    names, out, first = number.ravel(), [], 0
    for data in data_vectors:
        one = np.zeros((data.n, 3 * (len(np.unique(names)))))
        for k, name in enumerate(names[first : first + data.n_marks]):
            for axis in range(3):
                one[data.marks.start + 3 * k + axis, 3 * name + axis] = 1.0
        first += data.n_marks
        out.append(one)
    return out


def _floor(data: DataVector) -> FloatArray:
    out = np.zeros((data.n, data.n))
    out[data.motion, data.motion] = data.motion_covariance
    if data.bone is not None:
        out[-6:, -6:] = data.bone.floor
    return out


def _voxels(read: Sequence[Mapping[str, _Contour]], rows: Sequence[slice], length_mm: float) -> FloatArray:
    """Covariance (n, n) mm2 for the voxels of the labels of organ and walls, where surfaces carry draws of their errors."""
    n = rows[-1].stop
    out = np.zeros((n, n))
    for name in dict.fromkeys(name for one in read for name in one):  # a set would change the order of sums
        each = [(one[name], row) for one, row in zip(read, rows, strict=True) if name in one]
        seen = [(c.voxels, (c.at_rest, c.response), row) for c, row in each if c.voxels is not None]
        if seen:
            noise, responses, its_rows = zip(*seen, strict=True)
            out += voxel_covariance(noise, responses, its_rows, n, length_mm)
    return out


def organ_noise(
    linearisations: Sequence[Linearisation],
    data_vectors: Sequence[DataVector],
    options: NoiseModelOptions,
    shapes: Sequence[FloatArray] = (),
) -> Callable[[NoiseSizes], FloatArray]:
    """What the organ's own contours alone add to the covariance (n, n) mm2 of all states' data, for given sizes: drawing,
    voxels, extraction. shapes : as of `NoiseParts.of`; none where the shape is taken to be known."""
    rows = rows_of(data_vectors)
    pairs = zip(linearisations, data_vectors, strict=True)
    read = [{"organ": _organ_contour(at.scene, data, at.equilibrium.u)} for at, data in pairs]
    if shapes:
        read = [{"organ": replace(one["organ"], shape=shape)} for one, shape in zip(read, shapes, strict=True)]
    of_length = np.stack([_contours(read, rows, length) for length in options.lengths_mm])
    voxels, per_mode = _voxels(read, rows, options.voxel_length_mm), _read_twice(_of_modes(data_vectors))

    def covariance(sizes: NoiseSizes) -> FloatArray:
        contour = np.tensordot(sizes.contour**2 * np.array(sizes.shares), of_length, 1)
        return np.asarray(contour + sizes.per_mode**2 * per_mode + voxels)

    return covariance


def _along(scene: CompositionScene, data: DataVector, per_force: FloatArray) -> FloatArray:
    """Covariance of the residual for the uncertainty of the walls' motion along themselves."""
    total = np.zeros((data.n, data.n))
    for wall, motion in zip(scene.walls, scene.geometry.motions.values(), strict=True):
        unknown = motion.unknown_at(wall.rest - wall.points.displacements(scene.shift))
        R = slide_responses(scene, per_force, wall, unknown)
        total += R @ R.T
    return total


def slide_responses(scene: CompositionScene, per_force: FloatArray, wall: SlidingWall, moved: FloatArray) -> FloatArray:
    """Change (n, r) of the residual when a wall's points move by `moved` (r, w, 3) mm; only the tangential part counts.

    per_force (n, nodes, 3) : see `data_per_force`.
    """
    along = moved - np.einsum("rqi,qi->rq", moved, wall.normal)[..., None] * wall.normal
    pull = scene.geometry.walls.drag_per_mm * scene.problem.facts.tissue_shear_modulus_kpa * wall.points.measure
    return np.einsum("nqi,rqi->nr", per_force[:, wall.points.nodes[:, 0]] * pull[:, None], along, optimize=True)
