"""What an error of the organ's contour at rest does to the motion that the model predicts.

The contour at rest is the model's geometry: where it lies too far outside, tissue is taken for organ. The motion changes
then at every matched point, which the contour's error moves through the stiffness that each place has. The boundary is
moved along its normal by the smooth modes of the contour's error, the mesh follows, and the equilibrium follows to first
order: du = -K^-1 dr, with dr the change of the residual forces on the moved mesh at the same nodal displacements, and K the
tangent. A point between the nodes sees N du - grad u M there, with M the motion of the mesh (Haftka & Grandhi 1986,
"Structural shape optimization: a survey").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.elements import barycentric, shape_gradients
from palpate.core.fem.space import Space, locate
from palpate.core.fem.tangent import Tangent
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.observe.contour_noise import covariance_between, leading_eigenpairs, smooth_covariance
from palpate.core.residual.data_vector import DataVector

# Step of the forward differences of forces, mm: exact but for the curvature of a micrometre. Reach of a mode beside the
# surface, in correlation lengths: beyond it the mesh stays.
_STEP_MM, _REACH = 1e-3, 2.5


@dataclass(frozen=True, eq=False)
class ShapeModes:
    """Smooth modes of the organ's contour at rest. vectors (q, k) : orthonormal, at the observed points. moves (k, vertices,
    3) : motion of the mesh's vertices per unit of each mode, along the surface's normal; 0 where walls, bone or the region's
    edge are."""

    vectors: FloatArray
    moves: FloatArray

    @classmethod
    def of(cls, scene: CompositionScene, length_mm: float, least: float) -> ShapeModes:
        """Modes with that correlation length, whose variance is at least `least` of the largest one's."""
        points, normals = scene.observation.points, scene.observation.normals
        values, vectors = leading_eigenpairs(smooth_covariance(points, 1.0, length_mm))
        kept = values > least * values[0]
        values, vectors = values[kept], vectors[:, kept]
        X = scene.problem.mesh.points
        near = np.setdiff1d(np.flatnonzero(cKDTree(points).query(X)[0] < _REACH * length_mm), _standing(scene))
        kernel = covariance_between(X[near], points, 1.0, length_mm)
        outwards = kernel @ normals
        outwards /= np.maximum(np.linalg.norm(outwards, axis=1, keepdims=True), 1e-30)
        sizes = kernel @ (vectors / values)  # Nystroem's extension: the mode itself on the surface, less beside it
        moves = np.zeros((sizes.shape[1], *X.shape))
        moves[:, near] = sizes.T[:, :, None] * outwards
        return cls(vectors, moves)


def _standing(scene: CompositionScene) -> IntArray:
    """Vertices of the mesh's boundary, which do not move: walls, bone, the region's edge."""
    faces = scene.problem.mesh.boundary[0]
    return np.unique(faces)


def shape_response(
    scene: CompositionScene, data: DataVector, tangent: Tangent, length_mm: float, least: float
) -> FloatArray:
    """Change (n, q) of a state's data when the organ's contour at rest lies 1 mm farther outside at each observed point, as
    far as the equilibrium of a scene's tangent changes by it.

    That the contour itself is compared with the deformed one is not part of it. length_mm, least : see `ShapeModes.of`.
    """
    modes = ShapeModes.of(scene, length_mm, least)
    observation, u = scene.observation, tangent.state.u
    _, normal = observation.target.value_and_gradient(observation.points + observation.operator @ scene.seen(u))
    carried = _Convection.of(scene.space, observation.motion.rows.nodes, u)
    out = np.zeros((data.n, modes.vectors.shape[1]))
    for k, (move, moved) in enumerate(zip(modes.moves, _moved(tangent, modes.moves), strict=True)):
        surface, marks, motion = observation.parts_of(observation.all_points @ moved)
        out[: data.n_modes, k] = data.modes.T @ (surface * normal).sum(axis=1)
        out[data.marks, k] = marks.ravel()
        out[data.motion, k] = observation.motion.modes_of(motion - carried.by(move))
    return np.asarray(out @ modes.vectors.T)


def _moved(tangent: Tangent, moves: FloatArray) -> FloatArray:
    """Change (k, nodes, 3) mm of the nodal displacements when the mesh's vertices move by moves (k, vertices, 3) mm."""
    assembler, state = tangent.assembler, tangent.state
    tangent.set_materials()
    X = assembler.space.mesh.points
    here = assembler.internal_residual_on(X, state)
    changes = [assembler.internal_residual_on(X + _STEP_MM * move, state) - here for move in moves]
    return -tangent.displacements(np.stack(changes, axis=1) / _STEP_MM)


@dataclass(frozen=True, eq=False)
class _Convection:
    """What a motion of the mesh carries past fixed points: vertices (p, 4) of their cells, weights (p, 4) of these, and
    slopes (p, 3, 3), the gradient of the displacement there."""

    vertices: IntArray
    weights: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, space: Space, points: FloatArray, u: FloatArray) -> _Convection:
        """At points (p, 3) mm of a space, for nodal displacements u (n, 3) mm."""
        if not len(points):
            return cls(np.zeros((0, 4), dtype=np.int64), np.zeros((0, 4)), np.zeros((0, 3, 3)))
        cell, xi = locate(space.mesh, points)
        gradients = shape_gradients(space.element.degree, xi) @ space.inverse_jacobians[cell]
        slopes = np.einsum("pai,paj->pij", u[space.cell_nodes[cell]], gradients)
        return cls(space.mesh.cells[cell], barycentric(xi), slopes)

    def by(self, move: FloatArray) -> FloatArray:
        """Displacement (p, 3) mm that a motion of the vertices (n, 3) mm carries past the points."""
        there = np.einsum("pa,pai->pi", self.weights, move[self.vertices])
        return np.asarray(np.einsum("pij,pj->pi", self.slopes, there))
