"""For PACS: the measurements as a DICOM structured report (TID 1500), with the segmentation that it refers to."""

from __future__ import annotations

from pathlib import Path

import highdicom as hd
import numpy as np
from highdicom import sr
from highdicom.sr import CodedConcept
from pydicom.sr.codedict import codes
from pydicom.sr.coding import Code
from pydicom.uid import UID, generate_uid

from palpate.case.case_folder import CaseFolder
from palpate.case.measured.measurements import FILE as MEASUREMENTS
from palpate.core.errors import InputError
from palpate.core.files.json_types import known
from palpate.imaging.labels import PROSTATE_LEFT
from palpate.ui.dicom import codes as own
from palpate.ui.dicom.label_segments import label_segmentation
from palpate.ui.dicom.making import MANUFACTURER, MODEL, Making, making, save, version
from palpate.ui.dicom.source import read_source
from palpate.ui.report.measured_regions import MeasuredRegion
from palpate.ui.report.record import CaseRecord, read_record
from palpate.ui.report.regions import RegionStiffness

WRITES = "DICOM SR (TID 1500): shear modulus G of each region, and of regions drawn on the map, with intervals; the SEG it refers to"

Group = sr.VolumetricROIMeasurementsAndQualitativeEvaluations | sr.PlanarROIMeasurementsAndQualitativeEvaluations


def export(case: CaseFolder, folder: Path, tissue: bool = False) -> list[Path]:
    """Writes measurements_sr.dcm and rest_seg.dcm.

    Raises InputError when the case has no result, labels or CT at rest, or it cannot write.
    """
    record = read_record(case, {"rest": case.labels("rest")})
    source = read_source(case, "rest")
    made = making(
        case, "sr", source, ["result.json", "rest.nii.gz", "labels.txt", *([MEASUREMENTS] if record.measured else [])]
    )
    segments = label_segmentation(case, "rest", tissue)
    numbers = {item.TrackingID: int(item.SegmentNumber) for item in segments.SegmentSequence}
    absent = [region.name for region in record.regions if region.name not in numbers]
    if absent:
        raise InputError(f"{case.file('rest.nii.gz')} has no {absent[0]}, which result.json has; identify again")
    groups: list[Group] = [_group(region, segments, numbers[region.name]) for region in record.regions]
    groups += [
        _drawn_group(
            one, source.header.FrameOfReferenceUID, generate_uid(entropy_srcs=[made.sop_uid, one.measurement.name])
        )
        for one in record.measured
    ]
    report = sr.MeasurementReport(
        observation_context=_observer(),
        procedure_reported=codes.LN.CTUnspecifiedBodyRegion,
        imaging_measurements=groups,
        title=codes.DCM.ImagingMeasurementReport,
    )
    report[0].ContentSequence.append(_remark(record, made))
    # Outlines in patient coordinates need the form for 3D; without any, more programs read the plain one.
    form = sr.Comprehensive3DSR if record.measured else sr.ComprehensiveSR
    document = form(
        evidence=[*source.images, segments],
        content=report[0],
        is_complete=True,
        is_final=False,
        series_description=made.series_description("stiffness measurements"),
        coding_schemes=[own.scheme()],
        **made.equipment(),
    )
    made.stamp(document)
    return [save(segments, folder / "rest_seg.dcm"), save(document, folder / "measurements_sr.dcm")]


def _observer() -> sr.ObservationContext:
    device = sr.DeviceObserverIdentifyingAttributes(
        generate_uid(entropy_srcs=[MODEL, version()]), MANUFACTURER, MANUFACTURER, MODEL, version()
    )
    return sr.ObservationContext(observer_device_context=sr.ObserverContext(codes.DCM.Device, device))


def _group(
    region: RegionStiffness, segments: hd.seg.Segmentation, number: int
) -> sr.VolumetricROIMeasurementsAndQualitativeEvaluations:
    """TID 1411: one region, by its segment."""
    segment = segments.SegmentSequence[number - 1]
    _, kind, side = own.OF_LABEL[region.label]
    values = [(region.G, None, own.SHEAR_MODULUS)]
    if region.sd is not None:
        values.append((region.sd, own.STANDARD_DEVIATION, own.SHEAR_MODULUS))
    if region.ci is not None:
        values += [(region.ci[0], None, own.INTERVAL_LOW), (region.ci[1], None, own.INTERVAL_HIGH)]
    return sr.VolumetricROIMeasurementsAndQualitativeEvaluations(
        tracking_identifier=sr.TrackingIdentifier(uid=segment.TrackingUID, identifier=region.name),
        referenced_segment=sr.ReferencedSegment.from_segmentation(segments, number),
        finding_type=kind,
        finding_sites=[sr.FindingSite(kind, laterality=side)],
        method=own.STIFFNESS_FROM_PAIR,
        measurements=[
            sr.Measurement(name, float(f"{value:.4g}"), own.KILOPASCAL, derivation=how) for value, how, name in values
        ],
        qualitative_evaluations=[
            sr.QualitativeEvaluation(own.DETERMINED, own.DETERMINED_YES if region.determined else own.DETERMINED_NO)
        ],
    )


def _drawn_group(
    region: MeasuredRegion, frame_of_reference: str, uid: UID
) -> sr.PlanarROIMeasurementsAndQualitativeEvaluations:
    """TID 1410: a region that a person drew on the stiffness map, by its outline in patient coordinates."""
    drawn, mean = region.measurement, region.mean
    outline = np.array([*drawn.points, drawn.points[0]], dtype=np.float64)
    values: list[tuple[float, CodedConcept | Code | None, CodedConcept | Code, CodedConcept | Code]]
    values = [(region.area_mm2, None, own.AREA, own.SQUARE_MILLIMETRE)]
    if mean.G_kpa is not None and mean.interval_kpa is not None:
        low, high = mean.interval_kpa
        values.append((mean.G_kpa, own.MEAN, own.SHEAR_MODULUS, own.KILOPASCAL))
        values += [(low, None, own.INTERVAL_LOW, own.KILOPASCAL), (high, None, own.INTERVAL_HIGH, own.KILOPASCAL)]
    _, kind, _ = own.OF_LABEL[PROSTATE_LEFT]
    return sr.PlanarROIMeasurementsAndQualitativeEvaluations(
        tracking_identifier=sr.TrackingIdentifier(uid=uid, identifier=f"region {drawn.name}"),
        referenced_region=sr.ImageRegion3D(sr.GraphicTypeValues3D.POLYGON, outline, frame_of_reference),
        finding_type=kind,
        method=own.STIFFNESS_FROM_PAIR,
        measurements=[
            sr.Measurement(name, float(f"{value:.4g}"), unit, derivation=how) for value, how, name, unit in values
        ],
        qualitative_evaluations=[
            sr.QualitativeEvaluation(own.DETERMINED, own.DETERMINED_NO if mean.G_kpa is None else own.DETERMINED_YES)
        ],
    )


def _remark(record: CaseRecord, made: Making) -> sr.TextContentItem:
    tissue, options = record.facts.tissue_shear_modulus_kpa, known(record.result.options)
    what = "G" if options is not None and options.other_law else "G = 2 (mu1 + mu2)"
    text = (
        f"{made.note} {what} is relative to an assumed shear modulus of {tissue:g} kPa of the surrounding "
        f"tissue. What this pair determines: {record.result.identifiability.verdict}."
    )
    return sr.TextContentItem(codes.DCM.Comment, text, sr.RelationshipTypeValues.CONTAINS)
