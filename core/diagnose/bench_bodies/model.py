"""Model of a body in its states: the one forward model, with clamps, moved patches and known loads in place of walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.marker_data import MarkerData
from palpate.core.diagnose.bench_bodies.problem import BodyPatch, BodyProblem, PointLoad
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import PointForce, body_force
from palpate.core.forward.composition import Composition, LoadPart, Patch, PerAxis
from palpate.core.forward.effect import Effect, Parameter, Variant
from palpate.core.forward.scene_parts import dead_load
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.observe.motion_observation import MotionObservation
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.joint_states import JointLinearisation, JointModel, apart
from palpate.core.residual.linearised_model import Hypothesis, SolveCount, StateModel
from palpate.core.surfaces.distance_field import SignedDistanceField

# A point load spreads over the surface with this standard deviation, mm.
_LOAD_MM = 4.0
_MN = 1000.0  # mN in a N
# Numerical: draws of the error that patches of whole faces have.
_DRAWS = 8
# 1 kg/m3 times 1 m/s2 in kPa/mm.
_WEIGHT = 1e-6


@dataclass(eq=False)
class BenchModel(StateModel):
    """`StateModel` whose data are those of a bench."""

    @property
    def marker_data(self) -> MarkerData:
        """The data."""
        assert isinstance(self.data, MarkerData)
        return self.data


def bench_model(problem: BodyProblem, element: str, common: float) -> JointModel:
    """Models of all states. element : see core.fem.elements. common : see `MarkerData.on`.

    Raises InputError where a model is solved and nothing holds the body.
    """
    count = SolveCount()
    return JointModel(tuple(state_model(problem, k, element, common, count) for k in range(len(problem.states))))


def marker_data(model: JointModel) -> list[MarkerData]:
    """Data of a body's states."""
    return [one.marker_data for one in model.each if isinstance(one, BenchModel)]


def state_model(
    problem: BodyProblem, state: int, element: str, common: float, count: SolveCount | None = None
) -> BenchModel:
    """Model of one state; see `bench_model`."""
    geometry = _geometry(problem, element)
    data = MarkerData.on(problem, state, geometry.space, common)
    patches = tuple(Patch(p.faces, p.facts.displacement_mm) for p in problem.patches_in(state))
    plain = Composition(problem.shell, load=_loads(problem, state), patches=patches, state=state, on_bench=True)
    none = ElementCorrection.none(data.n)
    return BenchModel(geometry, data, plain, none, count=count or SolveCount())


def _geometry(problem: BodyProblem, element: str) -> SharedGeometry:
    """Geometry without walls and without a surface that is seen."""
    space = Space.of(problem.mesh, element)
    none, no_points = sp.csr_matrix((0, space.n_nodes)), np.zeros((0, 3))
    nothing = SurfaceObservation(
        no_points,
        no_points,
        np.zeros(0, dtype=np.int64),
        np.zeros(0),
        none,
        SignedDistanceField(np.zeros((4, 4, 4)), np.zeros(3), 1.0),
        np.zeros((0, 6)),
        none,
        MotionObservation.empty(space.n_nodes),
    )
    return SharedGeometry(problem.shell, element, nothing, {}, WallMotionOptions())


def _loads(problem: BodyProblem, state: int) -> tuple[LoadPart, ...]:
    """What acts in a state as far as the plain model knows it."""
    stated = problem.states[state]
    parts: list[LoadPart] = [_point_load(load) for load in stated.loads]
    if problem.model_gravity:
        b = _WEIGHT * problem.density_kg_m3 * np.array(stated.gravity)
        parts.append(cache(lambda space: body_force(space, b)))
    return tuple(parts)


def _point_load(load: PointLoad) -> LoadPart:
    """A force on the surface around the point nearest to where it acts; made once for each space."""

    def made(space: Space) -> Term:
        surface = np.unique(space.face_nodes(space.mesh.boundary[0]))
        X = space.nodes[surface]
        nearest = X[int(np.argmin(np.linalg.norm(X - np.array(load.at), axis=1)))]
        weight = np.exp(-0.5 * ((X - nearest) ** 2).sum(axis=1) / _LOAD_MM**2)
        force = np.zeros((space.n_nodes, 3))
        force[surface] = (weight / weight.sum())[:, None] * _MN * np.array(load.force_n)
        return PointForce(dead_load(space, []).points, force)

    return cache(made)


