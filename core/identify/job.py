"""Identification as a job of the worker process: problem file in, result and fields out."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from palpate.core.forward.coupled_scene import CoupledScene
from palpate.core.identify.identify import Identification, identify
from palpate.core.identify.map.stiffness_map import StiffnessMap, stiffness_map
from palpate.core.identify.mu_split import separable
from palpate.core.identify.not_identifiable import nothing_found
from palpate.core.identify.notes import agreement, notes
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.pair.no_driving_wall import moved_by_its_surface, surface_is_all
from palpate.core.identify.pair.no_information import NoInformation, moved_as_a_whole
from palpate.core.identify.pair.rigid_pair import rigid_pair
from palpate.core.identify.plain_fit import StateProblem
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
    """Job kind "palpate.core.identify.job:run"; options as `IdentifyOptions`. Writes fields.npz into the job's folder.

    paths : "problem", and "problem_2", "problem_3", ... where more than one deformed state of the same mesh was seen.

    Returns result.json without versions and inputs, which the case knows.
    """
    one_thread()  # the order of sums, and with it the last bits, must not depend on the machine's cores
    options = replace(job.options_as(IdentifyOptions), seed=job.seed, workers=job.workers)
    fingerprint = job.fingerprint()
    began = time.perf_counter()
    files = problem_files(job)
    problems = [IdentificationProblem.load(file) for file in files]
    untold = [_untold(problem) for problem in problems]
    if untold[0] is not None and None not in untold:
        result, fields = nothing_found(problems[0], untold[0], options, time.perf_counter() - began)
        save_checkpoint(Path(job.folder) / "fields.npz", fields, fingerprint)
        (Path(job.folder) / MAP_FILE).unlink(missing_ok=True)
        return result
    found = identify(Path(job.folder), files, options, fingerprint, reporter)
    save_checkpoint(Path(job.folder) / "fields.npz", _fields(found), fingerprint)
    mapped = _mapped(found, options, reporter)
    if mapped is None:
        (Path(job.folder) / MAP_FILE).unlink(missing_ok=True)  # an earlier run's
    else:
        save_checkpoint(Path(job.folder) / MAP_FILE, mapped.arrays(), fingerprint)
    return _result(found, options, None if mapped is None else _map_record(mapped))


def problem_files(job: Job) -> list[Path]:
    """The job's problems, first state first."""
    further = [f"problem_{k}" for k in range(2, len(job.paths) + 2)]
    return [Path(job.paths[name]) for name in ("problem", *further) if name in job.paths]


def _untold(problem: IdentificationProblem) -> NoInformation | None:
    """Why no stiffness need be searched for; None where one must be."""
    pair = rigid_pair(problem)
    if pair.nothing_deformed:
        return moved_as_a_whole(problem, pair)
    return moved_by_its_surface(problem) if surface_is_all(problem) else None


def _mapped(found: Identification, options: IdentifyOptions, reporter: Reporter) -> StiffnessMap | None:
    if not options.stiffness_map or not isinstance(found.scene, CoupledScene):
        return None
    told = lambda f, m: reporter.progress(0.94 + 0.05 * f, m)  # noqa: E731
    return stiffness_map(
        found.scene, found.misfit, found.theta, found.equilibrium, found.posterior.scale, progress=told
    )


def _map_record(mapped: StiffnessMap) -> MapRecord:
    share = float(mapped.patches.volumes[mapped.told].sum() / mapped.patches.volumes.sum())
    return MapRecord(
        file=f"identify/{MAP_FILE}",
        patches=mapped.patches.n,
        told_share_of_volume=share,
        resolved_values=float(np.trace(mapped.resolution)),
        blur_mm=float(np.median(mapped.blur_mm)),
        steps=mapped.steps,
        settled=mapped.settled,
        prior_local_sd_ln_G=mapped.prior.local_sd,
        prior_length_mm=mapped.prior.length_mm,
    )


def _result(found: Identification, options: IdentifyOptions, mapped: MapRecord | None) -> IdentificationRecord:
    parameters, posterior = found.scene.parameters, found.posterior
    names = tuple(found.scene.problem.region_names[r] for r in found.scene.problem.regions)
    shares = posterior.of(parameters.shares) if options.split_mu else None
    states = [_misfit(state) for state in found.states]
    noise_mm = states[0].expected_noise_rms_mm
    assert isinstance(noise_mm, float)
    return IdentificationRecord(
        parameters=parameter_facts(names, parameters, posterior),
        identifiability=IdentifiabilityRecord(
            singular_values=posterior.singular_values.tolist(),
            mu1_mu2_separable=separable(parameters, posterior),
            verdict=verdict(names, found.stiffness, shares),
        ),
        misfit=msgspec.structs.replace(
            states[0],
            weighted=float(found.residual @ found.residual),
            weighted_from_noise=float(sum(state.misfit.expected for state in found.states)),
        ),
        states=states,
        solver=_work(found, options),
        method=options.method,
        boundary=options.boundary,
        seed=options.seed,
        options=options,
        convergence=_convergence(found),
        agreement=agreement(found, names),
        notes=notes(found, names, states[0].rms_mm, noise_mm),
        stiffness_map=mapped,
    )


def _work(found: Identification, options: IdentifyOptions) -> SolverRecord:
    return SolverRecord(
        forward_solves=found.count.solves,
        newton_iterations=found.count.factorisations,
        failed=found.count.failed,
        reduced_evaluations=found.count.reduced,
        seconds=round(found.seconds, 2),
        element=options.element,
        unknowns=found.scene.assembler.pattern.n,
        linear_solver=found.scene.assembler.solver.name,
    )


def _misfit(state: StateProblem) -> MisfitRecord:
    """Eqs 10 to 13: every point to its own region's surface, points near the dividing line left out."""
    observation, u = state.scene.observation, state.equilibrium.u
    moved = observation.points + observation.operator @ u
    figures = misfit_figures(state.scene.problem, observation.points, observation.region, moved)
    marks = observation.landmark_residual(u)
    if len(marks):
        apart = float(np.sqrt((marks**2).sum(axis=1).mean()))
        figures = msgspec.structs.replace(figures, landmarks_rms_mm=apart)
    expected = float(np.sqrt(np.trace(state.misfit.noise) / len(observation.points)))
    return msgspec.structs.replace(figures, expected_noise_rms_mm=expected)


def _convergence(found: Identification) -> list[float | None]:
    return found.swarm.history.tolist() if found.swarm is not None else [*found.optimum.fit.history]


def _fields(found: Identification) -> dict[str, NDArray[np.generic]]:
    """What pictures need, in the rest frame, mm."""
    observation, space = found.scene.observation, found.scene.space
    vertices = len(space.mesh.points)
    fields: dict[str, NDArray[np.generic]] = {
        "mesh_displacement": found.equilibrium.u[:vertices],
        "surface_points": observation.points,
        "surface_displacement": observation.operator @ found.equilibrium.u,
        "surface_region": observation.region,
        "surface_residual": observation.residual(found.equilibrium.u),
        "theta": found.theta,
        "covariance": found.posterior.covariance,
    }
    if found.swarm is not None:
        fields["swarm_positions"] = found.swarm.positions
        fields["swarm_values"] = found.swarm.values
    return fields
