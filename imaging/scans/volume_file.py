"""A CT in a volume file: NIfTI, NRRD or MetaImage, which name no patient, no images and no frame of reference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import SimpleITK as sitk

from palpate.core.arrays import NumberArray
from palpate.core.errors import InputError
from palpate.imaging.contours.metaimage import METAIMAGE, read_metaimage, voxel_files
from palpate.imaging.contours.nifti_labels import NIFTI, WHOLE_WITHIN, read_nifti
from palpate.imaging.contours.nrrd import read_nrrd
from palpate.imaging.dicom.hounsfield import check_hounsfield, refuse_other_scales, soft_tissue_note
from palpate.imaging.dicom.padding import fill_around_discs, padding_note
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.dicom.stack import MIN_SLICES
from palpate.imaging.grid import in_lps_order
from palpate.imaging.volume import Volume

SUFFIXES = (*NIFTI, ".nrrd", *METAIMAGE)
WORDS = "NIfTI, NRRD or MetaImage (.nii, .nii.gz, .nrrd, .mha, .mhd)"
# A label volume has fewer numbers than this, a CT more.
_MOST_LABELS = 200
_MOST_VALUES = 1_000_000
# What a MetaImage may say that it shows.
_CT_KINDS = ("", "MET_MOD_CT", "MET_MOD_UNKNOWN", "MET_MOD_OTHER")
_INT16 = np.iinfo(np.int16)


def is_volume_file(path: Path) -> bool:
    """Whether the name is that of a volume file; a segmentation of 3D Slicer (.seg.nrrd) is none."""
    name = path.name.lower()
    return name.endswith(SUFFIXES) and not name.endswith(".seg.nrrd")


def holds_labels(path: Path) -> bool:
    """Whether a volume file holds few numbers, whole and from 0 on: labels, not HU. Raises InputError as `read_volume_file`."""
    array = _read(path)[0].array
    if array.min() < 0.0 or np.abs(array - np.rint(array)).max() > WHOLE_WITHIN:
        return False
    return len(np.unique(array.reshape(-1)[:: max(1, array.size // _MOST_VALUES)])) <= _MOST_LABELS


def files_of_volume(path: Path) -> list[Path]:
    """The files that are read with a volume file. Raises InputError where its voxels are not there."""
    return voxel_files(path)


def read_volume_file(path: Path) -> tuple[Volume, SeriesFacts]:
    """The volume (HU, int16 or float32, axes in LPS order) and the facts of a CT in a volume file, blank where it has none.

    Raises InputError naming the file when it is unreadable, no regular volume with a place in the patient, or no CT in HU.
    """
    volume, notes = _read(path, only_ct=True)
    if volume.array.ndim != 3 or min(volume.array.shape) < MIN_SLICES:
        raise InputError(f"{path} has shape {volume.array.shape}; a CT of one volume is needed")
    if volume.array.dtype.kind not in "iuf" or not np.isfinite(volume.array).all():
        raise InputError(f"{path} holds voxels that are no finite numbers; save it again")
    volume = in_lps_order(volume.with_array(_hounsfield_type(volume.array)))
    refuse_other_scales(volume, path)
    volume, padding = _padding_as_air(volume)
    check_hounsfield(volume, path)
    notes += [
        *padding,
        *soft_tissue_note(volume),
        "it is no DICOM: patient, date and position on the table are unknown and were not checked; DICOM exports need DICOM scans",
    ]
    facts = SeriesFacts("", "", None, None, None, "CT", "", ("",), (0,), (path,), False, tuple(notes))
    return volume, facts


def write_volume_file(path: Path, volume: Volume) -> None:
    """Writes a CT as NRRD, without what the header of another file said of a person."""
    sitk.WriteImage(volume.to_sitk(), str(path), useCompression=True, imageIO="NrrdImageIO")


def _read(path: Path, only_ct: bool = False) -> tuple[Volume, list[str]]:
    if path.name.lower().endswith(NIFTI):
        return read_nifti(path), []
    if path.name.lower().endswith(METAIMAGE):
        meta = read_metaimage(path)
        if only_ct and meta.modality not in _CT_KINDS:
            raise InputError(f"{path} is no CT: its Modality is {meta.modality[:20]}; give a CT in HU")
        return Volume(meta.array, meta.affine), []
    found = read_nrrd(path)
    return Volume(np.transpose(sitk.GetArrayFromImage(found.image)), found.affine), list(found.notes)


def _padding_as_air(volume: Volume) -> tuple[Volume, list[str]]:
    """What lies around a round field of view, slice by slice, and the note of it."""
    array = volume.array.copy()
    filled = fill_around_discs(np.moveaxis(array, 2, 0))
    return (volume.with_array(array), [padding_note(filled)]) if filled else (volume, [])


def _hounsfield_type(array: NumberArray) -> NumberArray:
    """int16 where the values are whole and fit, else float32, as of DICOM."""
    if _INT16.min <= array.min() and array.max() <= _INT16.max and not (array - np.rint(array)).any():
        return array.astype(np.int16)
    return array.astype(np.float32)
