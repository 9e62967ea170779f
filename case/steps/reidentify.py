"""Identification from a second set of contours of the deformed organ. The scene is known; only the data are new."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from scipy.spatial import cKDTree

from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.second_contours import second_contours
from palpate.core.errors import InputError
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.identify.mu_split import separable
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.reidentify import FILE, Again, identify_again
from palpate.core.identify.result_misfit import misfit_figures
from palpate.core.identify.result_parameters import parameter_facts
from palpate.core.identify.result_record import IdentifiabilityRecord, ReidentificationRecord
from palpate.core.inference.posterior import verdict
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces

# Files that determine the scene.
_SCENE = ("mesh.npz", "case.json")


class _MadeFrom(msgspec.Struct):
    """Inputs and options of the first identification in result.json; earlier versions left out the options."""

    inputs_sha256: dict[str, str] = {}
    options: IdentifyOptions | None = None


def run(case: CaseFolder, path: Path, progress: Progress = silent) -> ReidentificationRecord:
    """Write again.json of a case that a swarm has identified, from new labels of its deformed scan, and return it.

    path : labels in any format of `palpate import`, in the deformed scan's own coordinates. Mesh, walls, weights and
    result.json stay those of the first identification. seconds, cpu_seconds : from the organ's surface to the
    stiffness. Precondition: the case was identified by a swarm and has not changed since. Raises InputError where it
    was not, and for labels that cannot be read.
    """
    options = _earlier(case)
    progress(0.1, "reading the labels")
    labels = second_contours(case, "deformed", path)
    progress(0.4, "the organ's surface")
    earlier = IdentificationProblem.load(case.file("identify") / "problem.npz")
    if not earlier.organ_drawn:
        raise InputError(
            f"{case.file('identify')}: nobody drew the prostate in the deformed scan, so that its contour was no datum; give the labels to "
            "`palpate import --deformed-labels` and identify"
        )
    problem = _with_organ(earlier, labels)
    progress(0.7, "stiffness")
    began = time.perf_counter(), time.process_time()
    limits = one_thread()
    found = identify_again(case.file("identify"), problem, options)
    limits.restore_original_limits()
    seconds = time.perf_counter() - began[0], time.process_time() - began[1]
    if found is None:
        raise _no_model(case)
    names = tuple(problem.region_names[r] for r in problem.regions)
    parameters = StiffnessParameters(problem.regions, problem.facts, options.split_mu)
    result = ReidentificationRecord(
        parameters=parameter_facts(names, parameters, found.posterior),
        identifiability=_identifiability(names, parameters, found, options),
        misfit=misfit_figures(problem, found.points, found.region, found.moved),
        model_error_mm=found.model_error_mm,
        walls="where the first identification settled them",
        seconds=round(seconds[0], 3),
        cpu_seconds=round(seconds[1], 3),
        labels_sha256=file_sha256(path),
        options=options,
    )
    case.write_json("again.json", result)
    progress(1.0, "stiffness found again")
    return result


def _earlier(case: CaseFolder) -> IdentifyOptions:
    """Options of the first identification. Raises InputError where the case has changed since."""
    if not (case.has("result.json") and case.has(f"identify/{FILE}")):
        raise _no_model(case)
    made = case.read("result.json", _MadeFrom, "; run `palpate identify` first")
    changed = [name for name in _SCENE if made.inputs_sha256.get(name) != case.inputs_sha256([name])]
    if changed or made.options is None:
        raise InputError(
            f"{case.file((changed or ['result.json'])[0])} is not that of the last identification; run `palpate identify` first"
        )
    return made.options


def _no_model(case: CaseFolder) -> InputError:
    return InputError(
        f"{case.file('identify')} holds no reduced model of this scene; run `palpate identify` with --method swarm and "
        "--boundary coupled first"
    )


def _with_organ(problem: IdentificationProblem, labels: Volume) -> IdentificationProblem:
    """The problem with the organ's deformed surface from these labels."""
    surface = organ_surfaces(labels)
    region = surface.region
    if set(np.unique(region).tolist()) != set(problem.regions):
        # Contoured as a whole: each face takes the region of the nearest face of the earlier contours.
        before = problem.organ.deformed
        nearest = cKDTree(before.points[before.faces].mean(axis=1))
        region = before.region[nearest.query(surface.points[surface.faces].mean(axis=1))[1]]
    deformed = Surface(surface.points, surface.faces, region)
    return replace(problem, organ=SurfacePair(problem.organ.rest, deformed))


def _identifiability(
    names: tuple[str, ...], parameters: StiffnessParameters, found: Again, options: IdentifyOptions
) -> IdentifiabilityRecord:
    shares = found.posterior.of(parameters.shares) if options.split_mu else None
    return IdentifiabilityRecord(
        singular_values=found.posterior.singular_values.tolist(),
        mu1_mu2_separable=separable(parameters, found.posterior),
        verdict=verdict(names, found.posterior.of(parameters.stiffness), shares, options.other_law),
    )
