"""Errors of the model that the motion in the images shows, and contours hardly.

A matched point is known to a tenth of a millimetre. No model of a pelvis is: the region's edge, which it holds, moves in
truth; the scans are aligned to some tenths; elements, walls and tissue err from place to place. Each is an unknown with
a normal prior that is marginalised, as the walls' motion is: its response is part of the covariance of all data, of
contours and images alike, so that what the images say of an error counts for the contours too.

- edge : smooth motion of the region's edge where it is not bone, carried to the data by the model.
- alignment : rigid motion of all that the model holds, seen by the bones' registration as well.
- local : a smooth displacement that the model cannot predict (a Gaussian process).

The sizes of the first and the last are those that the case's own data make likely (`noise_estimation`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.fem.state import State
from palpate.core.observe.contour_noise import noise_modes
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.joint_states import apart
from palpate.core.residual.linearised_model import Linearisation, out_of_balance
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.surfaces.rigid_motion import rigid_motion

# Share of the variance of the edge's motion whose modes are taken: a truncation. Step of the differences of forces, mm.
_KEPT, _STEP_MM = 0.9, 1e-3


@dataclass(frozen=True)
class ImageErrorSizes:
    """edge : standard deviation per axis, mm. local : the same of the local error, for each of `NoiseModelOptions.local_lengths_mm`."""

    edge: float
    local: tuple[float, ...]

    @classmethod
    def of(cls, options: NoiseModelOptions) -> ImageErrorSizes:
        """The likeliest sizes before the data speak."""
        lengths = len(options.local_lengths_mm)
        return cls(options.edge_mm, (float(options.local_mm / np.sqrt(lengths)),) * lengths)

    @property
    def variances(self) -> FloatArray:
        """Of edge and local errors (1 + lengths,) mm2."""
        return np.square([self.edge, *self.local])

    def with_variances(self, variances: FloatArray) -> ImageErrorSizes:
        """Sizes of these variances; `variances` is the inverse."""
        edge, *local = np.sqrt(variances).tolist()
        return ImageErrorSizes(edge, tuple(local))


@dataclass(frozen=True, eq=False)
class ImageErrors:
    """Parts (n, n) of the covariance of all states' data: edge and local (one for each of `options.local_lengths_mm`) of
    unit standard deviation, mm2 per mm2; alignment mm2. All 0 for a state without matched motion."""

    edge: FloatArray
    alignment: FloatArray
    local: tuple[FloatArray, ...]

    @classmethod
    def of(
        cls, linearisations: Sequence[Linearisation], data_vectors: Sequence[DataVector], options: NoiseModelOptions
    ) -> ImageErrors:
        """Parts at a model's linearisations, one for each state."""
        each = list(zip(linearisations, data_vectors, strict=True))
        return cls(
            apart([_squared(_edge(at, data, options), data) for at, data in each]),
            apart([_squared(_alignment(at, data), data) for at, data in each]),
            tuple(apart([_local(at, data, length) for at, data in each]) for length in options.local_lengths_mm),
        )


def _edge(at: Linearisation, data: DataVector, options: NoiseModelOptions) -> FloatArray:
    """Response (n, m) of a state's data to smooth motions of the region's edge of 1 mm an axis."""
    problem = at.scene.problem
    faces = problem.boundary.get("outer")
    if not data.n_motion or faces is None or not problem.facts.outer_fixed:
        return np.zeros((data.n, 0))
    nodes = np.unique(at.scene.space.face_nodes(faces))
    if "bone" in problem.boundary:
        nodes = np.setdiff1d(nodes, at.scene.space.face_nodes(problem.boundary["bone"]))
    modes = noise_modes(at.scene.space.nodes[nodes], 1.0, options.edge_length_mm, _KEPT)
    moved = np.zeros((3 * modes.shape[1], at.scene.space.n_nodes, 3))
    for k, (mode, axis) in enumerate(product(modes.T, range(3))):
        moved[k, nodes, axis] = mode
    return data.response(at.scene, at.equilibrium.u, response_to_held(at, moved))


def _alignment(at: Linearisation, data: DataVector) -> FloatArray:
    """Response (n, 6) of a state's data to a rigid motion of what is held, of the size that a registration of bones
    leaves."""
    if not data.n_motion or data.bone is None:
        return np.zeros((data.n, 0))
    pivot, nodes = at.scene.problem.organ.rest.points.mean(axis=0), at.scene.space.nodes
    held = np.zeros((6, *nodes.shape))
    sizes = np.diag(data.bone.floor_sd)
    held[:, at.scene.held_nodes()] = [rigid_motion(nodes[at.scene.held_nodes()], pivot, size) for size in sizes]
    out = data.response(at.scene, at.equilibrium.u, response_to_held(at, held))
    out[-6:] = sizes
    return out


def _local(at: Linearisation, data: DataVector, length: float) -> FloatArray:
    """Covariance (n, n) of a state's data for a displacement of 1 mm an axis that the model lacks."""
    if not data.n_motion:
        return np.zeros((data.n, data.n))
    points, rows = at.scene.observation.every_place, data.per_place(at.scene, at.equilibrium.u)
    motion = np.zeros(data.n, dtype=bool)
    motion[data.motion] = True
    # A row of matched motion looks at its own places only, the last ones, and no other row looks there.
    first = len(points) - len(at.scene.observation.motion.rows.places)
    groups = [(~motion, slice(0, first)), (motion, slice(first, None))]
    out = np.zeros((data.n, data.n))
    for k, (theirs, there) in enumerate(groups):
        for ours, here in groups[: k + 1]:
            near = np.exp(-0.5 * (cdist(points[here], points[there]) / length) ** 2)
            block = sum(rows[ours, here, a] @ near @ rows[theirs, there, a].T for a in range(3))
            out[np.ix_(ours, theirs)], out[np.ix_(theirs, ours)] = block, block.T
    return out


def response_to_held(at: Linearisation, motions: FloatArray) -> FloatArray:
    """Change (r, nodes, 3) mm of the equilibrium when held nodes move by motions (r, nodes, 3) mm, to first order.

    What the motions do to the forces is their central difference: exact but for the curvature of a micrometre.
    """
    assembler, state = at.scene.assembler, State(at.equilibrium.u, at.equilibrium.p)
    at.tangent.set_materials()
    assembler.terms = at.scene.terms
    moved = motions * ~assembler.free.reshape(-1, 3)
    columns = []
    for motion in moved:
        ahead, back = (State(state.u + s * _STEP_MM * motion, state.p) for s in (1.0, -1.0))
        columns.append((out_of_balance(assembler, ahead) - out_of_balance(assembler, back)) / (2.0 * _STEP_MM))
    if not columns:
        return moved
    return np.asarray(moved - at.tangent.displacements(np.stack(columns, axis=1)))


def _squared(responses: FloatArray, data: DataVector) -> FloatArray:
    return responses @ responses.T if responses.shape[1] else np.zeros((data.n, data.n))
