"""What the files of a case say, read once for the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypedDict, TypeVar

import numpy as np
import pydicom
from pydicom.errors import InvalidDicomError

from palpate.case.case_folder import STATES, CaseFacts, CaseFolder
from palpate.case.diagnosed import DIAGNOSIS, read_diagnosis
from palpate.case.history import Entry
from palpate.case.identified import map_arrays, read_result
from palpate.case.matched import read_matched_motion
from palpate.case.measured.measurements import REGIONS, Measurement, read_measurements
from palpate.case.step_records import AlignmentRecord, ImportRecord, SegmentationRecord
from palpate.case.surface_errors import segmentation_now
from palpate.core.arrays import FloatArray
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.errors import InputError
from palpate.core.files.json_types import known
from palpate.core.identify.result_record import ResultRecord
from palpate.core.matched_motion import MatchedMotion
from palpate.imaging.labels import LABELS
from palpate.imaging.volume import Volume
from palpate.segmentation.propagation import METHOD as PROPAGATED
from palpate.ui.report.measured_regions import MeasuredRegion, measured_regions
from palpate.ui.report.regions import RegionStiffness, regions_of

T = TypeVar("T")

# Two contours, one per scan, each with its own error.
TWO_CONTOURS = float(np.sqrt(2.0))


class SurfaceFit(TypedDict, total=False):
    """p95_mm : within which 95 % of a surface of the mesh lie of the contours."""

    p95_mm: float


class MeshFacts(TypedDict, total=False):
    """What the report tells of mesh.json: tetrahedra, their corners, the smallest angle between two faces, and the surfaces' fit."""

    cells: int
    points: int
    min_dihedral_deg: float
    surfaces: dict[str, SurfaceFit]


class _History(TypedDict, total=False):
    commands: list[Entry]


@dataclass(frozen=True)
class ScanFacts:
    """How a scan was made; nothing that names the patient. date : as YYYY-MM-DD. series : its number, as its description is free text.
    Both "" where they are blank. voxel_mm : along columns, rows and slices."""

    date: str
    scanner: str
    series: str
    slices: int
    voxel_mm: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class CaseRecord:
    """facts : case.json. result : result.json. The others are the JSON files of their steps, empty where absent.

    simulated : None, or in words what of this pair was computed rather than scanned. volumes_cc : of labels, by state.
    ln_covariance : (t, t) of ln G, regions in the order of their labels; None where unknown.
    diagnosis : diagnosis.json; matched : motion from the images; None where there is none. scans : what the CTs' headers say of
    how they were made, by state. measured : regions that a person drew on the stiffness map.
    lines : distances and angles that a person measured.
    """

    facts: CaseFacts
    result: ResultRecord
    alignment: AlignmentRecord
    segmentation: SegmentationRecord
    mesh: MeshFacts
    imported: ImportRecord
    history: tuple[Entry, ...] = ()
    simulated: str | None = None
    volumes_cc: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    ln_covariance: FloatArray | None = None
    diagnosis: DiagnosisRecord | None = None
    matched: MatchedMotion | None = None
    scans: Mapping[str, ScanFacts] = field(default_factory=dict)
    measured: tuple[MeasuredRegion, ...] = ()
    lines: tuple[Measurement, ...] = ()

    @cached_property
    def regions(self) -> tuple[RegionStiffness, ...]:
        """The regions of result.json, in the order of their labels."""
        return regions_of(self.result, self.facts)

    def ln_ratio_sd(self, a: RegionStiffness, b: RegionStiffness) -> float | None:
        """Standard deviation of ln (G of a / G of b); of independent errors where the covariance is unknown."""
        if a.ln_sd is None or b.ln_sd is None:
            return None
        if self.ln_covariance is None or self.ln_covariance.shape != (len(self.regions),) * 2:
            return float(np.hypot(a.ln_sd, b.ln_sd))
        i, j = self.regions.index(a), self.regions.index(b)
        c = self.ln_covariance
        return float(np.sqrt(max(c[i, i] + c[j, j] - 2.0 * c[i, j], 0.0)))

    @property
    def used_image(self) -> bool:
        """Whether the stiffness stands on the motion that the images tell, beside contours."""
        options = known(self.result.options)
        return self.matched is not None and options is not None and bool(options.image)

    @property
    def carried_over(self) -> bool:
        """Whether the prostate's contour of one scan is that of the other, carried over by the images."""
        organs = [facts.get("organs", {}) for facts in self.segmentation.get("states", {}).values()]
        return any("prostate" in one and one["prostate"]["method"] == PROPAGATED for one in organs)

    @property
    def noise_sd_mm(self) -> float | None:
        """Error of one contour of the prostate, mm: what the case states, else what identification used; None where unknown, and
        where one contour was carried over, whose error is in both scans."""
        if self.carried_over:
            return None
        stated = self.facts.boundary_noise_sd_mm
        return stated if stated is not None else known(self.result.misfit.contour_noise_sd_mm)

    @property
    def noise_from(self) -> str:
        """Where that figure comes from, in words."""
        if self.facts.boundary_noise_sd_mm is not None:
            return "as the case states"
        words = {"repeats": "measured from contours drawn twice", "image": "estimated from the images"}
        return words.get(str(self.result.misfit.contour_noise_from), "assumed, the case states none")

    @property
    def expected_misfit_mm(self) -> float | None:
        """The rms misfit that noise alone would leave, mm; None where the noise is unknown."""
        expected = known(self.result.misfit.expected_noise_rms_mm)
        if expected is not None:
            return expected
        return None if self.noise_sd_mm is None else TWO_CONTOURS * self.noise_sd_mm


