"""A reader of labels is one file: it is found by itself, and nothing else names it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from palpate.case.aligned_labels import NOTE, in_own_frame
from palpate.core.errors import InputError
from palpate.imaging.contours import readers
from palpate.imaging.contours.structure_list import list_structures
from palpate.imaging.contours.user_labels import files_of, read_user_labels
from palpate.imaging.volume import Volume

# A form of its own: one line with the box of the prostate, in voxels of a grid of 2 mm that it shares with nobody.
MODULE = """
import numpy as np
from palpate.imaging.contours.label_reader import LabelReader, StructureEntry, UserLabels
from palpate.imaging.volume import Volume

def read(path, ct, facts, roi):
    low, high = map(int, path.read_text().split())
    array = np.zeros((9, 9, 9), dtype=np.uint8)
    array[low:high, low:high, low:high] = 1
    return UserLabels(Volume(array, np.diag([2.0, 2.0, 2.0, 1.0])), "box", False, {"prostate": ["box"]}, ())

def structures(path):
    return [StructureEntry("box", "box", 1.0, "prostate")]

READER = LabelReader("box", "boxes", read, structures, (".box",), holds_voxels=HOLDS,
                     files=lambda path: [path, path.with_suffix(".more")])
"""


@pytest.fixture(params=[True, False])
def holds_voxels(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bool:
    """A reader in a folder of its own, beside those of the program."""
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / f"box_{request.param}.py".lower()).write_text(MODULE.replace("HOLDS", str(request.param)))
    monkeypatch.setattr(readers, "__path__", [*readers.__path__, str(folder)])
    monkeypatch.setattr(readers, "readers", readers.readers.__wrapped__)
    return bool(request.param)


def test_a_new_file_reads_lists_hashes_and_tells_its_frame(holds_voxels: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.box"
    path.write_text("2 5")
    ct = Volume(np.zeros((9, 9, 9), dtype=np.int16), np.diag([2.0, 2.0, 2.0, 1.0]))
    labels = read_user_labels(path, ct)
    assert labels.source == "box" and int(labels.volume.array.sum()) == 27
    assert [entry.organ for entry in list_structures(path)] == ["prostate"]
    assert files_of(path) == [path, tmp_path / "a.more"]
    assert "boxes" in readers.words()


def test_labels_of_a_form_without_a_frame_are_moved_by_their_grid(
    holds_voxels: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("palpate.case.aligned_labels.readers", readers.readers)
    path = tmp_path / "a.box"
    path.write_text("2 5")
    to_rest = np.eye(4)
    to_rest[:3, 3] = [4.5, 0.0, 0.0]
    ct = Volume(np.zeros((9, 9, 9), dtype=np.int16), np.linalg.inv(to_rest) @ np.diag([2.0, 2.0, 2.0, 1.0]))
    own = in_own_frame(read_user_labels(path, ct, placed=False), ct, to_rest)
    assert (NOTE in own.notes) == holds_voxels


def test_every_reader_has_a_way_in_and_words_of_its_own() -> None:
    found = readers.readers().values()
    assert len(found) >= 5 and all(bool(reader.suffixes) != bool(reader.modality) for reader in found)
    assert len({reader.words for reader in found}) == len(found)
    assert all(ending == ending.lower() and ending.startswith(".") for r in found for ending in r.suffixes)


def test_a_file_of_no_reader_is_refused_with_the_forms_there_are(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("no contours at all")
    with pytest.raises(
        InputError, match=r"a\.txt holds no contours: give DICOM SEG, ITK-SNAP workspace, MetaImage, NIfTI"
    ):
        readers.reader_of(tmp_path / "a.txt")
    with pytest.raises(InputError, match=r"b\.txt is not there; give the path of a file with contours"):
        readers.reader_of(tmp_path / "b.txt")
