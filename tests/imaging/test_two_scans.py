"""Motion between two contoured scans: where points may lie, what is rejected, and a real pair of one lung."""

from __future__ import annotations

import tarfile
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk
from scipy import ndimage
from test_local_matching import noise, texture

from palpate.core.errors import InputError
from palpate.core.matched_motion import REASONS
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.imaging.matching.local_matching import Level, MatchOptions, match
from palpate.imaging.matching.masks import bright_spots, usable_voxels
from palpate.imaging.matching.two_scans import LabelledScan, inverse_of, matched_motion
from palpate.imaging.volume import Volume

SPACING, SHAPE = np.array([1.2, 1.2, 2.5]), (56, 56, 26)
GRID = np.diag([*SPACING, 1.0])
PLACES = np.moveaxis(np.indices(SHAPE), 0, -1) * SPACING
MIDDLE = PLACES.reshape(-1, 3).mean(axis=0)
LUNG = Path(__file__).parents[2].parent / "shared" / "data" / "lung_ct_pair.tar.xz"


def motion(points: np.ndarray) -> np.ndarray:
    near = np.exp(-((points - MIDDLE) ** 2).sum(axis=-1) / (2.0 * 22.0**2))
    return near[..., None] * np.array([1.0, -3.0, 1.5])


def organs(away: np.ndarray) -> Volume:
    """A prostate of 9 mm in the middle and a bladder of 8 mm beside it, both moved."""
    places = PLACES + away
    labels = np.full(SHAPE, SURROUNDING_TISSUE, dtype=np.uint8)
    labels[((places - MIDDLE) ** 2).sum(axis=-1) < 9.0**2] = ORGAN_LABELS[0]
    labels[((places - MIDDLE - [20.0, 0.0, 0.0]) ** 2).sum(axis=-1) < 8.0**2] = BLADDER
    return Volume(labels, GRID)


@pytest.fixture(scope="module")
def scans() -> tuple[LabelledScan, LabelledScan]:
    """The deformed scan holds, where the rest scan has tissue, a lump of another place: it has no counterpart."""
    base = texture(1)
    rest = ndimage.map_coordinates(base, ((PLACES + motion(PLACES)) / SPACING).transpose(3, 0, 1, 2), order=3)
    lump = ((PLACES - MIDDLE - [-16.0, 14.0, 0.0]) ** 2).sum(axis=-1) < 7.0**2
    other = np.where(lump, np.roll(base, (17, 9, 5), axis=(0, 1, 2)), base)
    return (
        LabelledScan(Volume(rest + noise(2, 12.0), GRID), organs(motion(PLACES))),
        LabelledScan(Volume(other + noise(3, 12.0), GRID), organs(np.zeros(3))),
    )


def test_points_lie_near_the_organ_and_not_in_the_bladder_and_hold_what_they_state(
    scans: tuple[LabelledScan, LabelledScan],
) -> None:
    off = np.array([0.6, -0.5, 0.7])
    found = matched_motion(*scans, lambda points: motion(points) + off)
    assert len(found.points) > 40
    bladder = scans[0].labels.with_array((scans[0].labels.array == BLADDER).astype(float))
    assert not (bladder.at(found.points) > 0.5).any()
    error = found.moved - motion(found.points)
    square = np.einsum("ni,nij,nj->n", error, found.precision, error) / 3.0
    assert 0.4 < np.median(square) ** 0.5 < 1.3
    assert (square > 16.0).mean() < 0.05


def test_two_scans_of_other_tissue_are_told_from_two_of_the_same(scans: tuple[LabelledScan, LabelledScan]) -> None:
    rest, deformed = scans
    brighter = LabelledScan(deformed.ct.with_array(1.3 * deformed.ct.array + 20.0), deformed.labels)
    for other in (deformed, brighter):
        found = matched_motion(rest, other, motion)
        assert found.alike > 0.9 and found.is_of_one_body
    for array in (deformed.ct.array[::-1], np.roll(deformed.ct.array, 15, axis=1), np.zeros(SHAPE)):
        elsewhere = LabelledScan(deformed.ct.with_array(np.ascontiguousarray(array)), deformed.labels)
        found = matched_motion(rest, elsewhere, motion)
        assert not found.is_of_one_body, found.alike


def test_what_has_no_counterpart_is_rejected_with_a_reason(scans: tuple[LabelledScan, LabelledScan]) -> None:
    found = matched_motion(*scans, motion)
    lump = MIDDLE + [-16.0, 14.0, 0.0]
    near = np.linalg.norm(found.rejected[:, :3] - lump, axis=1) < 14.0
    assert near.any()
    assert all(REASONS[k] for k in found.rejected_for)


