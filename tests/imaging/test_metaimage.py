"""MetaImage files: what ITK writes is read as ITK reads it, and what is damaged is refused, by us and silently."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk

from palpate.core.errors import InputError
from palpate.imaging.contours.metaimage import read_metaimage, voxel_files

TURN = (0.0, -1.0, 0.0, 0.6, 0.0, 0.8, -0.8, 0.0, 0.6)


def image(kind: type = np.int16) -> sitk.Image:
    found = sitk.GetImageFromArray(np.arange(4 * 3 * 5).reshape(4, 3, 5).astype(kind))
    found.SetSpacing((1.5, 2.0, 3.0))
    found.SetOrigin((-7.0, 4.0, 11.0))
    found.SetDirection(TURN)
    return found


@pytest.mark.parametrize(
    "kind", [np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.int64, np.float32, float]
)
@pytest.mark.parametrize(("form", "packed"), [("a.mha", True), ("a.mha", False), ("a.mhd", True), ("a.mhd", False)])
def test_as_itk_reads_it(kind: type, form: str, packed: bool, tmp_path: Path) -> None:
    sitk.WriteImage(image(kind), str(tmp_path / form), useCompression=packed)
    found, truth = read_metaimage(tmp_path / form), sitk.ReadImage(str(tmp_path / form))
    np.testing.assert_array_equal(found.array, np.transpose(sitk.GetArrayFromImage(truth)))
    assert found.array.dtype == sitk.GetArrayFromImage(truth).dtype
    for index in ((0, 0, 0), (4, 2, 3), (1, 0, 2)):
        np.testing.assert_allclose(
            (found.affine @ [*index, 1.0])[:3], truth.TransformIndexToPhysicalPoint(index), atol=1e-9
        )
    assert len(voxel_files(tmp_path / form)) == (1 if form == "a.mha" else 2)


def test_the_other_order_of_bytes_and_a_header_that_is_skipped(tmp_path: Path) -> None:
    sitk.WriteImage(image(), str(tmp_path / "a.mhd"))
    text, raw = (tmp_path / "a.mhd").read_text(), tmp_path / "a.raw"
    truth, content = read_metaimage(tmp_path / "a.mhd").array, raw.read_bytes()
    raw.write_bytes(np.frombuffer(content, "<i2").astype(">i2").tobytes())
    (tmp_path / "a.mhd").write_text(text.replace("MSB = False", "MSB = True"))
    np.testing.assert_array_equal(read_metaimage(tmp_path / "a.mhd").array, truth)
    raw.write_bytes(b"x" * 9 + content)
    for size in ("9", "-1"):
        (tmp_path / "a.mhd").write_text(text.replace("DimSize", f"HeaderSize = {size}\nDimSize"))
        np.testing.assert_array_equal(read_metaimage(tmp_path / "a.mhd").array, truth)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("NDims = 3", "NDims = -1", "one 3D volume is needed"),
        ("NDims = 3", "NDims = 4", "one 3D volume is needed"),
        ("DimSize = 5 3 4", "DimSize = 5 3", "one 3D volume is needed"),
        ("DimSize = 5 3 4", "DimSize = 5 -3 4", "its DimSize is no three counts"),
        ("DimSize = 5 3 4", "DimSize = 99999 99999 99999", "which is too many"),
        ("DimSize = 5 3 4", "DimSize = 5 3 5", "ends before its voxels do"),
        ("DimSize = 5 3 4", "DimSize = 5 3 3", "holds more voxels than it says"),
        ("MET_SHORT", "MET_COMPLEX", "its ElementType is not known"),
        ("ElementSpacing = 1.5 2 3", "ElementSpacing = 1.5 x 3", "does not say its elementspacing in 3 numbers"),
        ("ElementSpacing = 1.5 2 3", "ElementSpacing = 0 2 3", "sheared or degenerate"),
        ("Offset = -7 4 11", "Offset = -7 nan 11", "does not say its offset in 3 numbers"),
        ("ObjectType = Image", "ObjectType = Tube", "it is no image in binary numbers"),
        ("BinaryData = True", "BinaryData = False", "it is no image in binary numbers"),
        ("NDims = 3", "NDims = 3\nNDims = 3", "is not a readable MetaImage"),
        ("CompressedData = True", "CompressedData = perhaps", "is neither true nor false"),
        ("ElementType", "ElementNumberOfChannels = 3\nElementType", "more than a number for each voxel"),
    ],
)
def test_what_is_wrong_is_told_by_nobody_else(
    old: str, new: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.mha"
    sitk.WriteImage(image(), str(path), useCompression=True)
    assert old.encode() in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old.encode(), new.encode(), 1))
    with pytest.raises(InputError, match=rf"a\.mha .*{said}") as refused:
        read_metaimage(path)
    assert "\n" not in str(refused.value) and capfd.readouterr() == ("", "")
