"""Diagnosis of a body on a bench, in the form of diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies import record
from palpate.core.diagnose.bench_bodies.fit import BodyFit
from palpate.core.diagnose.bench_bodies.judge import base_fit, decide_body, p_value
from palpate.core.diagnose.bench_bodies.problem import BodyProblem
from palpate.core.diagnose.bench_bodies.rivals import Rival, rivals
from palpate.core.diagnose.bench_bodies.scene import BodySolver
from palpate.core.diagnose.diagnosis_record import DecidedByRecord, DiagnosisRecord, StiffnessRecord, WhereRecord
from palpate.core.diagnose.effects import Effect, library
from palpate.core.diagnose.options import DiagnosisJob, DiagnosisOptions
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE, UNKNOWN
from palpate.core.errors import InputError
from palpate.core.worker.executors import one_thread
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.core.worker.progress import Progress, part, silent

MAP_FILE = "body_markers.npz"


def run(job: Job, reporter: Reporter) -> DiagnosisRecord:
    """Job kind "palpate.core.diagnose.bench_bodies.diagnose:run": as `palpate.core.diagnose.job.run`, for a body."""
    one_thread()
    path = Path(job.paths["data"])
    try:
        with np.load(path, allow_pickle=False) as archive:
            problem = BodyProblem.from_arrays({key: archive[key] for key in archive.files})
    except OSError as error:
        raise InputError(f"{path}: not readable ({error}); run diagnose again") from error
    options = job.options_as(DiagnosisJob)
    effects = library(options.folder)
    diagnosis, residuals = diagnose_body(problem, effects, options.case, reporter.progress, options.numbers)
    np.savez(Path(job.folder) / MAP_FILE, **residuals)  # type: ignore[arg-type]
    return diagnosis


def diagnose_body(
    problem: BodyProblem,
    effects: Mapping[str, Effect],
    case: str,
    progress: Progress = silent,
    options: DiagnosisOptions | None = None,
) -> tuple[DiagnosisRecord, dict[str, FloatArray]]:
    """Record of the diagnosis, and the markers' residuals (k, 3) mm by state.

    Raises ConvergenceError when no equilibrium is found.
    """
    options = options or DiagnosisOptions()
    solver = BodySolver.of(problem, options)
    progress(0.0, "plain model")
    base = base_fit(solver)
    p = p_value(base)
    ranked = rivals(base, effects, part(progress, 0.1, 0.7))
    decided = decide_body(base, ranked, p < options.decision_rules.level)
    verdict, probability = decided.verdict, decided.probability
    best = ranked[0] if ranked else None
    named = best if verdict not in (NONE, UNKNOWN, AMBIGUOUS) else None
    cause = _second(named.fit, effects, part(progress, 0.7, 1.0)) if named is not None else None
    out = DiagnosisRecord(
        case=case,
        gap=record.gap(base, p),
        where=WhereRecord(map=MAP_FILE, regions=record.regions(base), peak_lps_mm=None),
        verdict=verdict,
        candidates=list(decided.candidates),
        ranking=[record.row(base, f, probability[f.effect.id]) for f in ranked],
        shrinkage=None if best is None or verdict == NONE else record.shrinkage(best),
        stiffness=StiffnessRecord(
            without_effect=record.stiffness(base),
            with_effect=None if best is None or verdict in (NONE, UNKNOWN) else record.stiffness(best.fit),
        ),
        next_measurement=record.next_state(base, best) if verdict == AMBIGUOUS and best is not None else None,
        why=decided.why,
        decided_by=DecidedByRecord(decided.decided_by, decided.why),
        in_words=record.words(base, verdict, named),
        probability_unknown=probability.get(UNKNOWN, 0.0),
        states=record.states(base, best),
        remainder=None if named is None else record.remainder(named.fit, cause),
        options=options,
    )
    return out, {s.name: r for s, r in zip(problem.states, record.by_state(base), strict=True)}


def _second(named: BodyFit, effects: Mapping[str, Effect], progress: Progress) -> Rival | None:
    """Second effect beside the named one, if it passes the same evidence, p-value and prediction tests."""
    rules = named.model.solver.options.decision_rules
    for f in rivals(named, effects, progress):
        if f.log_evidence > np.log(rules.tied) and f.p_value < rules.level and f.predicts:
            return f
    return None
