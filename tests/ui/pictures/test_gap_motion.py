"""The residual motion on the slices: its arrows and their colours."""

from __future__ import annotations

import numpy as np
from matplotlib.quiver import Quiver
from phantoms import affine, labels

from palpate.ui.pictures.gap_pictures import motion_planes
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.planes import PLANES


def test_arrows_are_the_mean_residual_of_their_square_and_coloured_by_its_size() -> None:
    shown = CaseImages(labels(affine()))
    windows = [shown.window(plane) for plane in PLANES]
    places = np.concatenate([np.tile(np.array(window.centre, dtype=float), (4, 1)) for window in windows])
    missed = np.tile([1.0, -2.0, 0.5], (len(places), 1))
    maps = {"motion/places": places, "motion/residual_mm": missed, "motion/standardised": missed / 0.5}
    axes = motion_planes(shown, maps).axes[:3]
    for plane, ax in zip(PLANES, axes, strict=True):
        (arrows,) = [found for found in ax.collections if isinstance(found, Quiver)]
        np.testing.assert_allclose(arrows.U, missed[0, plane.across])
        np.testing.assert_allclose(arrows.V, missed[0, plane.down])
        np.testing.assert_allclose(arrows.get_array(), np.sqrt((4.0 + 16.0 + 1.0) / 3.0))


def test_points_away_from_a_slice_are_not_on_it() -> None:
    shown = CaseImages(labels(affine()))
    far = np.full((3, 3), 1000.0)
    axes = motion_planes(shown, {f"motion/{key}": far for key in ("places", "residual_mm", "standardised")}).axes[:3]
    assert not any(isinstance(found, Quiver) for ax in axes for found in ax.collections)
