"""Contours carried over to another scan by the motion of a made-up pelvis: where they go, and how far they may be off."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy import ndimage

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.matching.two_scans import inverse_of
from palpate.imaging.propagation.compared_scans import DrawnScan, moved_mask
from palpate.imaging.propagation.motion_prior import SurfacePoints
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.propagation.propagate import Propagation, propagation
from palpate.imaging.volume import Volume

SHAPE, STEP = (56, 60, 44), 2.0
MIDDLE, RADIUS = np.array([56.0, 50.0, 44.0]), 16.0
TUBE, BORE, PUSHED = np.array([56.0, 84.0]), 11.0, 4.0
# Fewer windows than usual suffice here; of 900 it hangs on which are drawn how much of an error is left.
OPTIONS = PropagationOptions(most_windows=3000, asked_windows=300)


def _places() -> FloatArray:
    return np.moveaxis(STEP * np.indices(SHAPE, dtype=float), 0, -1)


def _volume(array: np.ndarray) -> Volume:
    return Volume(array, np.diag([STEP, STEP, STEP, 1.0]))


def _ball(places: FloatArray) -> np.ndarray:
    return np.asarray(np.linalg.norm(places - MIDDLE, axis=-1) < RADIUS)


def _tube(places: FloatArray) -> np.ndarray:
    return np.asarray(np.linalg.norm(places[..., :2] - TUBE, axis=-1) < BORE)


def _back(points: FloatArray) -> FloatArray:
    """Where points of the second scan come from: the tube and what lies about it has moved by PUSHED towards +y."""
    away = np.linalg.norm(points[:, :2] - TUBE, axis=1)
    return np.column_stack([0.0 * away, -PUSHED * np.exp(-0.5 * (away / 22.0) ** 2), 0.0 * away])


def _forth(points: FloatArray) -> FloatArray:
    return inverse_of(_back, points)


@cache
def _texture() -> np.ndarray:
    """Fat lobules of some millimetres; the right side is muscle, which is even."""
    lumps = ndimage.gaussian_filter(np.random.default_rng(4).standard_normal(SHAPE), 1.3)
    fat = np.clip(-60.0 + 45.0 * lumps / lumps.std(), -120.0, 60.0)
    return np.asarray(np.where(_places()[..., 0] < 40.0, 45.0, fat))


def _scan(contents_seed: int, noise_seed: int, moved: bool) -> Volume:
    places = _places().reshape(-1, 3)
    source = places + _back(places) if moved else places
    index = (source / STEP).T
    hu = ndimage.map_coordinates(_texture(), index, order=1, mode="nearest")
    hu = np.where(_ball(source), 40.0, hu)
    stool = ndimage.gaussian_filter(np.random.default_rng(contents_seed).standard_normal(SHAPE), 2.0)
    stool = 100.0 * stool.ravel() / stool.std()
    depth = BORE - np.linalg.norm(source[:, :2] - TUBE, axis=1)
    hu = np.where(depth > 3.0, stool, np.where(depth > 0.0, 45.0, hu)).reshape(SHAPE)
    noise = 8.0 * np.random.default_rng(noise_seed).standard_normal(SHAPE)
    return _volume((ndimage.gaussian_filter(hu, 0.4) + noise).astype(np.float32))


def _organs() -> dict[str, Volume]:
    return {"prostate": _volume(_ball(_places())), "rectum": _volume(_tube(_places()))}


def _surfaces() -> dict[str, SurfacePoints]:
    turn = np.pi * (1.0 + 5.0**0.5) * np.arange(300)
    height = 1.0 - 2.0 * (np.arange(300) + 0.5) / 300
    ring = np.sqrt(1.0 - height**2)
    normal = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
    angle, z = (g.ravel() for g in np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 24, False), np.arange(10.0, 80.0, 3.0)))
    out = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * z])
    wall = np.column_stack([TUBE + BORE * out[:, :2], z])
    return {"prostate": SurfacePoints(MIDDLE + RADIUS * normal, normal), "rectum": SurfacePoints(wall, out)}


@cache
def _carried() -> Propagation:
    found = propagation(DrawnScan(_scan(1, 2, False), _organs()), _scan(5, 6, True), _surfaces(), OPTIONS)
    assert found is not None
    return found


@pytest.mark.parametrize("name", ["prostate", "rectum"])
def test_surfaces_go_where_the_tissue_went_and_err_as_stated(name: str) -> None:
    surface = _surfaces()[name]
    true = np.einsum("na,na->n", _forth(surface.points), surface.normals)
    found = _carried()
    error = np.einsum("na,na->n", found.motion.at(surface.points), surface.normals) - true
    stated = found.motion.error(surface.points, surface.normals)
    assert np.sqrt((true**2).mean()) > 1.0, "there is something to be found"
    assert np.sqrt((error**2).mean()) < 0.5 * np.sqrt((true**2).mean())
    assert 0.3 < np.sqrt(((error / stated) ** 2).mean()) < 1.5


def test_the_error_is_larger_where_the_image_shows_nothing() -> None:
    beside = MIDDLE[None] + np.array([[-22.0, 0.0, 0.0], [22.0, 0.0, 0.0]])
    for direction in np.eye(3)[1:]:
        muscle, fat = _carried().motion.error(beside, np.tile(direction, (2, 1)))
        assert muscle > 1.4 * fat > 0.0


def test_labels_follow_the_motion() -> None:
    other = _scan(5, 6, True)
    places = other.to_lps(np.argwhere(np.ones(SHAPE, dtype=bool)).astype(float))
    true = _tube(places + _back(places)).reshape(SHAPE)
    drawn = _organs()["rectum"]
    got = moved_mask(drawn, _carried().field.at, other)
    inside = np.zeros(SHAPE, dtype=bool)
    inside[:, :, 5:-5] = True

    def dice(a: np.ndarray) -> float:
        return float(2.0 * (a & true & inside).sum() / ((a & inside).sum() + (true & inside).sum()))

    assert dice(drawn.array) < 0.85 < 0.93 < dice(got)


def test_nothing_is_carried_over_to_another_body() -> None:
    drawn, other = _scan(1, 2, False), _scan(5, 6, True)
    strange = other.with_array(np.ascontiguousarray(other.array[::-1, ::-1, ::-1]))
    assert propagation(DrawnScan(drawn, _organs()), strange, _surfaces(), OPTIONS) is None
    assert _carried().alike > 0.8


def test_scans_that_do_not_overlap_are_refused() -> None:
    far = np.eye(4)
    far[0, 3] = 1000.0
    with pytest.raises(InputError, match="do not overlap"):
        propagation(DrawnScan(_scan(1, 2, False), _organs()), _scan(5, 6, True).moved(far), _surfaces(), OPTIONS)
    empty = {"prostate": _volume(np.zeros(SHAPE, dtype=bool))}
    with pytest.raises(InputError, match="no contour"):
        propagation(DrawnScan(_scan(1, 2, False), empty), _scan(5, 6, True), _surfaces(), OPTIONS)
