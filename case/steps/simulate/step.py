"""The simulate step: a pair of scans whose stiffness is known (`palpate simulate SPEC.json -o CASE --answers DIR`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder, check_new_case
from palpate.case.steps.simulate.answers import Answers, surface_truth, truth_of, write_answers
from palpate.case.steps.simulate.from_ct import CtSource, ct_source
from palpate.case.steps.simulate.spec import SimulationSpec, parse_spec
from palpate.case.steps.simulate.spec_file import ScanFile
from palpate.case.steps.simulate.write import SimulatedPair, write_label_case, write_scans
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.labels import LABELS, ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.imaging.scans.scan import read_scan
from palpate.meshing.mesh_labels import MeshOptions, mesh_labels
from palpate.simulate.inverse_map import BackwardMap
from palpate.simulate.scanner import Scanner
from palpate.simulate.solve import solve_deformed
from palpate.simulate.source import LABELLED, SCANNED, PhantomSource, Source, VolumeSource, labels_on
from palpate.simulate.walls import moved_walls

GRAVITY_SUPINE = (0.0, 9.81, 0.0)


def run_simulate(
    spec: Mapping[str, object],
    case_path: Path | str,
    answers_path: Path | str,
    progress: Progress = silent,
    base: Path | None = None,
    mesh_cache: Path | None = None,
) -> Answers:
    """Write a case with two simulated states and, in another folder, its answers (NAME.json, NAME_surface.npz,
    NAME_labels).

    spec : see `case.steps.simulate.spec`. base : folder that the spec's paths start from. mesh_cache : see
    `mesh_labels`. Output "dicom": rest_ct/, deformed_ct/ and contours/{rest,deformed}.nii.gz, each in its own scan's
    frame. Output "labels": rest.nii.gz and deformed.nii.gz in one frame.

    Returns the truth. Raises InputError for a bad spec, source or folder, ConvergenceError when the specified
    deformation has no equilibrium.
    """
    parsed = parse_spec(spec, base)
    case_path, answers_path = Path(case_path), Path(answers_path)
    _check_folders(case_path, answers_path, parsed.source)
    progress(0.0, "reading the source")
    pair = _deformed_pair(_source(parsed), parsed, progress, mesh_cache)
    case = CaseFolder.create(case_path, _facts(pair, case_path.name))
    truth = _write_truth(pair, case_path.name, answers_path, progress)
    if parsed.output == "dicom":
        write_scans(pair, case, progress)
    else:
        write_label_case(pair, case, progress)
    progress(1.0, f"simulated, organ strain {100 * truth['organ_strain']['rms_largest_principal']:.0f} %")
    return truth


def _source(spec: SimulationSpec) -> Source:
    scan = spec.scan
    if not isinstance(spec.source, str):
        drawn = ct_source(spec.source) if isinstance(spec.source, CtSource) else case_source(spec.source)
        changed = replace(drawn, changes=scan.changes, noise_anew=scan.rest_noise == "anew")
        return changed.on_voxels_of_its_own(np.random.default_rng([spec.seed, 1]))
    region = SCANNED if spec.output == "dicom" else LABELLED
    return PhantomSource(voxel_mm=scan.voxel_mm, region=region, scanner=Scanner(scan.blur_mm, scan.noise_hu))


def _deformed_pair(source: Source, spec: SimulationSpec, progress: Progress, mesh_cache: Path | None) -> SimulatedPair:
    labels = source.body
    present = {label for label in ORGAN_LABELS if (labels.array == label).any()}
    if present != set(spec.stiffness.organ):
        wanted = " and ".join(LABELS[label] for label in sorted(present))
        given = " and ".join(LABELS[label] for label in sorted(spec.stiffness.organ))
        raise InputError(f"simulation spec: stiffness_kpa names {given}; the source's labels hold {wanted}; name these")
    walls = moved_walls(labels, spec.rectum, spec.bladder)
    progress(0.05, "meshing")
    meshed = mesh_labels(labels, MeshOptions(edge_mm=spec.edge_mm), mesh_cache)
    state = solve_deformed(
        meshed, spec.stiffness, walls, spec.contact, spec.element, lambda f, m: progress(0.3 + 0.3 * f, m), spec.hidden
    )
    warp = BackwardMap(state.space, state.u, state.boundary, {name: wall.motion for name, wall in walls.items()})
    centre = meshed.mesh.points[meshed.mesh.cells[np.isin(meshed.mesh.regions, ORGAN_LABELS)]].mean(axis=(0, 1))
    return SimulatedPair(
        spec, source, state, warp, np.asarray(np.linalg.inv(second_position(spec.scan, centre)), dtype=np.float64)
    )


def second_position(scan: ScanFile, centre: FloatArray) -> FloatArray:
    """Rigid motion (4, 4) of the patient from the first scan to the second: a rotation about `centre` (3,) mm, then a
    shift.
    """
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler("xyz", scan.rotation_deg, degrees=True).as_matrix()
    motion[:3, 3] = centre - motion[:3, :3] @ centre + np.array(scan.shift_mm)
    return motion


def _facts(pair: SimulatedPair, folder: str) -> CaseFacts:
    spec, source = pair.spec, pair.source
    real = not isinstance(source, PhantomSource)
    note = f"second state simulated by finite elements from {'a real scan' if real else 'an analytic phantom'}"
    return CaseFacts(
        name=f"{spec.name or folder} ({'simulated second state' if real else 'simulated'})",
        tissue_shear_modulus_kpa=spec.stiffness.tissue,
        tissue_poisson_ratio=spec.stiffness.tissue_poisson_ratio,
        boundary_noise_sd_mm=spec.contour_noise_sd_mm or None,
        gravity_rest=GRAVITY_SUPINE,
        gravity_deformed=GRAVITY_SUPINE,
        other={"simulated": True, "simulated_note": note},
    )


def _write_truth(pair: SimulatedPair, name: str, folder: Path, progress: Progress) -> Answers:
    progress(0.6, "answers")
    spec, source = pair.spec, pair.source
    truth: Answers = {
        "name": name,
        "simulated": True,
        "spec": dict(spec.raw),
        "seed": spec.seed,
        **truth_of(pair.state, spec.stiffness, pair.deformed_to_rest, spec.seed),
    }
    labels = {
        "rest": labels_on(source.labels, source.label_grid),
        "deformed": labels_on(lambda p: source.labels(pair.warp.rest_points(p)), source.label_grid),
    }
    write_answers(folder, name, truth, surface_truth(pair.state, spec.seed), labels)
    return truth


def _check_folders(case_path: Path, answers_path: Path, source: object) -> None:
    case, answers = case_path.absolute(), answers_path.absolute()
    if answers == case or answers.is_relative_to(case) or case.is_relative_to(answers):
        raise InputError(
            f"{answers_path} and {case_path} lie in one another; a case never holds its answers: give another --answers"
        )
    check_new_case(case_path, [source.ct] if isinstance(source, CtSource) else [])
    if answers_path.is_file():
        raise InputError(f"{answers_path} is a file; give a folder with --answers")


def case_source(path: Path) -> VolumeSource:
    """A case folder as a source. Raises InputError, naming the file, when it has no labels or they lack organ or
    tissue.
    """
    case = CaseFolder(path)
    file = case.file("rest.nii.gz")
    if not case.has_labels("rest"):
        raise InputError(f"{file} is not there; contour the case or run `palpate segment` first")
    labels = case.labels("rest")
    present = set(np.unique(labels.array).tolist())
    for wanted, what in ((ORGAN_LABELS, "organ (1, 2)"), ((SURROUNDING_TISSUE,), "surrounding tissue (3)")):
        if not present & set(wanted):
            raise InputError(f"{file} holds no {what}; run `palpate segment` or draw it")
    ct = read_scan(case.file("rest_ct"))[0] if case.has("rest_ct") else None
    return VolumeSource(case.facts.name, labels, ct)
