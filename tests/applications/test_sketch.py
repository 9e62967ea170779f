"""Figures through keyframes: pairing of outlines, derivatives, and a stiffness that is found again from shapes alone."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.applications.sketch.closing import closed
from palpate.applications.sketch.figure import Figure, FigureOptions
from palpate.applications.sketch.fit import fit_degree, fit_keyframes
from palpate.applications.sketch.fit_walk import FitOptions
from palpate.applications.sketch.matching import matched
from palpate.applications.sketch.motion import MotionOptions, animate
from palpate.applications.sketch.outline import Outline, hausdorff
from palpate.applications.sketch.residual import Target, residual_of
from palpate.applications.sketch.run_sketch import sides_that_stay
from palpate.applications.sketch.swarm_fit import SwarmFitOptions, swarm_fit
from palpate.core.errors import InputError
from palpate.core.fem.meshes import box, with_regions

WIDE, TALL, TRUE_RATIO = 42.0, 100.0, 0.4
# Forces of degree 0: along x, along y; in FORCE_UNIT of the lower part's modulus.
PULLS = np.array([[0.13, 0.06], [-0.08, 0.25]])


def rectangle(spacing: float = 1.0) -> Outline:
    corners = np.array([[0.0, 0.0], [WIDE, 0.0], [WIDE, TALL], [0.0, TALL]])
    return Outline((corners,)).resampled(spacing)


def figure(divisions: tuple[int, int, int], element: str = "p2") -> Figure:
    """Two parts, the boundary between them at 0.55 of the height."""
    mesh = box((WIDE, TALL, 8.0), divisions)
    mesh = with_regions(mesh, lambda x: 1 + (x[:, 1] > 0.55 * TALL).astype(np.int64))
    return Figure(mesh, rectangle(), FigureOptions(("bottom",), 0.4, element))


@pytest.fixture(scope="module")
def drawn() -> list[Outline]:
    """Keyframes of a known stiffness: another mesh and another element than those that find it."""
    true = figure((8, 20, 1), "p2p0")
    basis = true.force_basis(0)
    found = [true.solve(np.log([TRUE_RATIO]), np.tensordot(pull, basis, 1)) for pull in PULLS]
    assert all(end.converged for end in found)
    return [true.rim_at(end.u) for end in found]


@pytest.fixture(scope="module")
def model() -> Figure:
    return figure((5, 13, 1))


def targets(model: Figure, drawn: list[Outline]) -> tuple[Target, ...]:
    return tuple(Target(key, matched(model.outline, key)) for key in drawn)


def test_a_drawn_stiffness_is_found_again_and_the_outlines_are_hit(model: Figure, drawn: list[Outline]) -> None:
    fit = fit_keyframes(model, targets(model, drawn), highest=1)
    assert np.exp(fit.theta[0]) == pytest.approx(TRUE_RATIO, rel=0.1)
    for key, end in zip(drawn, fit.states, strict=True):
        assert hausdorff(model.rim_at(end.u), key) < 0.02 * TALL
    assert fit.degree == 0
    assert fit.forces == pytest.approx(PULLS, rel=0.05)  # and so a known pull would give G as exactly
    assert 0.0 < fit.covariance[0, 0] < 0.3**2


def test_the_swarm_ends_where_gauss_newton_does(model: Figure, drawn: list[Outline]) -> None:
    found = targets(model, drawn)
    fit = fit_degree(model, found, 0)
    best, history = swarm_fit(model, found, fit, options=SwarmFitOptions(particles=5, iterations=5, seed=3))
    assert (np.diff(history) <= 0.0).all()
    assert fit.misfit < best.misfit + 0.1
    assert abs(best.theta[0] - fit.theta[0]) < 0.25


def test_derivatives_of_the_outline_distance(model: Figure, drawn: list[Outline]) -> None:
    basis, target = model.force_basis(1), targets(model, drawn)[0]
    theta, c = np.array([0.4]), np.array([0.2, 0.1, 0.05, -0.1, 0.0, 0.1])

    def at(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        end = model.solve(x[:1], np.tensordot(x[1:], basis, 1))
        moves = model.sensitivities(x[:1], end, basis)
        return residual_of(model, end, moves, target, 0.5, 0.004)

    x = np.concatenate([theta, c])
    _, jacobian = at(x)
    for k in (0, 2, 5):
        step = 1e-4 * np.eye(len(x))[k]
        slope = (at(x + step)[0] - at(x - step)[0]) / 2e-4
        assert jacobian[:, k] == pytest.approx(slope, rel=1e-2, abs=1e-3 * np.abs(slope).max())


def test_points_are_paired_by_place_and_shape() -> None:
    """A bent and stretched L: every point's partner is known."""
    loop = np.array([[0, 0], [60, 0], [60, 18], [20, 18], [20, 100], [0, 100]], dtype=float)
    rest = Outline((loop,)).resampled(1.0)

    def bent(x: np.ndarray) -> np.ndarray:
        return np.column_stack([x[:, 0] + 0.004 * x[:, 1] ** 2, 0.9 * x[:, 1]])

    key = Outline((np.roll(bent(rest.points), 57, axis=0),)).resampled(0.9)
    off = np.linalg.norm(matched(rest, key) - bent(rest.points), axis=1)
    assert np.median(off) < 2.0 and off.max() < 8.0


def test_other_numbers_of_holes_are_refused() -> None:
    hole = np.array([[10.0, 10.0], [10.0, 20.0], [20.0, 20.0], [20.0, 10.0]])
    with pytest.raises(InputError, match="b has 1 holes and the first keyframe 0"):
        matched(rectangle(), Outline((rectangle().loops[0], hole)), "b")


def test_sides_that_stay_are_seen(drawn: list[Outline]) -> None:
    assert sides_that_stay(rectangle(), drawn) == ("bottom",)
    jumped = Outline((rectangle().loops[0] + [0.0, 30.0],))
    foot = Outline((np.array([[0.0, 0.0], [50.0, 0.0], [40.0, 60.0], [10.0, 60.0]]),)).resampled(1.0)
    leant = Outline((foot.loops[0] + np.outer(foot.loops[0][:, 1], [0.3, 0.0]),))
    assert sides_that_stay(foot, [leant]) == ("bottom",)
    assert sides_that_stay(rectangle(), [jumped]) == ()


def test_a_figure_that_nothing_holds_can_jump() -> None:
    mesh = box((WIDE, TALL, 8.0), (3, 7, 1))
    free = Figure(mesh, rectangle(2.0), FigureOptions(()))
    jumped = Outline((rectangle(2.0).loops[0] * [1.0, 0.95] + [25.0, 40.0],))
    target = Target(jumped, matched(free.outline, jumped, held=False))
    fit = closed(free, (target,), fit_degree(free, (target,), 0, options=FitOptions(evaluations=10)))
    assert hausdorff(free.rim_at(fit.states[0].u), jumped) < 0.02 * TALL
    assert fit.theta.shape == (0,)


def test_the_motion_passes_through_every_keyframe(model: Figure, drawn: list[Outline]) -> None:
    fit = fit_degree(model, targets(model, drawn), 0)
    moving = animate(model, fit, MotionOptions(leg=3, still=1, beyond=2, swing=6))
    assert moving.notes == []
    assert moving.said.count("between keyframes 1 and 2") == 3 and moving.said[-1] == "let go"
    for k, end in enumerate(fit.states, start=2):
        assert np.abs(moving.u[moving.said.index(f"keyframe {k}")] - end.u).max() == 0.0
    steps = [np.abs(b - a).max() for a, b in zip(moving.u, moving.u[1:], strict=False)]
    assert max(steps) < 0.4 * TALL
