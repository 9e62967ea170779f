"""The blind check's pelves are anatomy, and its effects are as strong as wanted where a pelvis allows it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import ndimage

from palpate.core.errors import ConvergenceError
from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM
from palpate.validate.blind.recipes import BUILDS, CLOSE_BUILDS
from palpate.validate.blind.simulator.pelvis import Pelvis
from palpate.validate.blind.simulator.strength import Hopeless, TooWeak, strength


@pytest.mark.parametrize("slope", [0.5, 1.0, 2.0])
def test_a_strength_is_found_that_shows_what_is_wanted(slope: float) -> None:
    size = strength(0.8, (0.01, 1000.0), lambda s: 0.05 * s**slope)
    assert 0.05 * size**slope == pytest.approx(0.8, rel=0.3)


def test_where_even_the_strongest_shows_less_it_is_taken() -> None:
    assert strength(3.0, (1.0, 9.0), lambda s: 0.1 * s) == pytest.approx(9.0)
    assert strength(0.001, (1.0, 9.0), lambda s: 0.1 * s) == pytest.approx(1.0)


def test_sizes_without_an_equilibrium_are_too_strong() -> None:
    def shown(size: float) -> float:
        if size > 4.0:
            raise ConvergenceError("folds")
        return 0.1 * size

    assert 2.0 <= strength(2.0, (1.0, 10.0), shown) <= 4.0
    assert 1.0 <= strength(2.0, (1.0, 100.0), shown) <= 4.0
    with pytest.raises(ConvergenceError, match="no strength"):
        strength(2.0, (5.0, 100.0), shown)


def test_a_search_begins_among_the_weak_for_what_is_too_strong_is_found_out_slowly() -> None:
    """A layer around the organ up to 150 times softer, which folds from 6 times on: one attempt fails at most."""
    failed: list[float] = []

    def shown(size: float) -> float:
        if size > 6.0:
            failed.append(size)
            raise ConvergenceError("folds")
        return 0.02 * size

    assert 3.0 <= strength(0.09, (3.0, 150.0), shown) <= 6.0
    assert len(failed) <= 1


def test_what_cannot_show_the_least_says_why() -> None:
    """Too weak at its strongest; next to nothing; only where it folds; and after one look where that is plain."""
    looked: list[float] = []

    def shown(share: float, folds: float = np.inf) -> Callable[[float], float]:
        def of(size: float) -> float:
            looked.append(size)
            if size > folds:
                raise ConvergenceError("folds")
            return share * size

        return of

    with pytest.raises(TooWeak, match=r"0.16 mm are left"):
        strength(2.0, (1.0, 10.0), shown(0.09), least_mm=1.0)
    assert len(looked) == 1
    with pytest.raises(Hopeless):
        strength(2.0, (1.0, 10.0), shown(0.001), least_mm=1.0)
    with pytest.raises(ConvergenceError, match="enough of the hidden effect"):
        strength(2.0, (1.0, 10.0), shown(0.2, folds=3.0), least_mm=1.0)
    assert strength(2.0, (1.0, 10.0), shown(0.2), least_mm=1.0) == pytest.approx(10.0)


@pytest.mark.parametrize("build", range(BUILDS))
def test_a_pelvis_is_anatomy(build: int) -> None:
    """Prostate of 25 to 70 cc in two like halves, bladder above, rectum behind, bone on all sides.

    Walls lie 2 to 8 mm from it, and as far as the plane of fat is thick (8 to 13 mm, a voxel more or less) where there is one.
    """
    least, most = (2.0, 8.0) if build < CLOSE_BUILDS else (6.7, 14.3)
    labels = Pelvis.of(build).model_labels
    values, cc = labels.array, np.prod(labels.spacing) / 1000.0
    left, right = ((values == k).sum() * cc for k in ORGAN_LABELS)
    assert 25.0 < left + right < 70.0
    assert 0.7 < left / right < 1.4
    organ = np.isin(values, ORGAN_LABELS)
    away = ndimage.distance_transform_edt(~organ, sampling=labels.spacing)
    middle = labels.to_lps(np.argwhere(organ).astype(float)).mean(axis=0)
    for label, axis in ((BLADDER, 2), (RECTUM, 1)):
        there = labels.to_lps(np.argwhere(values == label).astype(float)).mean(axis=0)
        assert there[axis] > middle[axis] + 15.0
        assert least < away[values == label].min() < most
    bone = labels.to_lps(np.argwhere(values == BONE).astype(float)) - middle
    assert bone[:, 0].min() < -30.0
    assert bone[:, 0].max() > 30.0
    assert bone[:, 1].min() < -15.0
