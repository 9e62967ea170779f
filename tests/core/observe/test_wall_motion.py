"""How a wall moved along itself: straight out where it fills; one that moved as a whole is told so by its normals alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.core.fem.terms.base import PointSet
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.observe.wall_motion import WallMotion
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.observe.wall_motion_prior import likeliest
from palpate.core.observe.wall_rigid_and_growth import WallRigidModes, force_covariance

RADIUS = np.array([14.0, 10.0, 22.0])
USUAL = WallMotionOptions()


def ellipsoid(x: np.ndarray, centre: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A function that is 0 on the ellipsoid and about the distance beside it, with its gradient."""
    y = (x - centre) / radius
    size = np.linalg.norm(y, axis=1)
    slope = y / radius / size[:, None]
    steep = np.linalg.norm(slope, axis=1)
    return (size - 1.0) / steep, slope / steep[:, None]


def points(n: int = 500) -> np.ndarray:
    k = np.arange(n) + 0.5
    z, a = 1.0 - 2.0 * k / n, np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - z**2)
    return np.column_stack([r * np.cos(a), r * np.sin(a), z]) * RADIUS


def at_rest(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return ellipsoid(x, np.zeros(3), RADIUS)


def wall(shift: np.ndarray, radius: np.ndarray) -> SlidingWall:
    X = points()
    at = PointSet(np.arange(len(X))[:, None], np.ones((len(X), 1)), np.full(len(X), 5.0))
    return SlidingWall.between(at, X, at_rest, lambda x: ellipsoid(x, shift, radius), 8000.0)


def test_a_wall_that_moved_as_a_whole_moved_along_itself_too() -> None:
    shift = np.array([1.0, -4.0, 2.0])
    found = WallMotion.of(wall(shift, RADIUS), at_rest, 0.1, USUAL).at(points())
    assert np.linalg.norm(found - shift, axis=1).mean() < 0.5
    frictionless = np.abs(((found - shift) * shift).sum(axis=1)).mean() / (shift @ shift)
    assert frictionless < 0.15


def test_a_wall_that_stayed_did_not_move_and_what_is_unknown_is_small() -> None:
    motion = WallMotion.of(wall(np.zeros(3), RADIUS), at_rest, 0.1, USUAL)
    assert np.abs(motion.at(points())).max() < 0.05
    unknown = (motion.unknown_at(points()) ** 2).sum(axis=(0, 2)).mean()
    assert unknown < 1.0
    assert motion.slide_mm < 0.02  # a wall slides by a share of how far it moved


def test_what_is_unknown_covers_what_is_wrong() -> None:
    """A swelling moves every point outwards; the error lies within three of its own standard deviations for nearly all."""
    grown = np.array([1.3, 1.3, 1.1])
    motion = WallMotion.of(wall(np.zeros(3), RADIUS * grown), at_rest, 0.1, USUAL)
    error = motion.at(points()) - points() * (grown - 1.0)
    sd = np.sqrt((motion.unknown_at(points()) ** 2).sum(axis=(0, 2)))
    assert (np.linalg.norm(error, axis=1) < 3.0 * sd + 0.2).mean() > 0.8


def test_a_wall_that_fills_moves_straight_out() -> None:
    """Offset by 6 mm: the motion is along the normals, though the deformed surface's own normals would fit many others."""
    X, out = points(), at_rest(points())[1]

    def offset(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return ellipsoid(x, np.zeros(3), RADIUS + 6.0)

    at = PointSet(np.arange(len(X))[:, None], np.ones((len(X), 1)), np.full(len(X), 5.0))
    found = WallMotion.of(SlidingWall.between(at, X, at_rest, offset, 8000.0), at_rest, 0.1, USUAL).at(X)
    along = (found * out).sum(axis=1)
    sideways = np.linalg.norm(found - along[:, None] * out, axis=1)
    assert np.abs(along - 6.0).mean() < 0.6
    assert sideways.mean() < 0.6


@pytest.mark.parametrize("length", [12.0, 29.0])
def test_the_likeliest_length_is_about_the_true_one(length: float) -> None:
    X = points()[::2]
    out = at_rest(X)[1]
    distance = np.linalg.norm(X[:, None] - X, axis=2)
    K = 9.0 * np.exp(-0.5 * (distance / length) ** 2) + 1e-6 * np.eye(len(X))
    v = np.linalg.cholesky(K) @ np.random.default_rng(2).standard_normal(len(X))
    found = likeliest(
        X, out, out, v, 0.01 * np.eye(len(X)), WallRigidModes(np.eye(3), np.zeros(3), 20.0, np.zeros(3), USUAL)
    )
    assert found.length == pytest.approx(length, rel=0.45)
    assert np.hypot(found.size, USUAL.sideways_mm) == pytest.approx(3.0, rel=0.6)


def tube(x: np.ndarray, bulge: float) -> tuple[np.ndarray, np.ndarray]:
    """Distance of a tube along z, 14 mm wide, whose middle has bulged and whose contour wanders; to first order in its slope."""
    r, phi = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
    bell = np.exp(-0.5 * (x[:, 2] / 18.0) ** 2)
    radius = 14.0 + bulge * bell * (1.0 - 0.5 * np.sin(phi)) + 0.2 * np.sin(0.4 * x[:, 2] + 3.0 * phi)
    slope = -bulge * x[:, 2] / 18.0**2 * bell * (1.0 - 0.5 * np.sin(phi)) + 0.08 * np.cos(0.4 * x[:, 2] + 3.0 * phi)
    n = np.column_stack([np.cos(phi), np.sin(phi), -slope])
    length = np.linalg.norm(n, axis=1)
    return (r - radius) / length, n / length[:, None]


def test_a_tube_that_bulges_does_not_slide_along_its_axis() -> None:
    """Flanks of the bulge face along the tube: a slide would explain a little of the contours' noise, and nothing forbids it."""
    z, phi = (a.ravel() for a in np.meshgrid(np.linspace(-55.0, 55.0, 38), np.linspace(0.0, 2.0 * np.pi, 23)[:-1]))
    X = np.column_stack([14.0 * np.cos(phi), 14.0 * np.sin(phi), z])
    at = PointSet(np.arange(len(X))[:, None], np.ones((len(X), 1)), np.full(len(X), 9.0))
    wall = SlidingWall.between(at, X, lambda x: tube(x, 0.0), lambda x: tube(x, 7.0), 8000.0)
    found = WallMotion.of(wall, lambda x: tube(x, 0.0), 0.2, USUAL).at(X)
    assert np.abs(found[:, 2]).mean() < 0.5
    assert np.abs(wall.linearised_at(found).shift - (wall.linearised_at(found).normal * found).sum(axis=1)).mean() < 0.3


def test_sections_of_a_tube_that_are_pushed_aside_go_along_together() -> None:
    """Across the wall a section's shift looks like a swelling on one side; its other sides slid along themselves."""
    z, phi = (a.ravel() for a in np.meshgrid(np.linspace(-55.0, 55.0, 38), np.linspace(0.0, 2.0 * np.pi, 23)[:-1]))
    X = np.column_stack([14.0 * np.cos(phi), 14.0 * np.sin(phi), z])

    def pushed_aside(x: np.ndarray) -> np.ndarray:
        return np.column_stack([5.0 * np.exp(-0.5 * (x[:, 2] / 18.0) ** 2), np.zeros((len(x), 2))])

    at = PointSet(np.arange(len(X))[:, None], np.ones((len(X), 1)), np.full(len(X), 9.0))
    wall = SlidingWall.between(
        at, X, lambda x: tube(x, 0.0), lambda x: tube(x - pushed_aside(x), 0.0), 8000.0
    )  # to first order in the push's slope
    found = WallMotion.of(wall, lambda x: tube(x, 0.0), 0.2, USUAL)
    normal, moved = tube(X, 0.0)[1], pushed_aside(X)
    straight = (moved * normal).sum(axis=1)[:, None] * normal
    aside = np.abs(z) < 18.0
    off = np.linalg.norm((found.at(X) - moved)[aside], axis=1)
    assert off.mean() < 0.1 * np.linalg.norm((straight - moved)[aside], axis=1).mean()
    # What is not known of it is about as large as what is wrong.
    sd = np.sqrt((found.unknown_at(X[aside]) ** 2).sum(axis=(0, 2)))
    assert (off < 3.0 * sd + 0.2).mean() > 0.9


def test_points_at_an_end_where_the_two_surfaces_differ_move_little_else() -> None:
    """Six of 836 points, where the wall leaves the scan, are 8 mm off: without weights they move its middle by 2.5 mm, with them by 1."""
    z, phi = (a.ravel() for a in np.meshgrid(np.linspace(-55.0, 55.0, 38), np.linspace(0.0, 2.0 * np.pi, 23)[:-1]))
    X = np.column_stack([14.0 * np.cos(phi), 14.0 * np.sin(phi), z])
    at = PointSet(np.arange(len(X))[:, None], np.ones((len(X), 1)), np.full(len(X), 9.0))

    def ending(x: np.ndarray, off: float) -> tuple[np.ndarray, np.ndarray]:
        distance, normal = tube(x, 6.0)
        return distance + off * ((x[:, 2] < -50.0) & (x[:, 0] > 13.0)), normal

    read = [
        WallMotion.of(
            SlidingWall.between(at, X, lambda x: tube(x, 0.0), lambda x, off=off: ending(x, off), 8000.0),  # type: ignore[misc]
            lambda x: tube(x, 0.0),
            0.2,
            USUAL,
        ).at(X[np.abs(z) < 15.0])
        for off in (0.0, 8.0)
    ]
    assert np.linalg.norm(read[1] - read[0], axis=1).mean() < 1.5


def test_a_ball_may_be_pushed_anywhere_and_a_tube_not_along_its_axis() -> None:
    ball = np.random.default_rng(1).standard_normal((20000, 3))
    np.testing.assert_allclose(force_covariance(ball / np.linalg.norm(ball, axis=1)[:, None]), np.eye(3), atol=0.05)
    phi = np.linspace(0.0, 2.0 * np.pi, 200)[:-1]
    np.testing.assert_allclose(
        force_covariance(np.column_stack([np.cos(phi), np.sin(phi), 0.0 * phi])), np.diag([1.5, 1.5, 0.0]), atol=1e-12
    )


def test_a_bag_that_grows_about_its_neck_slides_as_it_grows_and_a_tube_has_no_size() -> None:
    """Growth about one end of an ellipsoid moves its sides along themselves; its own normals would not."""
    neck = np.array([0.0, 0.0, -22.0])
    moved = 0.25 * (points() - neck)
    found = WallMotion.of(wall(-0.25 * neck, 1.25 * RADIUS), at_rest, 0.2, USUAL).at(points())
    straight = (moved * at_rest(points())[1]).sum(axis=1)[:, None] * at_rest(points())[1]
    assert np.linalg.norm(found - moved, axis=1).mean() < 0.4 * np.linalg.norm(straight - moved, axis=1).mean()
    phi = np.linspace(0.0, 2.0 * np.pi, 200)[:-1]
    round_tube = np.column_stack([np.cos(phi), np.sin(phi), 0.0 * phi])
    assert WallRigidModes.of(points(), at_rest(points())[1], USUAL).radius == pytest.approx(
        np.sqrt((points() ** 2).sum(axis=1).mean()), rel=0.01
    )
    assert np.isinf(WallRigidModes.of(round_tube, round_tube, USUAL).radius)


def test_other_priors_make_another_motion() -> None:
    """Twice the slide, three times the sideways motion: more is unknown, and the likeliest motion is another."""
    moved = wall(np.array([3.0, 0.0, 0.0]), RADIUS)
    free = replace(USUAL, slide_share=0.4, sideways_mm=2.1)
    one, other = (WallMotion.of(moved, at_rest, 0.1, options) for options in (USUAL, free))
    assert other.slide_mm == pytest.approx(2.0 * one.slide_mm, rel=0.2)
    unknown = [(motion.unknown_at(points()) ** 2).sum(axis=(0, 2)).mean() for motion in (one, other)]
    assert unknown[1] > 1.5 * unknown[0]
    assert np.abs(other.at(points()) - one.at(points())).max() > 1e-3
