"""Identification as a job of the worker process: from the problem file to the result and the fields."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from palpate.core.identify.identify import Identification, identify
from palpate.core.identify.map.places import LEVEL
from palpate.core.identify.map.stiffness_map import StiffnessMap, stiffness_map
from palpate.core.identify.map.told_places import place_record, places
from palpate.core.identify.mu_split import separable
from palpate.core.identify.not_identifiable import nothing_found
from palpate.core.identify.notes import agreement, notes
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.pair.no_driving_wall import moved_by_its_surface, surface_is_all
from palpate.core.identify.pair.whole_motion import laid_on_itself, motion_in_words
from palpate.core.identify.result_misfit import misfit_figures
from palpate.core.identify.result_parameters import parameter_facts
from palpate.core.identify.result_record import (
    IdentifiabilityRecord,
    IdentificationRecord,
    MapRecord,
    MisfitRecord,
    SolverRecord,
)
from palpate.core.inference.posterior import verdict
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.checkpoint import save_checkpoint
from palpate.core.worker.executors import one_thread
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter

MAP_FILE = "stiffness_map.npz"


def run(job: Job, reporter: Reporter) -> IdentificationRecord:
    """Job of kind "palpate.core.identify.job:run": result.json without versions and inputs, which the case adds.

    Options of the job : `IdentifyOptions`. Paths of the job : "problem", and "problem_2", "problem_3", ... for further
    deformed states of the same mesh. Writes fields.npz and, where there is a stiffness map, stiffness_map.npz into the
    job's folder. Raises InputError and ConvergenceError as `identify` does.
    """
    one_thread()  # the order of sums, and so the last bits of the result, must not depend on the number of cores
    options = replace(job.options_as(IdentifyOptions), seed=job.seed, workers=job.workers)
    fingerprint = job.fingerprint()
    began = time.perf_counter()
    files = problem_files(job)
    problems = [IdentificationProblem.load(file) for file in files]
    if all(surface_is_all(problem) for problem in problems):  # the model cannot be posed
        motion = moved_by_its_surface(problems[0])
        result, fields = nothing_found(problems[0], motion, options, time.perf_counter() - began)
        save_checkpoint(Path(job.folder) / "fields.npz", fields, fingerprint)
        (Path(job.folder) / MAP_FILE).unlink(missing_ok=True)
        return result
    laid = [laid_on_itself(file, Path(job.folder)) for file in files]
    identification = identify(Path(job.folder), [file for file, _ in laid], options, fingerprint, reporter)
    save_checkpoint(Path(job.folder) / "fields.npz", _fields(identification), fingerprint)
    stiffness = _mapped(identification, options, reporter)
    if stiffness is None:
        (Path(job.folder) / MAP_FILE).unlink(missing_ok=True)  # file of an earlier run
    else:
        save_checkpoint(Path(job.folder) / MAP_FILE, stiffness.arrays(), fingerprint)
    names = identification.scene.problem.region_names
    result = _result(identification, options, None if stiffness is None else _map_record(stiffness, names))
    why = identification.untold or motion_in_words(identification.fit, laid[0][1])
    return msgspec.structs.replace(result, notes=[why, *result.notes]) if why else result


def problem_files(job: Job) -> list[Path]:
    """Problem files of the job, the first state first."""
    further = [f"problem_{k}" for k in range(2, len(job.paths) + 2)]
    return [Path(job.paths[name]) for name in ("problem", *further) if name in job.paths]


def _mapped(identification: Identification, options: IdentifyOptions, reporter: Reporter) -> StiffnessMap | None:
    if not options.stiffness_map or options.boundary != "coupled" or identification.untold:
        return None
    return stiffness_map(
        identification.fit,
        [(s.scene, s.equilibrium) for s in identification.solutions],
        progress=lambda f, m: reporter.progress(0.94 + 0.05 * f, m),
    )


def _map_record(stiffness: StiffnessMap, names: Mapping[int, str]) -> MapRecord:
    patches, local = stiffness.patches, stiffness.local
    return MapRecord(
        file=f"identify/{MAP_FILE}",
        patches=patches.n,
        told_share_of_volume=float(patches.volumes[stiffness.told].sum() / patches.volumes.sum()),
        resolved_values=float(np.trace(local.model.resolution)),
        blur_mm=float(np.median(stiffness.blur_mm)),
        steps=1,
        settled=True,
        prior_local_sd_ln_G=stiffness.local_sd,
        prior_length_mm=local.length_mm,
        uniform_probability={names[r]: float(p) for r, p in zip(patches.regions, local.uniform, strict=True)},
        level=LEVEL,
        places=[place_record(place, names) for place in places(stiffness)],
    )


def _result(
    identification: Identification, options: IdentifyOptions, map_record: MapRecord | None
) -> IdentificationRecord:
    parameters, posterior = identification.scene.parameters, identification.posterior
    names = tuple(identification.scene.problem.region_names[r] for r in identification.scene.problem.regions)
    shares = posterior.of(parameters.shares) if options.split_mu else None
    states = [_misfit(identification, k) for k in range(len(identification.solutions))]
    noise_mm = states[0].expected_noise_rms_mm
    assert isinstance(noise_mm, float)
    return IdentificationRecord(
        parameters=parameter_facts(names, parameters, posterior),
        identifiability=IdentifiabilityRecord(
            singular_values=posterior.singular_values.tolist(),
            mu1_mu2_separable=separable(parameters, posterior),
            verdict=verdict(names, identification.stiffness, shares, options.other_law, identification.untold),
        ),
        misfit=msgspec.structs.replace(
            states[0],
            weighted=float(identification.fit.residual @ identification.fit.residual),
            weighted_from_noise=float(len(identification.fit.residual)),
        ),
        states=states,
        solver=_work(identification, options),
        method=options.method,
        boundary=options.boundary,
        seed=options.seed,
        options=options,
        convergence=_convergence(identification),
        agreement=agreement(identification, names),
        notes=notes(identification, names),
        stiffness_map=map_record,
    )


def _work(identification: Identification, options: IdentifyOptions) -> SolverRecord:
    return SolverRecord(
        forward_solves=identification.fit.count.solves,
        newton_iterations=identification.fit.count.factorisations,
        failed=identification.fit.count.failed,
        reduced_evaluations=identification.reduced_evaluations,
        seconds=round(identification.seconds, 2),
        element=identification.solutions[0].element,
        unknowns=identification.scene.assembler.pattern.n,
        linear_solver=identification.scene.assembler.solver.name,
    )


def _misfit(identification: Identification, k: int) -> MisfitRecord:
    """Misfit of state k (Eqs 10 to 13 of Yang & Lin). A point is compared with the surface of its own region; points
    near the dividing line are left out.
    """
    scene, u = identification.solutions[k].scene, identification.solutions[k].equilibrium.u
    observation = scene.observation
    moved = observation.points + observation.operator @ u
    figures = misfit_figures(scene.problem, observation.points, observation.region, moved)
    marks = observation.landmark_residual(u)
    if len(marks):
        rms_mm = float(np.sqrt((marks**2).sum(axis=1).mean()))
        figures = msgspec.structs.replace(figures, landmarks_rms_mm=rms_mm)
    return msgspec.structs.replace(figures, expected_noise_rms_mm=identification.fit.noise_rms_mm[k])


def _convergence(identification: Identification) -> list[float | None]:
    return (
        identification.swarm.history.tolist()
        if identification.swarm is not None
        else list(identification.fit.optimum.history)
    )


def _fields(identification: Identification) -> dict[str, NDArray[np.generic]]:
    """Arrays for pictures, in the rest frame, mm."""
    observation, space = identification.scene.observation, identification.scene.space
    vertices = len(space.mesh.points)
    fields: dict[str, NDArray[np.generic]] = {
        "mesh_displacement": identification.equilibrium.u[:vertices],
        "surface_points": observation.points,
        "surface_displacement": observation.operator @ identification.equilibrium.u,
        "surface_region": observation.region,
        "surface_residual": observation.residual(identification.equilibrium.u),
        "theta": identification.theta,
        "covariance": identification.posterior.covariance,
    }
    if identification.swarm is not None:
        fields["swarm_positions"] = identification.swarm.positions
        fields["swarm_values"] = identification.swarm.values
    return fields