def read_record(case: CaseFolder, labels: Mapping[str, Volume]) -> CaseRecord:
    """The record of a case that has been identified; ``labels`` are its label volumes by state.

    Raises InputError when result.json is missing, with what to do, or not in its form.
    """
    if not case.has("result.json"):
        alone = case.has_labels("rest") and not case.has_labels("deformed") and not case.has("deformed_ct")
        todo = (
            "it contains only the scan at rest: `palpate plan` works on it, or import both scans"
            if alone
            else "run `palpate identify` first"
        )
        raise InputError(f"{case.file('result.json')} is not there; {todo}")
    result, measurements = read_result(case), read_measurements(case)
    return CaseRecord(
        case.facts,
        result,
        _optional(case, "alignment.json", AlignmentRecord),
        segmentation_now(case),
        _optional(case, "mesh.json", MeshFacts),
        _optional(case, "import.json", ImportRecord),
        tuple(_optional(case, "history.json", _History).get("commands", ())),
        simulated(case, result),
        {state: label_volumes(volume) for state, volume in labels.items()},
        case.read_npz("identify/fields.npz").get("covariance") if case.has("identify/fields.npz") else None,
        read_diagnosis(case) if case.has(DIAGNOSIS) else None,
        read_matched_motion(case),
        {state: scan for state in STATES if (scan := _scan(case, state)) is not None},
        tuple(measured_regions(measurements, labels["rest"], map_arrays(case, result))) if "rest" in labels else (),
        tuple(one for one in measurements if one.kind not in REGIONS),
    )


def _scan(case: CaseFolder, state: str) -> ScanFacts | None:
    """From the headers of the first and the second slice; None without a CT, or one whose headers do not say it."""
    files = sorted(case.file(f"{state}_ct").glob("*.dcm"))
    if len(files) < 2:
        return None
    first, second = (_header(path) for path in files[:2])
    places = [header.get("ImagePositionPatient") for header in (first, second)]
    across = first.get("PixelSpacing")
    if across is None or any(place is None for place in places):
        return None
    step = float(np.linalg.norm(np.subtract(*(np.array(place, dtype=np.float64) for place in places))))
    day = str(first.get("AcquisitionDate") or first.get("StudyDate") or "")
    date = f"{day[:4]}-{day[4:6]}-{day[6:8]}" if len(day) == 8 and day.isdigit() else ""
    scanner = " ".join(str(first.get(key) or "").strip() for key in ("Manufacturer", "ManufacturerModelName")).strip()
    number = first.get("SeriesNumber")
    series = "" if number is None else f"number {number}"
    return ScanFacts(date, scanner, series, len(files), (float(across[1]), float(across[0]), step))


def simulated(case: CaseFolder, result: ResultRecord | None) -> str | None:
    """What of the pair was computed rather than scanned, in words; None for two real scans."""
    stated = case.facts.other.get("simulated") or (result is not None and result.simulated)
    note = case.facts.other.get("simulated_note", stated)
    if stated and isinstance(note, str):
        return note
    made = [state for state in STATES if _is_simulated_scan(case, state)]
    if stated or made:
        what = "both states were" if len(made) == 2 else f"the {(made or ['deformed'])[0]} state was"
        return f"{what} computed, not scanned"
    return None


def _is_simulated_scan(case: CaseFolder, state: str) -> bool:
    """Whether the scan's own header says that `palpate simulate` computed it (it also writes real scans unchanged)."""
    first = next(iter(sorted(case.file(f"{state}_ct").glob("*.dcm"))), None)
    if first is None:
        return False
    header = _header(first)
    ours = (header.get("Manufacturer"), header.get("ManufacturerModelName")) == ("Palpate", "simulate")
    return ours and "simulated" in str(header.get("SeriesDescription", "")).lower()


def _header(path: Path) -> pydicom.Dataset:
    try:
        return pydicom.dcmread(path, stop_before_pixels=True)
    except (InvalidDicomError, OSError) as error:
        raise InputError(f"{path} is not readable as DICOM; run `palpate import` again") from error


def _optional(case: CaseFolder, name: str, kind: type[T]) -> T:
    """A JSON object of the case, empty where absent. kind : which form it has; it is not checked."""
    found: T = case.read_json(name) if case.has(name) else kind()
    if not isinstance(found, Mapping):
        raise InputError(f"{case.file(name)} contains no JSON object; run the step that writes it again")
    return found


def label_volumes(labels: Volume) -> dict[str, float]:
    """Volume of the voxels of each label that is present, cc, by its name."""
    voxel_cc = float(np.prod(labels.spacing)) / 1000.0
    counts = np.bincount(labels.array.ravel(), minlength=len(LABELS))
    return {name: float(counts[value]) * voxel_cc for value, name in LABELS.items() if value and counts[value]}
