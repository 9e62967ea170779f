"""What of the scene the program is given: the DICOM files of a volume, and a segmentation as a file."""

from __future__ import annotations

import shutil
from pathlib import Path

from .errors import InputError
from .mrml import MrmlDatabase, MrmlNode, MrmlScene


def dicom_folder(volume: MrmlNode, database: MrmlDatabase, folder: Path) -> Path:
    """The DICOM files that a volume node was loaded from, copied into a folder of their own.

    volume : a node that Slicer's DICOM module loaded, with the UIDs of its instances. database : of Slicer.
    Raises InputError where it was loaded in another way, or a file has gone.
    """
    uids = (volume.GetAttribute("DICOM.instanceUIDs") or "").split()
    if not uids:
        raise InputError(
            f"{volume.GetName()} was not loaded by the DICOM module; choose the folder of its slices instead."
        )
    folder.mkdir(parents=True, exist_ok=True)
    for number, uid in enumerate(uids):
        path = Path(database.fileForInstance(uid) or "")
        if not path.is_file():
            raise InputError(
                f"A slice of {volume.GetName()} is no longer in Slicer's DICOM database; import it there again."
            )
        shutil.copyfile(path, folder / f"{number:05d}.dcm")
    return folder


def segmentation_file(scene: MrmlScene, segmentation: MrmlNode, path: Path) -> Path:
    """A segmentation node as a .seg.nrrd with names. Raises InputError where it is empty or cannot be written."""
    if segmentation.GetSegmentation().GetNumberOfSegments() == 0:
        raise InputError(f"{segmentation.GetName()} has no segment; draw one or choose another segmentation.")
    path.parent.mkdir(parents=True, exist_ok=True)
    storage = scene.AddNewNodeByClass("vtkMRMLSegmentationStorageNode")
    storage.SetFileName(str(path))
    written = storage.WriteData(segmentation)
    scene.RemoveNode(storage)
    if not written:
        raise InputError(f"{segmentation.GetName()} cannot be written to {path.parent}; is the disc full?")
    return path
