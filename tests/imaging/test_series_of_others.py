"""CT series as archives and anonymisers hand them out: padding, lost intercepts, acquisitions in one series, removed UIDs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from contour_files import change
from dicom_samples import COLUMNS, ROWS, ct_slice, hounsfield, save, series, straight
from pydicom.dataset import FileDataset
from pydicom.encaps import encapsulate
from pydicom.uid import UID

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.dicom.padding import fill_around_discs
from palpate.imaging.dicom.pair_check import check_pair
from palpate.imaging.dicom.series import read_series
from palpate.imaging.volume import Volume

# A compression that pydicom can write; others with as many digits take its place.
WRITTEN = "1.2.840.10008.1.2.4.201"
ROUND = np.hypot(np.arange(ROWS)[:, None] - 11.5, np.arange(COLUMNS)[None] - 9.5) > 11.0


def body(lps: FloatArray, shift: float = 0.0) -> FloatArray:
    """A body of 40 HU with a little bone in air, HU."""
    x, y, z = np.moveaxis(np.asarray(lps, dtype=float), -1, 0)
    away = np.hypot((x - 3.0) / 9.0, (y - 16.0) / 14.0)
    inside = np.where(np.hypot(x - 3.0 - shift, y - 18.0) < 3.0, 700.0, 40.0 + 0.5 * z + shift)
    return np.where(away < 1.0, inside, -1000.0)


def with_padding(slices: list[FileDataset], value: int, stated: int | None) -> list[FileDataset]:
    """What lies outside the round field of view has one stored value."""
    for each in slices:
        stored = each.pixel_array.copy()
        stored[ROUND] = value
        each.PixelData = stored.astype("<u2").tobytes()
        if stated is not None:
            each.add_new("PixelPaddingValue", "US", stated)
    return slices


@pytest.mark.parametrize(
    ("value", "stated"), [(63536, 63536), (63536, None), (4095, None), (1064, 1064), (1024, None), (0, 0)]
)
def test_padding_is_air(value: int, stated: int | None, tmp_path: Path) -> None:
    folder = save(tmp_path / "ct", with_padding(series(straight(), values=body), value, stated))
    volume, facts = read_series(folder)
    corner = volume.array[0, 0, 0]
    assert corner == (-1024 if value == 0 else -1000) and volume.array.max() == 700
    assert len(facts.notes) == (0 if value == 0 else 1)
    # Tissue of the padding's value stays what it is.
    assert volume.array[10, 6, 0] == round(40.0 + 0.5 * 5.0)


def test_tissue_in_all_corners_is_no_padding() -> None:
    """A scan cut to the body, whose tissue has one value; a disc of another that is small, or not in the middle."""
    y, x = np.mgrid[:60, :50]
    around = {radius: np.hypot(y - 29.5, x - 24.5) > radius for radius in (8.0, 24.0)}
    air = np.hypot(y - 29.5, x - 24.5) < 5.0
    for outside in (around[8.0], np.hypot(y - 25.0, x - 24.5) > 20.0, np.abs(x - 24.5) > 20.0, ~air):
        picture = np.where(air, -1000, np.where(outside, 0, 40))[None]
        assert fill_around_discs(picture) == 0
    pictures = np.repeat(np.where(around[24.0], 0, 40)[None], 3, axis=0)
    pictures[0, 20:23, 20:30] = 0
    assert fill_around_discs(pictures) == 0, "without air in it this is a body in air whose intercept is lost"
    pictures[1, air] = -1000
    assert fill_around_discs(pictures) == 3 and (pictures[:, around[24.0]] == -1000).all()
    assert (pictures[0, 20:23, 20:30] == 0).all(), "the same value within is tissue"


def test_padding_of_a_signed_value_stated_without_a_sign(tmp_path: Path) -> None:
    slices = series(straight(), values=body)
    for each in slices:
        stored = each.pixel_array.astype(np.int16)
        stored[ROUND] = -2000
        each.PixelRepresentation, each.RescaleIntercept = 1, 3000.0
        each.PixelData = (stored - np.where(ROUND, 0, 4024)).astype("<i2").tobytes()
        each.add_new("PixelPaddingValue", "US", 63536)
    volume, _ = read_series(save(tmp_path / "ct", slices))
    assert volume.array[0, 0, 0] == -1000 and volume.array.max() == 700


@pytest.mark.parametrize("intercept", [0.0, 1024.0, -400.0, -2048.0])
def test_a_lost_intercept_is_noticed(intercept: float, tmp_path: Path) -> None:
    slices = series(straight(), values=body)
    change(slices, RescaleIntercept=intercept)
    with pytest.raises(InputError, match="lost: no voxel is air at -1000 HU, the lowest lie at") as refused:
        read_series(save(tmp_path / "lost", slices))
    assert "\n" not in str(refused.value)


def test_an_intercept_lost_on_one_slice_is_noticed(tmp_path: Path) -> None:
    slices = series(straight(), values=body)
    change(slices[2:3], RescaleIntercept=0.0)
    with pytest.raises(InputError, match="slices hold no voxel that is air at -1000 HU"):
        read_series(save(tmp_path / "lost", slices))


def test_a_body_without_air_is_noticed_only_where_it_cannot_be(tmp_path: Path) -> None:
    """Cropped to the inside of a body."""
    tissue = save(tmp_path / "good", series(straight(), values=lambda p: 20.0 + 0.0 * hounsfield(p)))
    assert read_series(tissue)[0].array.max() == 20
    with pytest.raises(InputError, match="the lowest lie at 1044"):
        read_series(save(tmp_path / "lost", series(straight(), values=lambda p: 1044.0 + 0.0 * hounsfield(p))))


def two_acquisitions(**elements: tuple[object, object]) -> list[FileDataset]:
    """Slices of one series, the second half of them half a gap further on."""
    first = series(straight(6))
    second = [
        ct_slice((x, y, z + 1.5), 6 + n, values=lambda p: hounsfield(p) + 9.0)
        for n, (x, y, z) in enumerate(straight(6), 1)
    ]
    for keyword, (one, other) in elements.items():
        change(first, **{keyword: one})
        change(second, **{keyword: other})
    return [*first, *second]


def test_two_acquisitions_in_one_series_are_a_choice(tmp_path: Path) -> None:
    for keyword, values in {
        "AcquisitionNumber": (1, 2),
        "ConvolutionKernel": ("B30f", "B70f"),
        "KVP": (80, 90),
    }.items():
        folder = save(tmp_path / keyword, two_acquisitions(**{keyword: values}))
        with pytest.raises(
            InputError, match=rf"holds 2 series.*1 \(.*{keyword} {values[0]}.*2 \(.*{keyword} {values[1]}"
        ):
            read_series(folder)
        one, other = read_series(folder, "1")[0], read_series(folder, "2")[0]
        assert one.array.shape[2] == other.array.shape[2] == 6 and other.affine[2, 3] == one.affine[2, 3] + 1.5
    with pytest.raises(InputError, match="numbered as two acquisitions that lie in one another"):
        read_series(save(tmp_path / "unsaid", two_acquisitions()))


def test_acquisitions_that_only_follow_each_other_are_one_scan(tmp_path: Path) -> None:
    slices = series(straight(8))
    change(slices[:4], AcquisitionNumber=1)
    change(slices[4:], AcquisitionNumber=2)
    assert read_series(save(tmp_path / "ct", slices))[0].array.shape[2] == 8


def test_lists_of_series_say_what_they_are(tmp_path: Path) -> None:
    axial, other = series(straight()), series(straight(4), series="1.2.3.77")
    change(axial, SeriesDescription="Becken nativ")
    change(other, SeriesDescription="Rossi coronal", ImageType=["DERIVED", "SECONDARY", "MPR"])
    change(other, ImageOrientationPatient=[1, 0, 0, 0, 0, -1])
    scout = series(straight(1), series="1.2.3.99")
    change(scout, ImageType=["ORIGINAL", "PRIMARY", "LOCALIZER"])
    folder = save(tmp_path / "ct", axial)
    save(folder / "b", other)
    save(folder / "c", scout)
    with pytest.raises(InputError, match="holds 2 series") as refused:
        read_series(folder)
    text = str(refused.value)
    assert (
        "6 files of 20 x 24, 'Becken nativ', axial, UID" in text and "4 files of 20 x 24, coronal, derived, UID" in text
    )
    assert "left out: 1 of localizers" in text and "Rossi" not in text


@pytest.mark.parametrize(
    ("elements", "word"),
    [
        ({"ImageType": ["ORIGINAL", "PRIMARY", "LOCALIZER"]}, "localizer"),
        ({"SeriesDescription": "Topogram 0.6"}, "localizer"),
        ({"SeriesDescription": "Surview"}, "survey"),
    ],
)
def test_a_lone_localizer_is_called_one(elements: dict[str, object], word: str, tmp_path: Path) -> None:
    slices = series(straight(1), orientation=(0, 1, 0, 0, 0, -1))
    change(slices, **elements)
    with pytest.raises(InputError, match=rf"holds a localizer \(scout view\) only, no CT volume: .*sagittal, {word}"):
        read_series(save(tmp_path / "ct", slices))


def test_the_last_slice_of_uneven_gaps_is_kept(tmp_path: Path) -> None:
    heights = np.cumsum([0.0, 2, 2, 2, 2, 2, 2, 3, 3, 3])
    volume, facts = read_series(save(tmp_path / "ct", series([(-11.0, -7.0, z) for z in heights])))
    top = volume.to_lps(np.array([[0.0, 0.0, volume.array.shape[2] - 1.0]]))[0]
    assert top[2] == pytest.approx(heights[-1]) and facts.regridded
    np.testing.assert_allclose(volume.array[0, 0, -1], np.rint(hounsfield(top)), atol=1.0)


def pair(folder: Path, **elements: object) -> list:
    found = []
    for name, shift in (("rest", 0.0), ("deformed", 2.0)):
        slices = series(straight(), values=lambda p, s=shift: body(p, s))
        change(slices, **elements)
        found.append(read_series(save(folder / name, slices)))
    return found


LEVELLED = dict.fromkeys(("FrameOfReferenceUID", "SOPInstanceUID", "SeriesInstanceUID", "StudyInstanceUID"), "1.2.3.4")


@pytest.mark.parametrize("elements", [LEVELLED, dict.fromkeys(LEVELLED), dict.fromkeys(LEVELLED, "")])
def test_scans_without_uids_are_told_by_their_voxels(elements: dict[str, object], tmp_path: Path) -> None:
    rest, deformed = pair(tmp_path, **elements)
    assert "UIDs were removed or made alike" in check_pair(rest, deformed)[0]
    again = read_series(tmp_path / "rest")
    with pytest.raises(InputError, match="hold the same scan"):
        check_pair(rest, again)
    copy = save(tmp_path / "copy", series(straight(), values=body))
    with pytest.raises(InputError, match="hold the same voxels under two names"):
        check_pair(rest, read_series(copy))


def test_part_of_a_scan_is_that_scan(tmp_path: Path) -> None:
    """Without UIDs, a slice less is not another scan."""
    rest, _ = pair(tmp_path, SOPInstanceUID=None)
    volume = Volume(rest[0].array[:, :, 1:], rest[0].affine)
    part = read_series(save(tmp_path / "part", series(straight()[1:], values=body)))
    assert np.array_equal(part[0].array, volume.array)
    with pytest.raises(InputError, match="hold the same voxels under two names"):
        check_pair(rest, part)


def test_metal_that_saturates_within_the_body_stays_metal(tmp_path: Path) -> None:
    slices = series(straight(), values=body)
    for each in slices:
        stored = each.pixel_array.astype(np.int16)
        stored[9:12, 5:8] = 32767
        each.PixelRepresentation, each.RescaleIntercept = 1, 0.0
        stored = np.where(stored == 32767, 32767, stored - 1024)
        each.PixelData = stored.astype("<i2").tobytes()
    volume, facts = read_series(save(tmp_path / "ct", slices))
    assert (volume.array[6, 10] == 31000).all() and volume.array[0, 0, 0] == -1000
    assert not any("padding" in note for note in facts.notes)
    assert [note for note in facts.notes if "metal" in note] == [
        f"values above 31000 HU within the body (metal) were set to that limit, on {len(slices)} slices"
    ]


def test_a_slope_off_by_ten_is_noticed(tmp_path: Path) -> None:
    slices = series(straight(), values=lambda p: 0.1 * body(p))
    with pytest.raises(
        InputError, match=r"no voxel is air at -1000 HU, what surrounds the body lies at -100.*RescaleSlope"
    ):
        read_series(save(tmp_path / "ct", slices))


@pytest.mark.parametrize(
    ("gain", "shift", "told"), [(1.0, 0.0, False), (1.0, -250.0, True), (0.8, 0.0, True), (1.0, 200.0, True)]
)
def test_soft_tissue_that_is_off_is_told(gain: float, shift: float, told: bool, tmp_path: Path) -> None:
    def values(lps: FloatArray) -> FloatArray:
        shown = body(lps)
        return np.where(shown > -900.0, (shown + 1000.0) * gain - 1000.0 + shift, shown)

    notes = read_series(save(tmp_path / "ct", series(straight(), values=values)))[1].notes
    assert any("the HU are off: soft tissue lies at" in note for note in notes) == told


@pytest.mark.parametrize("ending", ["111", "112", "299"])
def test_a_compression_that_is_not_known_is_not_called_damage(ending: str, tmp_path: Path) -> None:
    folder = tmp_path / "ct"
    folder.mkdir()
    for number, each in enumerate(series(straight())):
        each.file_meta.TransferSyntaxUID = UID(WRITTEN)
        each.PixelData = encapsulate([bytes(12)])
        each["PixelData"].VR = "OB"
        file = folder / f"{number}.dcm"
        each.save_as(file, implicit_vr=False, little_endian=True)
        file.write_bytes(file.read_bytes().replace(WRITTEN.encode(), f"{WRITTEN[:-3]}{ending}".encode()))
    with pytest.raises(
        InputError, match="this compression is not known here: export the series uncompressed"
    ) as refused:
        read_series(folder)
    assert ("JPEG XL" in str(refused.value)) == (ending != "299")
