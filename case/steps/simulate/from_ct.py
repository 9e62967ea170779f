"""A CT and the contours drawn on it as the body that a simulation starts from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.case.contours import contours_of_file
from palpate.case.steps.segment import labels_of
from palpate.case.steps.segment_options import SegmentOptions
from palpate.case.steps.segment_report import SegmentedState
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.contours.user_labels import read_user_labels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.scans.scan import read_scan
from palpate.segmentation.pelvis import segment_pelvis
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.prostate.halves import midline_normal, split_plane
from palpate.segmentation.tissue import region_of_interest
from palpate.simulate.source import VolumeSource

# How much farther from the prostate the simulated body reaches, along each axis, than an analysis models. Were both held at
# the same edge, a simulation could not show the error that comes from holding it.
BEYOND_MM = 12.0


@dataclass(frozen=True)
class CtSource:
    """ct : folder of a CT series. labels : RTSTRUCT, DICOM SEG or label volume drawn on it, the prostate at least."""

    ct: Path
    labels: Path


def ct_source(source: CtSource, progress: Progress = silent) -> VolumeSource:
    """Modelled region of a CT. Contoured structures are taken as they are; bone and missing structures are segmented.

    Raises InputError, naming the file, when the CT or the contours cannot be read or hold no prostate.
    """
    ct, facts = read_scan(source.ct)
    ct = in_lps_order(ct)
    contours = contours_of_file(read_user_labels(source.labels, ct, facts), source.labels)
    segmentation = segment_pelvis(ct, Prompts(), contours.organs, progress)
    part = SegmentedState(segmentation, contours, contours.volume)
    normal, origin = midline_normal(segmentation.scene.pelvis)
    plane = split_plane(part.prostate, normal, origin, None)
    region = region_of_interest(part.prostate, np.array(SegmentOptions().margin_mm) + BEYOND_MM)
    return VolumeSource(source.ct.name, labels_of(part, plane, region), ct)
