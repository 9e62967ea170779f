"""For PACS and DICOM viewers: stiffness in kPa as a DICOM parametric map."""

from __future__ import annotations

from pathlib import Path

import highdicom as hd
import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.ui.dicom.codes import KILOPASCAL, SHEAR_MODULUS, STIFFNESS_FROM_PAIR, scheme
from palpate.ui.dicom.making import making, save
from palpate.ui.dicom.source import read_source, set_thickness
from palpate.ui.export.stiffness import near_organ, stiffness_volume

WRITES = "DICOM Parametric Map: shear modulus G in kPa, 0 where none was identified"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes stiffness_pm.dcm. Raises InputError when the case has no result or no CT at rest, or it cannot write."""
    G = near_organ(stiffness_volume(case))
    source = read_source(case, "rest")
    made = making(case, "pm", source, ["result.json", "rest.nii.gz", "labels.txt"])
    values = np.unique(G.array[G.array > 0])
    mapping = hd.pm.RealWorldValueMapping(
        lut_label="G_kPa",
        lut_explanation="Shear modulus G, kPa; research use only; 0: none identified",
        unit=KILOPASCAL,
        value_range=(0.0, float(values.max())),
        slope=1.0,
        intercept=0.0,
        quantity_definition=SHEAR_MODULUS,
    )
    found = hd.pm.ParametricMap(
        source_images=source.images,
        pixel_array=source.placed(G),
        contains_recognizable_visual_features=False,
        real_world_value_mappings=[mapping],
        voi_lut_transformations=[hd.VOILUTTransformation(0.5 * values.max(), values.max())],
        content_label="STIFFNESS",
        content_description="Research use only: shear modulus G in kPa",
        content_qualification="RESEARCH",
        derivation=STIFFNESS_FROM_PAIR,
        series_description=made.series_description("stiffness G, kPa"),
        coding_schemes=[scheme()],
        **made.equipment(),
    )
    found.ImageComments = made.note
    found.BodyPartExamined = source.body_part
    set_thickness(found, G)
    made.stamp(found)
    return [save(found, folder / "stiffness_pm.dcm")]
