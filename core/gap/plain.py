"""The plain model fitted: an element that is quick looks for the stiffness, a better one says by how much that was wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import State
from palpate.core.fem.newton import NewtonOptions
from palpate.core.gap.bone_sight import BoneSight
from palpate.core.gap.composition import Composition
from palpate.core.gap.fit import Bench, Point, Trial, carried
from palpate.core.gap.forces import ForceFields
from palpate.core.gap.noise_fit import fit_noise
from palpate.core.gap.noise_model import NoiseParts, NoiseSizes
from palpate.core.gap.scene import Stage
from palpate.core.gap.sight import Sight
from palpate.core.identify.gauss_newton import gauss_newton
from palpate.core.identify.reference import middle
from palpate.core.observe.noise import Weighting
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.worker.progress import Progress, silent

FloatArray = NDArray[np.float64]

QUICK, GOOD = "p1p1", "p2p1"
PLAIN = Trial()
_NOTHING = np.zeros(0)
# How far a contour may be offset, mm, and bones may seem to have moved, mm and degrees, while the noise is estimated.
_OFFSET_MM, _BONES = 1.0, 5.0
# Rounds in which the walls of the better element find their place from where the quick one had them.
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class PlainFit:
    """The plain model where it fits best.

    point : at the quick element, residuals corrected; its tangent is the one factorised. mesh : (n,) what the better element
    changed. sizes : of the noise of this case. weighting : of the data vector.
    """

    bench: Bench
    point: Point
    mesh: FloatArray
    noise: NoiseParts
    sizes: NoiseSizes
    weighting: Weighting


def fit_plain(
    problem: IdentificationProblem,
    bones: SurfacePair | None,
    sizes: NoiseSizes | None = None,
    good: str = GOOD,
    progress: Progress = silent,
) -> PlainFit:
    """Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved."""
    sizes = sizes or NoiseSizes()
    progress(0.0, "plain model: surfaces and distances")
    stage = Stage.of(problem, QUICK)
    composition = Composition(problem)
    centre = problem.organ.rest.points.mean(axis=0)
    bone = None if bones is None else BoneSight.of(bones, centre)
    sight = Sight.of(stage.observation, bone)
    bench = Bench(stage, sight, composition, np.zeros(sight.n))
    progress(0.2, "plain model: stiffness with the quick element")
    bounds = stage.scene(composition).parameters.bounds
    first = _solved(bench, middle(bounds), None)
    noise = NoiseParts.of(first.scene, sight, first.equilibrium.u)
    weighting = Weighting(noise.covariance(sizes, np.zeros(sight.n)))
    point = _best(bench, weighting, [middle(bounds), bounds.mean(axis=1) + 0.2 * np.ptp(bounds, axis=1)], first)
    progress(0.4, "plain model: the better element")
    better = Bench(Stage.of(problem, good, stage), sight, composition, np.zeros(sight.n))
    mesh = _better_residual(better, point) - point.residual
    bench.correction = mesh
    progress(0.8, "plain model: noise of this case's contours")
    point = replace(point, residual=point.residual + mesh)
    noise = NoiseParts.of(point.scene, sight, point.equilibrium.u)
    sizes = fit_noise(noise, sizes, mesh, point.residual, point.in_theta, _free(point, sight))
    weighting = Weighting(noise.covariance(sizes, mesh))
    point = _best(bench, weighting, [point.theta], point)
    return PlainFit(bench, point, mesh, noise, sizes, weighting)


def _free(point: Point, sight: Sight) -> list[FloatArray]:
    """What may have moved the data besides noise: missing forces, an offset of the contour, the bones. (n, k) each."""
    offset = np.zeros((sight.n, 1))
    offset[: sight.n_modes, 0] = _OFFSET_MM * sight.modes.sum(axis=0)
    bones = np.zeros((sight.n, 6))
    if sight.bone is not None:
        bones[-6:] = _BONES * np.eye(6)
    return [ForceFields.around(point, sight).response, offset, bones]


def _better_residual(better: Bench, point: Point) -> FloatArray:
    """(n,) residual of the plain model with the better element, from the quick one's equilibrium: their pressures share their nodes."""
    scene = better.stage.scene(better.plain)
    state = State(carried(point, scene), point.equilibrium.p)
    for _ in range(_ROUNDS):
        scene.linearise(state.u)
        found = scene.solve(point.theta, state, NewtonOptions(rtol=1e-5, stability=False))
        if not found.converged:
            return _solved(better, point.theta, None).residual
        state = State(found.u, found.p)
    return better.sight.residual(scene, state.u)


def _solved(bench: Bench, theta: FloatArray, near: Point | None) -> Point:
    point = bench.solve(PLAIN, theta, _NOTHING, near)
    if point is None:
        raise ConvergenceError(
            "the rest anatomy cannot be deformed into what the second scan shows; look at the contours of bladder and "
            "rectum, or mesh more finely"
        )
    return point


def _best(bench: Bench, weighting: Weighting, starts: list[FloatArray], near: Point) -> Point:
    """Gauss-Newton from every start; the best point of all."""
    best: tuple[float, Point] | None = None
    bounds = near.scene.parameters.bounds
    for start in starts:
        here = near

        def linearise(theta: FloatArray) -> tuple[FloatArray, FloatArray] | None:
            nonlocal best, here
            point = bench.solve(PLAIN, theta, _NOTHING, here)
            if point is None:
                return None
            here = point
            residual = weighting.whiten(point.residual)
            if best is None or residual @ residual < best[0]:
                best = float(residual @ residual), point
            return residual, weighting.whiten(point.in_theta)

        gauss_newton(linearise, start, bounds)
    if best is None:
        raise ConvergenceError("no start of Gauss-Newton could be solved; look at the mesh and at the contours")
    # The factor left behind must be that of the best point.
    return _solved(bench, best[1].theta, best[1])
