"""For PACS and DICOM viewers: stiffness in kPa as a DICOM parametric map."""

from __future__ import annotations

from pathlib import Path

import highdicom as hd
import numpy as np
from highdicom.sr import CodedConcept

from palpate.case.case_folder import CaseFolder
from palpate.imaging.volume import Volume
from palpate.ui.dicom.codes import (
    INTERVAL_HIGH,
    INTERVAL_LOW,
    KILOPASCAL,
    SHEAR_MODULUS,
    STIFFNESS_FROM_PAIR,
    scheme,
)
from palpate.ui.dicom.making import Making, making, save
from palpate.ui.dicom.source import SourceScan, read_source, set_thickness
from palpate.ui.export.stiffness import interval_volumes, near_organ, stiffness_volume

WRITES = "DICOM Parametric Map: shear modulus G in kPa and the ends of its 95 % interval, 0 where none was identified"
_INPUTS = ["result.json", "rest.nii.gz", "labels.txt"]
# Of the maps beside that of G: kind, word in names, and what it is.
_ENDS = (
    ("pm low", "low", "lower limit of the 95 % interval of G"),
    ("pm high", "high", "upper limit of the 95 % interval of G"),
)


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes stiffness_pm.dcm, and stiffness_low_pm.dcm and stiffness_high_pm.dcm where the interval is known.

    Raises InputError when the case has no result or no CT at rest, or it cannot write.
    """
    source = read_source(case, "rest")
    made = making(case, "pm", source, _INPUTS)
    found = _map(near_organ(stiffness_volume(case)), source, made, SHEAR_MODULUS, "shear modulus G")
    written = [save(found, folder / "stiffness_pm.dcm")]
    limits = interval_volumes(case)
    for (kind, word, words), quantity in zip(_ENDS, (INTERVAL_LOW, INTERVAL_HIGH), strict=True):
        if limits is not None:
            made = making(case, kind, source, _INPUTS)
            found = _map(near_organ(limits[word]), source, made, quantity, words)
            written.append(save(found, folder / f"stiffness_{word}_pm.dcm"))
    return written


def _map(G: Volume, source: SourceScan, made: Making, quantity: CodedConcept, words: str) -> hd.pm.ParametricMap:
    """One map of a quantity in kPa. words : what it is."""
    values = np.unique(G.array[G.array > 0])
    mapping = hd.pm.RealWorldValueMapping(
        lut_label="G_kPa",
        lut_explanation=f"{words[:1].upper()}{words[1:]}, kPa; research use only; 0: none"[:64],
        unit=KILOPASCAL,
        value_range=(0.0, float(values.max())),
        slope=1.0,
        intercept=0.0,
        quantity_definition=quantity,
    )
    found = hd.pm.ParametricMap(
        source_images=source.images,
        pixel_array=source.placed(G),
        contains_recognizable_visual_features=False,
        real_world_value_mappings=[mapping],
        voi_lut_transformations=[hd.VOILUTTransformation(0.5 * values.max(), values.max())],
        content_label="STIFFNESS",
        content_description=f"Research use only: {words}, kPa"[:64],
        content_qualification="RESEARCH",
        derivation=STIFFNESS_FROM_PAIR,
        series_description=made.series_description(
            "stiffness G, kPa" if quantity is SHEAR_MODULUS else f"{words}, kPa"
        ),
        coding_schemes=[scheme()],
        **made.equipment(),
    )
    found.ImageComments = made.note
    found.BodyPartExamined = source.body_part
    set_thickness(found, G)
    made.stamp(found)
    return found
