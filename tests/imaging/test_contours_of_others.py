"""Contour files as other programs write them, met in public bug reports: names, numbers, layers, contours, references."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import nibabel as nib
import numpy as np
import pydicom
import pytest
from contour_files import (
    SIZES,
    change,
    counts,
    dicom_seg,
    label_names,
    nifti,
    nrrd,
    outlines,
    rectangle,
    rtstruct,
    scan,
)

from palpate.core.errors import InputError
from palpate.imaging.contours.seg_nrrd import read_seg_nrrd
from palpate.imaging.contours.user_labels import read_label_volume, read_user_labels
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

WHOLE = {1: SIZES["prostate"], 5: SIZES["bladder"], 6: SIZES["rectum"]}
PLAIN = {"prostate": "Prostate", "bladder": "Bladder", "rectum": "Rectum"}
GERMAN = {1: "Harnblase", 2: "Rektum", 3: "Prostata"}
NUMBERS = {"bladder": 1, "rectum": 2, "prostate": 3}


@pytest.fixture(scope="module")
def ct(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Volume, SeriesFacts]:
    return scan(tmp_path_factory.mktemp("scan") / "ct")


def test_plain_names_of_segments(ct: tuple, tmp_path: Path) -> None:
    """One segment called as a label of ours does not switch the others off."""
    segmentation = dicom_seg(tmp_path / "s.dcm", ct[0], PLAIN)
    facts = {
        "Segment0_Name": "Prostate", "Segment0_LabelValue": "1", "Segment0_Layer": "0",
        "Segment1_Name": "Bladder", "Segment1_LabelValue": "2", "Segment1_Layer": "0",
        "Segment2_Name": "Rectum", "Segment2_LabelValue": "1", "Segment2_Layer": "1",
    }  # fmt: skip
    shared = nrrd(tmp_path / "s.seg.nrrd", facts, [["prostate", "bladder"], ["rectum"]])
    for path in (segmentation, shared):
        found = read_user_labels(path, *ct[1:])
        assert counts(found.volume) == WHOLE
        assert found.structures == {"prostate": ["Prostate"], "bladder": ["Bladder"], "rectum": ["Rectum"]}


def test_segments_of_slicer_before_layers(ct: tuple, tmp_path: Path) -> None:
    """No LabelValue and no Layer: segment n is layer n."""
    names = {f"Segment{k}_Name": name for k, name in enumerate(PLAIN.values())}
    path = nrrd(tmp_path / "s.seg.nrrd", names, [["prostate"], ["bladder"], ["rectum"]])
    assert counts(read_user_labels(path, *ct[1:]).volume) == WHOLE
    with pytest.raises(InputError, match="names 3 segments without their values, in 2 layers"):
        read_seg_nrrd(nrrd(tmp_path / "two.seg.nrrd", names, [["prostate"], ["bladder"]]))


@pytest.mark.parametrize(
    "names",
    [GERMAN, {1: " bladder ", 2: "RECTUM", 3: "Prostate"}, {1: "urinary_bladder", 2: "RettoAno", 3: "03_Prostata"},
     {1: "bexiga", 2: "reto", 3: unicodedata.normalize("NFD", "pr\u00f3stata")}, {1: "blaas", 2: "endeldarm", 3: "prostaat"},
     {1: "vessie", 2: "Rectum", 3: "prostate"}, {1: "Vejiga", 2: "Recto", 3: "PROSTATA"}],
    ids=["German", "blanks", "numbered", "Portuguese", "Dutch", "French", "Spanish"],
)  # fmt: skip
def test_names_of_a_label_file_go_before_numbers(names: dict[int, str], ct: tuple, tmp_path: Path) -> None:
    path = nifti(tmp_path / "l.nii.gz", NUMBERS)
    label_names(tmp_path, {0: "Clear Label", **names})
    found = read_user_labels(path, *ct[1:])
    assert counts(found.volume) == WHOLE and not found.prostate_is_split
    chosen = read_user_labels(path, *ct[1:], {"prostate": ["3"]})
    assert counts(chosen.volume) == WHOLE


def test_names_within_a_volume(ct: tuple, tmp_path: Path) -> None:
    """As TotalSegmentator writes them; its numbers are its own."""
    path = nifti(tmp_path / "l.nii.gz", {"prostate": 22, "bladder": 21, "rectum": 1})
    image = nib.load(path)
    named = "".join(
        f'<Label Key="{value}" Red="0.1" Green="0.2" Blue="0.3" Alpha="1">{name}</Label>'
        for value, name in {1: "spleen", 21: "urinary_bladder", 22: "prostate", 77: "femur_left"}.items()
    )
    xml = f"<CaretExtension><VolumeInformation><LabelTable>{named}</LabelTable></VolumeInformation></CaretExtension>"
    image.header.extensions.append(nib.nifti1.Nifti1Extension(0, xml.encode()))
    nib.save(image, path)
    found = read_user_labels(path, *ct[1:])
    assert counts(found.volume) == {1: SIZES["prostate"], 5: SIZES["bladder"]} and not found.prostate_is_split
    assert "not used: spleen (1)" in found.notes


def test_unknown_names_are_refused_or_named(ct: tuple, tmp_path: Path) -> None:
    path = nifti(tmp_path / "l.nii.gz", NUMBERS)
    label_names(tmp_path, {1: "virtsarakko", 2: "kuusi", 3: "eturauhanen"})
    with pytest.raises(InputError, match=r"labels\.txt names virtsarakko, kuusi, eturauhanen, none of them an organ"):
        read_user_labels(path, *ct[1:])
    by_name = read_user_labels(path, *ct[1:], {"prostate": ["Eturauhanen"], "bladder": ["1"]})
    assert counts(by_name.volume) == {1: SIZES["prostate"], 5: SIZES["bladder"]}
    assert "not used: kuusi (2)" in by_name.notes


def test_the_hint_quotes_the_files_own_number(ct: tuple, tmp_path: Path) -> None:
    path = nifti(tmp_path / "l.nii.gz", NUMBERS)
    label_names(tmp_path, {1: " bladder ", 2: "RECTUM", 3: "Prostate  left"})
    hint = read_user_labels(path, *ct[1:]).notes[-1]
    assert hint.startswith("label 3 (Prostate  left) is the only one") and hint.endswith("give --roi prostate=3")
    found = read_user_labels(path, *ct[1:], {"prostate": ["3"]})
    assert counts(found.volume) == WHOLE and not found.prostate_is_split and not found.notes


def test_a_chosen_number_takes_no_other_with_it(ct: tuple, tmp_path: Path) -> None:
    """Without names, 1 and 2 are halves of the prostate: not where the caller says that it is 3."""
    found = read_user_labels(nifti(tmp_path / "l.nii.gz", NUMBERS), *ct[1:], {"prostate": ["3"]})
    assert counts(found.volume) == {1: SIZES["prostate"]}
    assert "not used: label 1, label 2" in found.notes


def test_numbers_that_a_slope_has_moved(tmp_path: Path) -> None:
    values = {"prostate": 1, "bladder": 5, "rectum": 6}
    found = read_label_volume(nifti(tmp_path / "l.nii.gz", values, float(np.float32(1.0 / 3.0))))
    assert counts(found.volume) == WHOLE


def test_a_wrong_checksum_is_damage(ct: tuple, tmp_path: Path) -> None:
    volume = nifti(tmp_path / "l.nii.gz", {"prostate": 1})
    segments = nrrd(tmp_path / "s.seg.nrrd", {"Segment0_Name": "prostate", "Segment0_LabelValue": "1"}, [["prostate"]])
    for path in (volume, segments):
        read_user_labels(path, *ct[1:])
        data = bytearray(path.read_bytes())
        data[-6] ^= 4
        path.write_bytes(data)
        with pytest.raises(InputError, match=rf"{path.name} is damaged \(its gzip checksum"):
            read_user_labels(path, *ct[1:])


def test_two_structures_of_one_name_are_two(ct: tuple, tmp_path: Path) -> None:
    path, dataset = rtstruct(tmp_path / "rs.dcm", {"Prostate": outlines("prostate"), "other": outlines("rectum")})
    dataset.StructureSetROISequence[1].ROIName = "Prostate"
    dataset.save_as(path)
    with pytest.raises(InputError, match="several structures for prostate: Prostate #1, Prostate #2; choose one"):
        read_user_labels(path, *ct[1:])
    for choice, organ in (("Prostate #1", "prostate"), ("2", "rectum")):
        found = read_user_labels(path, *ct[1:], {"prostate": [choice]})
        assert counts(found.volume) == {1: SIZES[organ]}


def test_contours_of_one_slice_add_up(ct: tuple, tmp_path: Path) -> None:
    twice = [*outlines("prostate"), rectangle("prostate", 3)[::-1]]
    found = read_user_labels(rtstruct(tmp_path / "twice.dcm", {"Prostate": twice})[0], *ct[1:])
    assert counts(found.volume) == {1: SIZES["prostate"]}
    assert any("has a contour twice on a slice" in note for note in found.notes)
    nearly = [*outlines("prostate"), *(rectangle("prostate", k, grow=-0.02) for k in (2, 3, 4))]
    found = read_user_labels(rtstruct(tmp_path / "nearly.dcm", {"Prostate": nearly})[0], *ct[1:])
    assert counts(found.volume) == {1: SIZES["prostate"]}
    parts = [*outlines("prostate"), *(rectangle("prostate", k, shift=3.0) for k in (2, 3, 4))]
    found = read_user_labels(rtstruct(tmp_path / "parts.dcm", {"Prostate": parts})[0], *ct[1:])
    assert counts(found.volume) == {1: 3 * 6 * (7 + 3)}


@pytest.mark.parametrize("kind", ["CLOSED_PLANAR", "CLOSEDPLANAR_XOR"])
def test_a_wall_drawn_as_two_loops_is_a_ring_or_refused(kind: str, ct: tuple, tmp_path: Path) -> None:
    """A wall of a pixel is a ring; one of 0.6 to 0.8 mm, on pixels of 2 by 1.5 mm, is none."""

    def walled(pixels: float) -> Path:
        loops = [*outlines("prostate"), *(rectangle("prostate", k, grow=-pixels) for k in (2, 3, 4))]
        path, dataset = rtstruct(tmp_path / f"{pixels}.dcm", {"Prostate": loops})
        for contour in dataset.ROIContourSequence[0].ContourSequence:
            contour.ContourGeometricType = kind
        dataset.save_as(path)
        return path

    found = read_user_labels(walled(1.1), *ct[1:])
    assert counts(found.volume) == {1: SIZES["prostate"] - 3 * 4 * 5}
    assert not any("twice" in note for note in found.notes)
    with pytest.raises(InputError, match=r"Prostate has two contours 0\.\d mm apart on a slice, nearer than pixels of"):
        read_user_labels(walled(0.4), *ct[1:])


@pytest.mark.parametrize("kind", ["CLOSED_PLANAR", "CLOSEDPLANAR_XOR"])
def test_a_contour_in_another_is_a_hole(kind: str, ct: tuple, tmp_path: Path) -> None:
    holed = [*outlines("prostate"), *(rectangle("prostate", k, grow=-2.0) for k in (2, 3, 4))]
    path, dataset = rtstruct(tmp_path / "rs.dcm", {"Prostate": holed})
    for contour in dataset.ROIContourSequence[0].ContourSequence:
        contour.ContourGeometricType = kind
    dataset.save_as(path)
    assert counts(read_user_labels(path, *ct[1:]).volume) == {1: SIZES["prostate"] - 3 * 2 * 3}


def test_contours_by_exclusive_or_cut_out_what_they_share(ct: tuple, tmp_path: Path) -> None:
    parts = [*outlines("prostate"), *(rectangle("prostate", k, shift=3.0) for k in (2, 3, 4))]
    path, dataset = rtstruct(tmp_path / "rs.dcm", {"Prostate": parts})
    for contour in dataset.ROIContourSequence[0].ContourSequence:
        contour.ContourGeometricType = "CLOSEDPLANAR_XOR"
    dataset.save_as(path)
    assert counts(read_user_labels(path, *ct[1:]).volume) == {1: 3 * 6 * (3 + 3)}


def test_what_is_left_out_is_named(ct: tuple, tmp_path: Path) -> None:
    drawn = {
        "Prostate": outlines("prostate"),
        "Bladder": outlines("bladder"),
        "Rectum": [],
        "Couch": outlines("rectum"),
    }
    path, dataset = rtstruct(tmp_path / "rs.dcm", drawn)
    dataset.ROIContourSequence[0].ReferencedROINumber = 77
    dataset.save_as(path)
    found = read_user_labels(path, *ct[1:])
    assert counts(found.volume) == {5: SIZES["bladder"]}
    assert "3 contours of the structure number 77, which has no name, were left out" in found.notes
    assert {"structure Prostate has no contours", "structure Rectum has no contours", "not used: Couch"} < set(
        found.notes
    )
    with pytest.raises(InputError, match="structure Rectum has no closed contours"):
        read_user_labels(path, *ct[1:], {"rectum": ["Rectum"]})


def test_a_structure_of_another_frame_of_reference_is_left_out(ct: tuple, tmp_path: Path) -> None:
    """One structure set may hold what was drawn on several scans of a patient."""
    path, dataset = rtstruct(
        tmp_path / "rs.dcm",
        {"Prostate": outlines("prostate"), "Bladder": outlines("bladder"), "Rectum": outlines("rectum")},
    )
    frames = (ct[2].frame_of_reference_uid, "9.9.9", "")
    for item, frame in zip(dataset.StructureSetROISequence, frames, strict=True):
        item.ReferencedFrameOfReferenceUID = frame
    dataset.save_as(path)
    found = read_user_labels(path, *ct[1:])
    assert counts(found.volume) == {1: SIZES["prostate"], 6: SIZES["rectum"]}
    assert "structure Bladder lies in another frame of reference than the CT and was left out" in found.notes


def test_a_misspelt_type_of_contour_is_named(ct: tuple, tmp_path: Path) -> None:
    path, dataset = rtstruct(tmp_path / "rs.dcm", {"Prostate": outlines("prostate")})
    for contour in dataset.ROIContourSequence[0].ContourSequence:
        contour.ContourGeometricType = "CLOSED_PLANAR_XOR"
    dataset.save_as(path)
    with pytest.raises(InputError, match=r"holds no organ.*ContourGeometricType is CLOSED_PLANAR_XOR"):
        read_user_labels(path, *ct[1:])


def test_names_with_commas_and_decomposed_accents_can_be_chosen(ct: tuple, tmp_path: Path) -> None:
    decomposed = unicodedata.normalize("NFD", "Pr\u00fcf\u00f3rgano")
    drawn = {decomposed: outlines("prostate"), "Zielorgan, gesamt": outlines("bladder")}
    path, _ = rtstruct(tmp_path / "rs.dcm", drawn, SpecificCharacterSet="ISO_IR 192")
    # As the command line cuts them at commas.
    choice = {"prostate": [unicodedata.normalize("NFC", decomposed)], "bladder": ["Zielorgan", " gesamt"]}
    assert counts(read_user_labels(path, *ct[1:], choice).volume) == {1: SIZES["prostate"], 5: SIZES["bladder"]}


OTHER = {"PatientID": "ZZ-9", "PatientName": "Somebody^Else"}


@pytest.mark.parametrize(
    ("scan_says", "set_says", "message"),
    [
        ({"FrameOfReferenceUID": ""}, {"FrameOfReferenceUID": "", **OTHER}, "is of another patient"),
        ({"FrameOfReferenceUID": None}, {"FrameOfReferenceUID": "9.9", **OTHER}, "is of another patient"),
        ({}, {"FrameOfReferenceUID": ""}, "does not say that it was drawn on this scan"),
        ({"FrameOfReferenceUID": "", "PatientID": "", "PatientName": ""}, {"FrameOfReferenceUID": ""}, "does not say that"),
        ({}, {"FrameOfReferenceUID": "9.9"}, "was drawn on another scan"),
    ],
)  # fmt: skip
def test_blank_is_not_blank(scan_says: dict, set_says: dict, message: str, tmp_path: Path) -> None:
    _, volume, facts = scan(tmp_path / "ct", **scan_says)
    path, _ = rtstruct(tmp_path / "rs.dcm", {"Prostate": outlines("prostate")}, **set_says)
    with pytest.raises(InputError, match=message):
        read_user_labels(path, volume, facts)


@pytest.mark.parametrize("uid", ["", "1.2.3.4"])
def test_what_an_anonymiser_left_is_taken_with_a_note(uid: str, tmp_path: Path) -> None:
    told = {"FrameOfReferenceUID": uid, "SOPInstanceUID": uid, "SeriesInstanceUID": uid, "StudyInstanceUID": uid}
    _, volume, facts = scan(tmp_path / "ct", **(told if uid else {**told, "SOPInstanceUID": None}))
    path, _ = rtstruct(tmp_path / "rs.dcm", {"Prostate": outlines("prostate")}, FrameOfReferenceUID=uid)
    found = read_user_labels(path, volume, facts)
    assert counts(found.volume) == {1: SIZES["prostate"]} and "that was not checked" in found.notes[0]


def test_colours_and_odd_sizes_of_segmentations(ct: tuple, tmp_path: Path) -> None:
    """Frames of 24 x 21 bits, each an odd number of bytes and a half: no frame begins with a byte."""
    path = dicom_seg(tmp_path / "s.dcm", ct[0], PLAIN, "LABELMAP")
    dataset = pydicom.dcmread(path)
    change([dataset], PhotometricInterpretation="PALETTE COLOR")
    dataset.save_as(path)
    assert counts(read_user_labels(path, *ct[1:]).volume) == WHOLE
    binary = dicom_seg(tmp_path / "b.dcm", ct[0], PLAIN)
    dataset = pydicom.dcmread(binary)
    frames = dataset.pixel_array[:, :23, :19]
    dataset.Rows, dataset.Columns = 23, 19
    bits = np.packbits(frames.ravel(), bitorder="little").tobytes()
    dataset.PixelData = bits + b"\0" * (len(bits) % 2)
    assert (23 * 19) % 8 and frames.shape[0] > 3
    dataset.save_as(binary)
    assert counts(read_user_labels(binary, *ct[1:]).volume) == WHOLE


@pytest.mark.parametrize("kind", ["BINARY", "LABELMAP"])
def test_what_a_segmentation_need_not_describe(kind: str, ct: tuple, tmp_path: Path) -> None:
    """Identifiers that an anonymiser removed, indices and descriptions that a writer forgot."""
    path = dicom_seg(tmp_path / "s.dcm", ct[0], PLAIN, kind)
    dataset = pydicom.dcmread(path)
    gone = ("StudyInstanceUID", "FrameOfReferenceUID", "DimensionIndexSequence", "DimensionOrganizationSequence")
    change([dataset], **dict.fromkeys(gone))
    change(dataset.PerFrameFunctionalGroupsSequence, FrameContentSequence=None)
    change(dataset.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence, SliceThickness=None)
    told = ("SegmentAlgorithmType", "SegmentedPropertyCategoryCodeSequence", "SegmentedPropertyTypeCodeSequence")
    change(dataset.SegmentSequence, **dict.fromkeys(told))
    dataset.save_as(path)
    assert counts(read_user_labels(path, *ct[1:]).volume) == WHOLE
    change([dataset], ReferencedSeriesSequence=None)
    dataset.save_as(path)
    with pytest.raises(InputError, match="does not say that it was drawn on this scan"):
        read_user_labels(path, *ct[1:])


@pytest.mark.parametrize(
    ("kept", "stated", "spacing", "said"),
    [
        ([2, 4], 3.0, 3.0, "is empty on 1 slices between"),
        ([2, 4], 6.0, 6.0, ""),
        ([2, 3, 4], 2.0, 3.0, "said to lie 2 mm apart, but lie 3 mm apart"),
    ],
)
def test_stated_spacing_of_segmentations_counts(
    kept: list[int], stated: float, spacing: float, said: str, ct: tuple, tmp_path: Path
) -> None:
    path = dicom_seg(tmp_path / "s.dcm", ct[0], {"prostate": "Prostate"})
    dataset = pydicom.dcmread(path)
    frames, pixels = list(dataset.PerFrameFunctionalGroupsSequence), dataset.pixel_array
    heights = [float(f.PlanePositionSequence[0].ImagePositionPatient[2]) for f in frames]
    wanted = [heights.index(5.0 + 3.0 * k) for k in kept]
    dataset.PerFrameFunctionalGroupsSequence = [frames[i] for i in wanted]
    dataset.NumberOfFrames = len(wanted)
    bits = np.packbits(pixels[wanted].ravel(), bitorder="little").tobytes()
    dataset.PixelData = bits + b"\0" * (len(bits) % 2)
    dataset.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0].SpacingBetweenSlices = stated
    dataset.save_as(path)
    found = read_user_labels(path, *ct[1:])
    assert found.volume.spacing[2] == pytest.approx(spacing) and counts(found.volume) == {1: 42 * len(kept)}
    about_slices = [note for note in found.notes if "slices" in note]
    assert [said in note for note in about_slices] == ([True] if said else [])
    place = found.volume.to_lps(np.argwhere(found.volume.array > 0).astype(float))
    assert sorted(set(np.round(place[:, 2], 3))) == [5.0 + 3.0 * k for k in kept]


def test_uneven_frames_lie_on_the_stated_lattice(ct: tuple, tmp_path: Path) -> None:
    """Slices 2, 4 and 5 (gaps of 6 and 3 mm), moved to 2, 5 and 7 (9 and 6 mm): no gap is the spacing."""
    path = dicom_seg(tmp_path / "s.dcm", ct[0], {"prostate": "Prostate"})
    dataset = pydicom.dcmread(path)
    frames = sorted(
        dataset.PerFrameFunctionalGroupsSequence, key=lambda f: f.PlanePositionSequence[0].ImagePositionPatient[2]
    )
    for frame, k in zip(frames, (2, 5, 7), strict=True):
        frame.PlanePositionSequence[0].ImagePositionPatient = [-11.0, -7.0, 5.0 + 3.0 * k]
    dataset.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0].SpacingBetweenSlices = 3.0
    dataset.save_as(path)
    found = read_user_labels(path, *ct[1:])
    assert found.volume.spacing[2] == pytest.approx(3.0) and counts(found.volume) == {1: SIZES["prostate"]}


def test_a_detached_part_is_named(tmp_path: Path) -> None:
    path = nifti(tmp_path / "l.nii.gz", {"prostate": 1, "rectum": 1})
    notes = read_label_volume(path).notes
    assert any("prostate: a part of 32 voxels (0.29 cc) detached from the rest" in note for note in notes)


def test_no_library_speaks_for_us(ct: tuple, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    names = {"Segment0_Name": "prostate", "Segment0_LabelValue": "1"}
    for path in (
        nrrd(tmp_path / "s.seg.nrrd", names, [["prostate"]]),
        nifti(tmp_path / "l.nii.gz", {"prostate": 1}),
        dicom_seg(tmp_path / "s.dcm", ct[0], PLAIN),
    ):
        data = path.read_bytes()
        for part in (len(data) // 2, 90):
            path.write_bytes(data[:part])
            with pytest.raises(InputError, match=path.name) as refused:
                read_user_labels(path, *ct[1:])
            assert "\n" not in str(refused.value)
    told = capfd.readouterr()
    assert told.err == "" and told.out == ""


def nrrd_in(folder: Path, units: str) -> Path:
    """A .seg.nrrd that states its units, with the numbers as they are in mm."""
    path = nrrd(folder / "s.seg.nrrd", {"Segment0_Name": "prostate", "Segment0_LabelValue": "1"}, [["prostate"]])
    stated = f"encoding: gzip\nspace units: {units}\n".encode()
    path.write_bytes(path.read_bytes().replace(b"encoding: gzip\n", stated, 1))
    return path


@pytest.mark.parametrize(("unit", "mm"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0)])
def test_segments_in_another_unit_are_scaled(unit: str, mm: float, ct: tuple, tmp_path: Path) -> None:
    found = read_seg_nrrd(nrrd_in(tmp_path, f'"{unit}" "{unit}" "{unit}"'))
    np.testing.assert_allclose(found.grid.affine, np.diag([mm, mm, mm, 1.0]) @ ct[1].affine)
    assert bool(found.notes) == (unit != "mm")


@pytest.mark.parametrize("units", ['"furlong" "furlong" "furlong"', '"mm" "cm" "mm"'])
def test_segments_in_an_unknown_unit_are_refused(units: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"s\.seg\.nrrd: its space units are .*; mm, cm, m, um are known"):
        read_seg_nrrd(nrrd_in(tmp_path, units))
