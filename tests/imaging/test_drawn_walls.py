"""Drawn walls carried over by what images and contours say together, on a block whose wall's motion is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_case

from palpate.core.arrays import FloatArray
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.imaging.propagation.displacements import Displacements
from palpate.imaging.propagation.drawn_walls import with_carried_walls
from palpate.imaging.propagation.window_motions import along_axes

DEPTH, STATED_MM = 4.0, 1.4


def _off(surface: Surface) -> Surface:
    """The contour with an error of 1.4 mm rms along y, over some 15 mm."""
    x, _, z = surface.points.T
    error = 2.0 * np.cos(x / 9.0 + 0.5) * np.cos(z / 11.0 - 0.4)
    return replace(surface, points=surface.points + np.column_stack([0.0 * x, error, 0.0 * z]))


def _case(off: bool, stated_mm: float) -> IdentificationProblem:
    whole = synthetic_case.problem(depth=DEPTH)
    drawn = whole.walls["rectum"]
    pair = SurfacePair(drawn.rest, _off(drawn.deformed) if off else drawn.deformed)
    points = _windows()
    matched = replace(
        synthetic_case.matched(),
        points=points,
        moved=synthetic_case.moved(points, depth=DEPTH),
        precision=np.tile(np.eye(3) / synthetic_case.MATCHED_SD_MM**2, (len(points), 1, 1)),
    )
    facts = replace(whole.facts, noise_sd_mm=stated_mm)
    return replace(whole, walls={"rectum": pair}, matched=matched, facts=facts)


def _windows() -> FloatArray:
    axis, depth = np.arange(-13.0, 13.5, 5.0), np.array([-2.0, 4.0, 9.0, 12.0])
    return np.stack(np.meshgrid(axis, depth, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def _error(pair: SurfacePair) -> tuple[FloatArray, FloatArray]:
    """Of the deformed wall along y, where the mesh has it, and what is stated of it."""
    x, y, z = pair.deformed.points.T
    there = (np.abs(pair.rest.points[:, [0, 2]]) < synthetic_case.HALF - 1.0).all(axis=1)
    off = y - (synthetic_case.HALF - synthetic_case.push(x, z, DEPTH))
    stated = np.full(len(y), np.nan) if pair.deformed.sd_mm is None else pair.deformed.sd_mm
    return off[there], stated[there]


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))


def test_a_wall_goes_as_the_tissue_beside_it_where_its_contour_errs() -> None:
    case = _case(off=True, stated_mm=STATED_MM / np.sqrt(2.0))
    drawn = _rms(_error(case.walls["rectum"])[0])
    off, stated = _error(with_carried_walls(case).walls["rectum"])
    assert drawn > 1.0, "the contour is off"
    assert _rms(off) < 0.6 * drawn
    assert 0.3 < _rms(off / stated) < 1.5


def test_a_good_contour_decides() -> None:
    case = _case(off=False, stated_mm=0.1)
    off, stated = _error(with_carried_walls(case).walls["rectum"])
    assert _rms(off) < 0.15
    assert 0.0 < _rms(stated) < 0.3


def test_a_better_contour_makes_the_wall_surer() -> None:
    alone, both = (
        _rms(_error(with_carried_walls(case).walls["rectum"])[1])
        for case in (_case(off=False, stated_mm=5.0), _case(off=False, stated_mm=0.5))
    )
    assert 0.0 < both < 0.9 * alone


def test_a_carried_wall_errs_as_at_rest_and_by_what_carried_it() -> None:
    pair = with_carried_walls(_case(off=True, stated_mm=1.0)).walls["rectum"]
    assert pair.carried_to == "deformed"
    assert pair.common_share == 0.0
    assert pair.rest.voxel_errors is None
    assert pair.deformed.sd_mm is not None
    assert len(pair.deformed.sd_mm) == len(pair.rest.points) == len(pair.deformed.points)


def test_walls_stay_where_no_image_tells_a_motion() -> None:
    case = _case(off=True, stated_mm=1.0)
    assert case.matched is not None
    for other in (replace(case, matched=None), replace(case, matched=replace(case.matched, alike=0.3))):
        assert with_carried_walls(other) is other


def test_the_contour_decides_where_no_window_is_near() -> None:
    case = _case(off=False, stated_mm=0.1)
    assert case.matched is not None
    far = replace(case.matched, points=case.matched.points + 500.0)
    off, stated = _error(with_carried_walls(replace(case, matched=far)).walls["rectum"])
    assert _rms(off) < 0.25
    assert np.isfinite(stated).all()


def test_a_wall_that_images_alone_carried_over_stays() -> None:
    case = _case(off=True, stated_mm=1.0)
    carried = replace(case.walls["rectum"], carried_to="deformed")
    assert with_carried_walls(replace(case, walls={"rectum": carried})).walls["rectum"] is carried


def _stated(case: IdentificationProblem) -> float:
    return _rms(_error(with_carried_walls(case).walls["rectum"])[1])


def test_voxels_of_the_labels_make_a_wall_less_sure() -> None:
    case = _case(off=False, stated_mm=0.1)
    pair = case.walls["rectum"]
    draws = np.random.default_rng(3).normal(0.0, 1.5, (24, len(pair.deformed.points)))
    coarse = replace(pair, deformed=replace(pair.deformed, voxel_errors=draws))
    assert _stated(replace(case, walls={"rectum": coarse})) > 1.1 * _stated(case)


def test_wide_windows_tell_less_of_tissue_that_strains() -> None:
    case = _case(off=False, stated_mm=1.0)
    assert case.matched is not None
    wide = replace(case.matched, correlation_mm=20.0)
    assert _stated(replace(case, matched=wide)) > 1.1 * _stated(case)
    told = along_axes(np.zeros((1, 3)), np.ones((1, 3)), np.diag([4.0, 16.0, 0.5])[None], strained_mm=0.3)
    assert np.allclose(told.variance_mm2, [0.25 + 0.09, 0.0625 + 0.09]), "a direction of less than 1 mm is told"


@pytest.mark.parametrize("count", [0, 1, 3])
def test_displacements_keep_the_errors_that_go_together(count: int) -> None:
    rng = np.random.default_rng(2)
    own = Displacements(rng.random((5, 3)), rng.random((5, 3)), rng.random(5), np.arange(5.0))
    shared = np.array([[2.0, 0.5], [0.5, 3.0]])
    both = own.joined(Displacements(np.ones((2, 3)), np.ones((2, 3)), np.ones(2), np.array([0.1, 0.2]), shared))
    few = both.at_most(count)
    assert len(few.points) == count + 2
    assert np.array_equal(few.covariance[count:, count:], shared + np.diag([0.1, 0.2]))
    assert np.array_equal(both.chosen(np.arange(7) != 5).covariance, np.diag([0.0, 1.0, 2.0, 3.0, 4.0, 3.2]))
