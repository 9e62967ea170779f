"""Contours as masks: closed-form areas and places, and the real structure sets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dicom_samples import save, series, straight, structure_set

from palpate.core.errors import InputError
from palpate.imaging.contours.contours import contours_to_mask
from palpate.imaging.contours.rtstruct import read_rtstruct
from palpate.imaging.dicom.series import read_series
from palpate.imaging.volume import Volume

GRID = Volume(np.zeros((60, 50, 12), dtype=np.int16), np.diag([1.0, 1.4, 3.0, 1.0]))
GRID.affine[:3, 3] = [-20.0, 5.0, 100.0]
CENTRE = np.array([9.3, 41.7])


def ring(z: float, radius: float, centre: np.ndarray = CENTRE, points: int = 400) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, points, endpoint=False)
    return np.stack(
        [centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle), np.full(points, z)], axis=1
    )


def cc(mask: np.ndarray) -> float:
    return float(mask.sum() * np.prod(GRID.spacing)) / 1000


def middle(mask: np.ndarray) -> np.ndarray:
    return GRID.to_lps(np.argwhere(mask).astype(float)).mean(axis=0)


def test_a_cylinder_has_its_volume_and_its_place() -> None:
    mask = contours_to_mask([ring(z, 14.0) for z in (106.0, 109.0, 112.0)], GRID, "x", [])
    assert cc(mask) == pytest.approx(np.pi * 14**2 * 9 / 1000, rel=0.01)
    assert middle(mask)[2] == pytest.approx(109.0)


def test_circles_anywhere_keep_their_area_and_place_on_average() -> None:
    """One circle is some 0.1 mm off by chance; half a voxel of bias would show as 0.5 to 0.7 mm in the mean of many."""
    errors, areas = [], []
    for offset in np.random.default_rng(5).uniform(-3.0, 3.0, (60, 2)):
        mask = contours_to_mask([ring(106.0, 9.0, CENTRE + offset)], GRID, "x", [])
        errors.append(middle(mask)[:2] - CENTRE - offset)
        areas.append(mask.sum() * 1.4)
    np.testing.assert_allclose(np.mean(errors, axis=0), 0.0, atol=0.04)
    assert np.mean(areas) == pytest.approx(np.pi * 81, rel=0.004)


def test_an_outline_through_voxel_centres_gains_nothing() -> None:
    """A box of 20 x 21 mm whose edges run through centres: half a voxel each way would be 23 x 24 %."""
    low, high = GRID.to_lps(np.array([[10.0, 10.0, 2.0], [30.0, 25.0, 2.0]]))
    box = np.array(
        [[low[0], low[1], 106.0], [high[0], low[1], 106.0], [high[0], high[1], 106.0], [low[0], high[1], 106.0]]
    )
    mask = contours_to_mask([box], GRID, "x", [])
    assert mask.sum() == 20 * 15


def test_a_ring_in_a_ring_is_a_hole_and_two_rings_are_two_parts() -> None:
    hole = contours_to_mask([ring(106.0, 14.0), ring(106.0, 6.0)], GRID, "x", [])
    assert cc(hole) == pytest.approx(np.pi * (14**2 - 6**2) * 3 / 1000, rel=0.01)
    parts = contours_to_mask([ring(106.0, 6.0), ring(106.0, 5.0, CENTRE + [20, 5])], GRID, "x", [])
    assert cc(parts) == pytest.approx(np.pi * (6**2 + 5**2) * 3 / 1000, rel=0.03)


def test_coarser_contours_are_interpolated() -> None:
    """A cone drawn on every third slice: 9 mm apart, ends reaching out by half a gap."""
    notes: list[str] = []
    mask = contours_to_mask([ring(103.0, 6.0), ring(112.0, 12.0), ring(121.0, 18.0)], GRID, "x", notes)
    areas = mask.sum(axis=(0, 1)) * 1.4
    np.testing.assert_allclose(np.sqrt(areas[1:8] / np.pi), [6, 8, 10, 12, 14, 16, 18], atol=0.35)
    assert notes == [] and areas[0] > 0 and areas[8] > 0 and areas[9] == 0


def test_contours_between_slices_count_too() -> None:
    mask = contours_to_mask([ring(104.5 + 3.0 * k, 10.0) for k in range(4)], GRID, "x", [])
    assert mask.any(axis=(0, 1)).sum() == 3


def test_interrupted_contours_are_bridged_with_a_note_or_refused() -> None:
    notes: list[str] = []
    mask = contours_to_mask([ring(z, 10.0) for z in (103.0, 106.0, 112.0, 115.0)], GRID, "Rectum", notes)
    assert mask[:, :, 1:6].any(axis=(0, 1)).all() and "interrupted in 1 places" in notes[0]
    with pytest.raises(InputError, match="structure Rectum are interrupted for 15 mm"):
        contours_to_mask([ring(z, 10.0) for z in (103.0, 106.0, 109.0, 124.0)], GRID, "Rectum", [])


def test_contours_elsewhere_are_refused() -> None:
    tilted = ring(106.0, 10.0)
    tilted[:, 2] += tilted[:, 0]
    with pytest.raises(InputError, match="not parallel to the CT's slices"):
        contours_to_mask([tilted], GRID, "x", [])
    with pytest.raises(InputError, match="lies outside the CT"):
        contours_to_mask([ring(500.0, 10.0)], GRID, "x", [])
    with pytest.raises(InputError, match="holds no voxel of the CT"):
        contours_to_mask([ring(106.0, 10.0, CENTRE + 900)], GRID, "x", [])


def test_structures_of_a_series(tmp_path: Path) -> None:
    ct, facts = read_series(save(tmp_path / "ct", series(straight())))
    centre = np.array([2.0, 12.0])
    prostate = [ring(z, 8.0, centre) for z in (8.0, 11.0, 14.0)]
    bladder = [ring(z, 8.0, centre) for z in (14.0, 17.0)]
    structure_set({"Prostata": prostate, "Vescica": bladder, "PTV": prostate}).save_as(tmp_path / "rs.dcm")
    found = read_rtstruct(tmp_path / "rs.dcm", ct, facts)
    assert set(found.masks) == {"prostate", "bladder"} and not found.prostate_is_split
    # The prostate wins where both were drawn.
    assert (np.unique(found.labels(ct).array[:, :, 3]) == [0, 1]).all()
    assert (np.unique(found.labels(ct).array[:, :, 4]) == [0, 5]).all()


def test_foreign_and_empty_structure_sets_are_refused(tmp_path: Path) -> None:
    ct, facts = read_series(save(tmp_path / "ct", series(straight())))
    rings = [ring(11.0, 8.0, np.array([2.0, 12.0]))]
    structure_set({"Prostata": rings}, "9.9.9").save_as(tmp_path / "foreign.dcm")
    with pytest.raises(InputError, match="drawn on another scan"):
        read_rtstruct(tmp_path / "foreign.dcm", ct, facts)
    structure_set({"Leber": rings}).save_as(tmp_path / "other.dcm")
    with pytest.raises(InputError, match="holds no organ by name, only Leber; name them with --roi"):
        read_rtstruct(tmp_path / "other.dcm", ct, facts)
    assert "prostate" in read_rtstruct(tmp_path / "other.dcm", ct, facts, {"prostate": ["Leber"]}).masks
    with pytest.raises(InputError, match="holds no contours: give an RTSTRUCT"):
        read_rtstruct(next((tmp_path / "ct").iterdir()), ct, facts)


def test_volumes_of_the_small_pelvis(pelvis_small: Path) -> None:
    ct, facts = read_series(pelvis_small / "CT")
    found = read_rtstruct(pelvis_small / "RTstructs.dcm", ct, facts)
    assert found.masks["prostate"].sum() * np.prod(ct.spacing) / 1000 == pytest.approx(68.5, abs=0.1)
    centre = {o: ct.to_lps(np.argwhere(m).astype(float)).mean(axis=0) for o, m in found.masks.items()}
    assert centre["bladder"][2] > centre["prostate"][2] and centre["rectum"][1] > centre["prostate"][1] + 20


def test_the_manual_set_of_pelvis_005_is_chosen(pelvis_005: Path) -> None:
    ct, facts = read_series(pelvis_005)
    found = read_rtstruct(next(pelvis_005.glob("RS*.dcm")), ct, facts)
    assert found.names["prostate"] == ["Prostata"] and found.names["bone"] == ["FemoreSinistro", "FemoreDestro"]
    assert found.masks["prostate"].sum() * np.prod(ct.spacing) / 1000 == pytest.approx(50.9, abs=0.1)
    assert any("not used: Prostate_MBS, Prostate_DL" in note for note in found.notes)