def test_labels_without_an_organ_are_refused(scans: tuple[LabelledScan, LabelledScan]) -> None:
    bare = LabelledScan(scans[0].ct, scans[0].labels.with_array(np.full(SHAPE, SURROUNDING_TISSUE, dtype=np.uint8)))
    with pytest.raises(InputError, match="no prostate"):
        matched_motion(bare, scans[1], np.zeros_like)


def test_gas_bone_and_metal_have_no_counterpart_but_a_marker_in_the_organ_has() -> None:
    labels = organs(np.zeros(3))
    hu = np.full(SHAPE, 30.0)
    marker = tuple((MIDDLE / SPACING).round().astype(int))
    hu[marker] = 1500.0
    hu[4:8, 4:8, 10], hu[4:8, 48:52, 10], hu[48:50, 48:50, 10] = -900.0, 800.0, 3000.0
    ct = Volume(hu, GRID)
    usable = usable_voxels(ct, labels)
    assert usable[marker] and not usable[6, 6, 10] and not usable[6, 50, 10] and not usable[44, 49, 10]
    spots = bright_spots(ct, labels)
    np.testing.assert_allclose(spots, [np.array(marker) * SPACING])


def test_a_motion_is_turned_round() -> None:
    points = MIDDLE + np.random.default_rng(3).uniform(-15.0, 15.0, (30, 3))
    there = points + motion(points)
    np.testing.assert_allclose(there + inverse_of(motion, there), points, atol=1e-3)


def test_scans_without_any_noise_are_matched() -> None:
    """Made-up ones: nothing is left of their difference, so that the noise's correlation cannot be measured."""
    scan = LabelledScan(Volume(np.round(texture(1)), GRID), organs(np.zeros(3)))
    found = matched_motion(scan, scan, lambda points: np.zeros_like(points))
    assert len(found.points) > 40
    assert np.abs(found.moved).max() < 0.02
    assert np.linalg.eigvalsh(found.precision).max() < 1e8  # 1/mm2: rounding to whole HU is left
    assert found.scores is not None
    assert np.linalg.eigvalsh(found.scores.covariance).min() > 0.0


@pytest.mark.nightly
@pytest.mark.skipif(not LUNG.exists(), reason=f"{LUNG} is not there")
def test_a_real_lung_is_matched_to_about_the_rounding_of_its_landmarks(tmp_path: Path) -> None:
    """From a shift alone, 10 landmarks given as whole voxels of 1.4 x 1.4 x 2.5 mm, whose rounding is 1.3 mm rms."""
    with tarfile.open(LUNG) as archive:
        archive.extractall(tmp_path, filter="data")
    folder = tmp_path / "elastix_lung_pair"
    volumes, masks, marks = [], [], []
    for state in ("baseline", "followup"):
        ct = Volume.from_sitk(sitk.ReadImage(str(folder / f"3DCT_lung_{state}.mha")))
        mask = Volume.from_sitk(sitk.ReadImage(str(folder / f"3DCT_lung_{state}_mask.mha")))
        volumes.append(ct.with_array(np.clip(ct.array, -1000, 100).astype(np.float32)))
        masks.append(mask.array > 0)
        marks.append(ct.to_lps(np.loadtxt(folder / f"3DCT_lung_{state}.txt", skiprows=2)))
    ends = [v.to_lps(np.argwhere(m).astype(float)) for v, m in zip(volumes, masks, strict=True)]
    high, low = (np.quantile(e, 0.98, axis=0) for e in ends[::-1]), (np.quantile(e, 0.02, axis=0) for e in ends[::-1])
    (high_2, high_1), (low_2, low_1) = high, low

    def start(points: np.ndarray) -> np.ndarray:
        return (points - low_1) / (high_1 - low_1) * (high_2 - low_2) + low_2 - points

    levels = (Level(6.0, 30.0, 5, 2), Level(4.0, 16.0, 5), Level(2.0, 8.0, 4), Level(0.9, 5.0, 3))
    found = match(volumes[0], volumes[1], (masks[0], masks[1]), start, MatchOptions(levels=levels, full=0.1))
    truth = marks[1] - marks[0]
    before, after = (
        np.linalg.norm(m(marks[0]) - truth, axis=1) for m in (start, lambda x: start(x) + found.beyond.at(x))
    )
    assert np.median(after) < 0.5 * np.median(before)
    assert np.median(after) < 2.0
