"""A simulated pair written into its case: as DICOM scans with contours, or as label volumes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.steps.simulate.spec import SimulationSpec
from palpate.core.arrays import FloatArray
from palpate.core.surfaces.rigid_motion import transformed
from palpate.core.worker.progress import Progress
from palpate.imaging.contours.itksnap_labels import label_description
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume
from palpate.simulate.contour_errors import labels_with_contour_errors
from palpate.simulate.inverse_map import BackwardMap
from palpate.simulate.solve import DeformedState
from palpate.simulate.source import PhantomSource, Source, ToRest


@dataclass(frozen=True, eq=False)
class SimulatedPair:
    """A body, its deformed state, and the patient's position in the second scan (deformed_to_rest, (4, 4), LPS mm)."""

    spec: SimulationSpec
    source: Source
    state: DeformedState
    warp: BackwardMap
    deformed_to_rest: FloatArray

    def to_rest(self, points: FloatArray) -> FloatArray:
        """Rest positions of points (n, 3) mm in the second scan's frame."""
        return self.warp.rest_points(transformed(self.deformed_to_rest, points))

    @property
    def rng(self) -> np.random.Generator:
        """A new random generator with the spec's seed."""
        return np.random.default_rng(self.spec.seed)


def write_scans(pair: SimulatedPair, case: CaseFolder, progress: Progress) -> None:
    """rest_ct/, deformed_ct/ and contours of both, each in its own scan's frame."""
    seeds = pair.rng.integers(0, 2**31, size=2)
    rest = None
    for number, state in enumerate(("rest", "deformed")):
        progress(0.65 + 0.15 * number, f"{state} scan")
        to_rest = pair.to_rest if number else None
        ct = pair.source.scan(to_rest, rest, int(seeds[number]))
        rest = ct if rest is None else rest
        write_ct_series(case.file(f"{state}_ct"), ct, _identity(pair, case, number, ct))
    progress(0.95, "contours")
    first, second = _contoured(pair, pair.to_rest, _padded(pair.source.label_grid, 6.0))
    for state, labels in (("rest", first), ("deformed", second)):
        with case.atomic_path(f"contours/{state}.nii.gz") as temporary:
            write_labels(temporary, labels)
    case.write_text("contours/labels.txt", label_description())


def write_label_case(pair: SimulatedPair, case: CaseFolder, progress: Progress) -> None:
    """rest.nii.gz and deformed.nii.gz in one frame."""
    progress(0.7, "label volumes")
    first, second = _contoured(pair, pair.warp.rest_points, pair.source.label_grid)
    case.write_labels("rest", first)
    case.write_labels("deformed", second)


def _contoured(pair: SimulatedPair, to_rest: ToRest, second_grid: Volume) -> tuple[Volume, Volume]:
    """Contours of both states, with independent errors."""
    spec, source, rng = pair.spec, pair.source, pair.rng
    noise = (spec.contour_noise_sd_mm, spec.noise_correlation_mm, rng)
    rest = labels_with_contour_errors(source.labels, source.label_grid, *noise)
    return rest, labels_with_contour_errors(lambda points: source.labels(to_rest(points)), second_grid, *noise)


def _identity(pair: SimulatedPair, case: CaseFolder, number: int, ct: Volume) -> SeriesIdentity:
    real = not isinstance(pair.source, PhantomSource)
    name = case.path.name
    # The same spec and pixels give the same UIDs, anything else others.
    key = f"{name} {pair.spec.seed} {int(ct.array.astype(np.int64).sum())} {number}"
    what = ("rest", "deformed, simulated")[number] if real else ("rest, simulated", "deformed, simulated")[number]
    derivation = (
        ("Pixels of the source CT, identity replaced", "Source CT moved by a finite element simulation")
        if real
        else ("Analytic phantom", "Analytic phantom moved by a finite element simulation")
    )[number]
    return SeriesIdentity(
        patient_id=f"PALPATE-{pair.spec.seed:04d}",
        patient_name="Simulated^Pelvis",
        study=f"study {key}",
        series=f"series {key}",
        frame_of_reference=f"frame {key}",
        number=number + 1,
        study_description="Palpate simulated pair, research use only",
        series_description=f"CT pelvis {what}",
        derivation=derivation,
        date=("20240108", "20240115")[number],
    )


def _padded(grid: Volume, margin_mm: float) -> Volume:
    extra = np.ceil(margin_mm / grid.spacing).astype(int)
    affine = grid.affine.copy()
    affine[:3, 3] = grid.to_lps(-extra[None, :].astype(float))[0]
    return Volume(np.zeros(tuple(np.array(grid.array.shape) + 2 * extra), dtype=np.uint8), affine)
