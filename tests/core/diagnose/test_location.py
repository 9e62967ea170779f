"""Where a gap lies, on arrays: residuals on the organ, matched motion, the smallest forces that close it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from organ_case import MESH, RADIUS, organ_case

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection import location
from palpate.core.diagnose.detection.location import (
    DiscrepancyMaps,
    MotionGap,
    _blur,
    _peak,
    discrepancy_maps,
    regions,
    residuals,
)
from palpate.core.observe.motion_rows import motion_in_mm
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.residual.unknown_field import ForceFields, UnknownDiscrepancy

RULES = DecisionRules()
# Amplitudes (3,) of the forces that are missing: of one load near the organ's right, along each axis.
MISSING = np.array([1.5, -0.5, 2.0])
LOAD_AT = np.array([9.0, 0.0, 0.0])


def forces(fit: PlainFit, size: float = 20.0) -> UnknownDiscrepancy:
    """A smooth load along each axis near LOAD_AT, which changes every datum by about `size`."""
    rng = np.random.default_rng(8)
    near = np.exp(-0.5 * (np.linalg.norm(MESH.points - LOAD_AT, axis=1) / 4.0) ** 2)
    share = rng.uniform(1.0, 3.0, len(MESH.points))
    fields = np.zeros((3, len(MESH.points), 3))
    for axis in range(3):
        fields[axis, :, axis] = near * share
    response = size * rng.standard_normal((fit.model.n, 3))
    return UnknownDiscrepancy((ForceFields(fields, response, np.zeros((fit.model.n, 0)), share),))


def with_residual(fit: PlainFit, r: FloatArray) -> PlainFit:
    fit.linearisation.first.residual[:] = r
    return fit


def test_the_residual_on_the_organ_is_that_of_its_modes_over_their_standard_deviation() -> None:
    fit = organ_case()
    data, r = fit.model.data_vectors[0], fit.linearisation.residual
    maps = discrepancy_maps(fit, forces(fit), RULES)
    along = data.modes @ r[: data.n_modes]
    np.testing.assert_allclose(maps.residual, along)
    np.testing.assert_allclose(residuals(fit)[0], along)
    C = fit.weighting.covariance[: data.n_modes, : data.n_modes]
    np.testing.assert_allclose(maps.standardised, along / np.sqrt(np.diag(data.modes @ C @ data.modes.T)))


def test_an_organ_that_nobody_drew_is_compared_with_where_the_images_put_it(monkeypatch: pytest.MonkeyPatch) -> None:
    fit = organ_case(drawn=False)
    errors = SimpleNamespace(rest=np.full(90, 0.3), deformed=np.full(90, 0.4))
    monkeypatch.setattr(location, "organ_errors", lambda scene, u: errors)
    maps = discrepancy_maps(fit, forces(fit), RULES)
    height = fit.linearisation.first.scene.observation.points[:, 2] / RADIUS
    np.testing.assert_allclose(maps.residual, 0.25 * height)
    np.testing.assert_allclose(maps.standardised, 0.5 * height)


def test_the_forces_that_close_a_gap_are_those_that_are_missing() -> None:
    """The model lacks forces; what it predicts is off by their response, with the other sign."""
    fit = organ_case()
    free = forces(fit)
    fit = with_residual(fit, -free.response @ MISSING)
    maps = discrepancy_maps(fit, free, RULES)
    near = np.exp(-0.5 * (np.linalg.norm(maps.nodes - LOAD_AT, axis=1) / 4.0) ** 2)
    np.testing.assert_allclose(maps.force, near[:, None] * MISSING, atol=0.02)
    assert maps.peak is not None and np.linalg.norm(maps.peak - LOAD_AT) < 3.0
    assert 2.0 < maps.blur_mm < 8.0


def test_the_forces_are_the_smallest_ones_and_what_the_stiffness_does_is_none_of_theirs() -> None:
    fit = organ_case()
    free = forces(fit, 0.3)
    C, J, R, r = (
        fit.weighting.covariance,
        fit.linearisation.in_theta,
        free.response,
        fit.linearisation.residual,
    )
    W = np.linalg.inv(C)
    M = W - W @ J @ np.linalg.solve(J.T @ W @ J, J.T @ W)
    amplitudes = -np.linalg.solve(R.T @ M @ R + np.eye(3), R.T @ M @ r)
    maps = discrepancy_maps(fit, free, RULES)
    near = np.exp(-0.5 * (np.linalg.norm(maps.nodes - LOAD_AT, axis=1) / 4.0) ** 2)
    np.testing.assert_allclose(maps.force, near[:, None] * amplitudes, atol=1e-9)
    only_stiffness = discrepancy_maps(with_residual(fit, J @ [2.0, -1.0]), free, RULES)
    assert np.abs(only_stiffness.force).max(initial=0.0) < 1e-9


def test_the_peak_is_the_middle_of_the_largest_forces_near_the_organ() -> None:
    organ = np.array([[0.0, 0.0, 0.0]])
    nodes = np.array([[1.0, 0, 0], [3.0, 0, 0], [4.0, 0, 0], [-13.0, 0, 0], [40.0, 0, 0]])
    size = np.array(
        [1.0, 0.8, 0.6, 0.9, 50.0]
    )  # the third is too small, the fourth too far from the largest, the last from the organ
    found = _peak(nodes, size, organ, 12.0, RULES)
    assert found == pytest.approx([(1.0 * 1.0 + 0.8 * 3.0) / 1.8, 0.0, 0.0])
    assert _peak(nodes[4:], size[4:], organ, 12.0, RULES) is None
    assert _peak(nodes[:0], size[:0], organ, 12.0, RULES) is None
    assert _peak(nodes, 0.0 * size, organ, 12.0, RULES) is None


def test_a_point_force_blurs_to_the_radius_of_its_image() -> None:
    """One field over three nodes: the image of any force at the peak is the field itself."""
    share = np.array([2.0, 1.0, 4.0])
    density = np.array([1.0, 0.5, 0.25])
    fields = np.zeros((1, 3, 3))
    fields[0, :, 0] = density * share
    nodes = np.array([[0.0, 0, 0], [2.0, 0, 0], [0.0, 5.0, 0]])
    found = _blur(ForceFields(fields, fields[0], fields[0], share), np.eye(1), nodes, np.arange(3), nodes[0])
    weight = share * density**2
    assert found == pytest.approx(np.sqrt((weight * [0.0, 4.0, 25.0]).sum() / weight.sum()))
    assert _blur(ForceFields(fields, fields[0], fields[0], share), np.eye(1), nodes, np.arange(3), None) == 0.0


def test_matched_motion_is_missed_by_what_its_modes_say_in_mm() -> None:
    fit = organ_case()
    data, at = fit.model.data_vectors[0], fit.linearisation.first
    seen = at.scene.observation.motion
    gap = MotionGap.of(fit)
    read = motion_in_mm(seen.rows, seen.reader)
    np.testing.assert_allclose(gap.places, seen.rows.places)
    np.testing.assert_allclose(gap.missed, np.einsum("wam,m->wa", read, at.residual[data.motion]))
    C = fit.weighting.covariance[data.motion, data.motion]
    for w, a in ((0, 0), (3, 2)):
        assert gap.standardised[w, a] == pytest.approx(gap.missed[w, a] / np.sqrt(read[w, a] @ C @ read[w, a]))
    without = MotionGap.of(organ_case(images=False))
    assert without.places.shape == without.missed.shape == without.standardised.shape == (0, 3)


def test_a_region_has_its_rms_and_its_share_of_all_squares() -> None:
    points = np.array([[-1.0, -1, -1], [1.0, -1, 1], [-1.0, 1, 1], [1.0, 1, -1]])
    nothing: Any = np.zeros((0, 3))
    residual = np.array([1.0, 2.0, 0.0, 2.0])
    maps = DiscrepancyMaps(points, points, np.array([1, 1, 2, 2]), residual, residual, nothing, nothing, None, 0.0)
    found = {(row.name, row.side): (row.rms_mm, row.share) for row in regions(maps, {1: "a", 2: "b", 3: "c"})}
    assert found["a", "all"] == pytest.approx((np.sqrt(2.5), 5 / 9))
    assert found["b", "all"] == pytest.approx((np.sqrt(2.0), 4 / 9))
    assert found["c", "all"] == (0.0, 0.0)
    assert found["organ", "right"] == pytest.approx((np.sqrt(0.5), 1 / 9))
    assert found["organ", "left"] == pytest.approx((2.0, 8 / 9))
    assert found["organ", "anterior"] == pytest.approx((np.sqrt(2.5), 5 / 9))
    assert found["organ", "inferior"] == pytest.approx((np.sqrt(2.5), 5 / 9))
    assert found["organ", "superior"] == pytest.approx((np.sqrt(2.0), 4 / 9))
