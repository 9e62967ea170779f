"""The map on slices: colours where they belong, hatching where nothing is told."""

from pathlib import Path

import numpy as np
from map_arrays import map_arrays
from phantoms import CENTRE, affine, labels, result, write_case

from palpate.core.files.json_types import typed
from palpate.core.identify.result_record import ResultRecord
from palpate.ui.pictures import map_planes as module
from palpate.ui.pictures.colours import map_scale
from palpate.ui.pictures.convergence import convergence
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.planes import AXIAL
from palpate.ui.pictures.slices import stiffness_planes
from palpate.ui.report import figures
from palpate.ui.report.record import CaseRecord


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
    assert map_scale([20.0], map_arrays(told_left=True)).high >= 60.0


def test_a_report_with_a_map_has_one_scale_for_all_its_pictures(tmp_path: Path) -> None:
    """The map reaches 90 kPa where the halves have 20 and 60: without a common scale their pictures would differ."""
    case, found = write_case(tmp_path / "case"), result(20.0, 60.0)
    data = map_arrays(told_left=True) | {"ln_G": np.log([20.0, 90.0])}
    record = CaseRecord(case.facts, typed(found, ResultRecord, "result.json"), {}, {}, {}, {})
    images = figures._images(case, record, {"rest": case.labels("rest")}, data)
    high = [stiffness_planes(images).axes[6].get_ylim()[1], module.map_planes(images, data).axes[6].get_ylim()[1]]
    assert high[0] == high[1] >= 90.0
    assert figures._images(case, record, {"rest": case.labels("rest")}, None).scale.high < 90.0


def test_the_search_is_drawn_as_what_it_is_beside_what_noise_leaves() -> None:
    (axes,) = convergence([900.0, 400.0, 56.0], 60.0).axes
    assert axes.get_ylabel() == "weighted squares,\nleast so far"
    assert any(np.allclose(line.get_ydata(), 60.0) for line in axes.lines)
    assert not any(np.allclose(line.get_ydata(), 60.0) for line in convergence([900.0, 400.0, 56.0]).axes[0].lines)