def noise_covariance(problem: BodyProblem, model: JointModel, at: JointLinearisation) -> FloatArray:
    """Covariance (n, n) of all data: of measurement, and, carried through the model, of the displacements that were
    prescribed and of where the patches end."""
    parts = [
        np.hstack([np.zeros((d.n, 0)), *_by_patches(problem, model, at, k)]) for k, d in enumerate(marker_data(model))
    ]
    measured = [d.covariance for d in marker_data(model)]
    moved = apart(parts)
    return np.asarray(apart(measured) + moved @ moved.T + _by_rims(problem, model, at))


def _by_rims(problem: BodyProblem, model: JointModel, at: JointLinearisation) -> FloatArray:
    """Covariance (n, n) of the error that patches are made of whole faces.

    By draws, in which each face that an edge cuts has its side changed or not. A patch has a face whose centre lies in it,
    so that the share that is wrongly in or out lies evenly between minus and plus a half: its variance is a third of
    that of a draw.
    """
    columns, rng = [], np.random.default_rng(1)
    for _ in range(_DRAWS if any(len(p.rim) for p in problem.patches) else 0):
        patches = tuple(p.with_rim_toggled(rng.random(len(p.rim)) < 0.5) for p in problem.patches)
        if not all(len(p.faces) for p in patches):
            continue
        drawn = bench_model(
            replace(problem, patches=patches), model.first.geometry.element, marker_data(model)[0].common
        )
        solved = drawn.plain(at.theta, at)
        if solved is not None:
            columns.append(solved.residual - at.residual)
    return shrunk(np.stack(columns, axis=1) / np.sqrt(3.0)) if len(columns) > 1 else np.zeros((model.n, model.n))


def shrunk(draws: FloatArray) -> FloatArray:
    """Covariance (n, n) of draws (n, d) about 0, shrunk towards its diagonal by the share that has the least expected
    error (Schäfer & Strimmer 2005): fewer draws than data know nothing of most directions, and must not claim to."""
    d = draws.shape[1]
    products = np.einsum("id,jd->ijd", draws, draws)
    S, off = products.mean(axis=2), ~np.eye(len(draws), dtype=bool)
    error = products.var(axis=2, ddof=1)[off].sum() / d
    share = min(float(error / max((S[off] ** 2).sum(), 1e-300)), 1.0)
    return np.asarray((1.0 - share) * S + share * np.diag(np.diag(S)))


def _by_patches(problem: BodyProblem, model: JointModel, at: JointLinearisation, state: int) -> list[FloatArray]:
    """Change (n, a) of a state's data by one standard deviation of every patch's displacement, axis by axis."""
    out = []
    for index, patch in enumerate(problem.patches_in(state)):
        error = _error_of(patch, index, state)
        if error is not None and error.effect is not None:
            here = replace(at.each[state], phi=np.zeros(error.n))
            out.append(model.each[state].directions(error, here) * error.effect.scales)
    return out


def _error_of(patch: BodyPatch, index: int, state: int) -> Hypothesis | None:
    """A wrong displacement of a state's patch of this index, as something that can be put to a model; None for a sure
    one."""
    facts = patch.facts
    axes = [i for i, sd in enumerate(facts.sd_mm) if sd > 0.0 and facts.displacement_mm[i] is not None]
    if not axes:
        return None

    def change(composition: Composition, phi: FloatArray) -> Composition:
        moved = list(composition.patches[index].displacement)
        for axis, value in zip(axes, phi.tolist(), strict=True):
            moved[axis] = (moved[axis] or 0.0) + value
        patches = list(composition.patches)
        patches[index] = replace(patches[index], displacement=_three(moved))
        return replace(composition, patches=tuple(patches))

    parameters = [Parameter(f"{facts.name}_{'xyz'[i]}", "mm", facts.sd_mm[i]) for i in axes]
    variant = Variant(change, facts.name)
    return Hypothesis(
        Effect("patch_error", "a patch was moved otherwise", parameters, lambda _: [variant], ""), variant
    )


def _three(values: Sequence[float | None]) -> PerAxis:
    x, y, z = values
    return x, y, z
