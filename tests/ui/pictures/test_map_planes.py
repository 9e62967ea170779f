"""The map on slices: colours where they belong, hatching where nothing is told."""

from pathlib import Path

import numpy as np
import pytest
from map_arrays import map_arrays
from phantoms import CENTRE, affine, labels

from palpate.ui.pictures import map_planes as module
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.planes import AXIAL


def test_left_is_left_and_what_is_not_told_is_marked() -> None:
    images = CaseImages(labels(affine()), stiffness_kpa={1: 20.0, 2: 60.0})
    window = images.window(AXIAL)
    halves, extent = module._inside(images, AXIAL, window)
    inside = halves > 0
    data = map_arrays(told_left=False)
    G, told = module._on(halves, extent, AXIAL, window, lambda at, half: module.painted(data, at, half))
    across, _ = module.Slice(G, extent).coordinates
    left, right = G[:, across > CENTRE[0] + 8.0], G[:, across < CENTRE[0] - 8.0]
    assert np.nanmedian(left) < 30.0 < 45.0 < np.nanmedian(right)
    assert not told[:, across > CENTRE[0] + 1.0].any()
    assert (told == inside)[:, across < CENTRE[0] - 1.0].all()
    assert np.isnan(G[~inside]).all()


def test_figure_has_both_rows_and_both_bars(tmp_path: Path) -> None:
    images = CaseImages(labels(affine()), stiffness_kpa={1: 20.0, 2: 60.0})
    figure = module.map_planes(images, map_arrays(told_left=True))
    titles = [ax.get_title() for ax in figure.axes[:3]]
    assert [t.split("\n")[0] for t in titles] == ["axial", "sagittal", "coronal"]
    bars = [ax.get_ylabel() for ax in figure.axes[6:]]
    assert bars == ["shear modulus G (kPa)", "known to a factor of (1 sd)"]
    assert figure.axes[6].get_ylim() == pytest.approx((5.0, 200.0)), "the scale of the halves beside it"
