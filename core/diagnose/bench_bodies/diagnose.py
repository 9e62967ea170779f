"""Diagnosis of a body on a bench, in the form of diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies import record
from palpate.core.diagnose.bench_bodies.fit import fit_body
from palpate.core.diagnose.bench_bodies.judge import decide_body, p_value
from palpate.core.diagnose.bench_bodies.kept_work import FILE, KeptWork
from palpate.core.diagnose.bench_bodies.problem import BodyProblem
from palpate.core.diagnose.bench_bodies.rivals import rivals, second_cause
from palpate.core.diagnose.diagnosis_record import DecidedByRecord, DiagnosisRecord, StiffnessRecord, WhereRecord
from palpate.core.diagnose.effects import Effect, library
from palpate.core.diagnose.options import DiagnosisJob, DiagnosisOptions
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE, UNKNOWN
from palpate.core.errors import InputError
from palpate.core.worker.checkpoint import save_checkpoint
from palpate.core.worker.executors import one_thread
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.core.worker.progress import Progress, part, silent

MAP_FILE = "body_markers.npz"


def run(job: Job, reporter: Reporter) -> DiagnosisRecord:
    """Job kind "palpate.core.diagnose.bench_bodies.diagnose:run": as `palpate.core.diagnose.job.run`, for a body.

    A job that was stopped goes on from the pieces of work that it had finished.
    """
    one_thread()
    path = Path(job.paths["data"])
    try:
        with np.load(path, allow_pickle=False) as archive:
            problem = BodyProblem.from_arrays({key: archive[key] for key in archive.files})
    except OSError as error:
        raise InputError(f"{path}: not readable ({error}); run diagnose again") from error
    options, key = job.options_as(DiagnosisJob), job.fingerprint()
    kept = KeptWork.load(Path(job.folder) / FILE, key)
    effects = library(options.folder)
    diagnosis, maps = diagnose_body(problem, effects, options.case, reporter.progress, options.numbers, kept)
    save_checkpoint(Path(job.folder) / MAP_FILE, maps, key)
    (Path(job.folder) / FILE).unlink(missing_ok=True)
    return diagnosis


def diagnose_body(
    problem: BodyProblem,
    effects: Mapping[str, Effect],
    case: str,
    progress: Progress = silent,
    options: DiagnosisOptions | None = None,
    kept: KeptWork | None = None,
) -> tuple[DiagnosisRecord, dict[str, FloatArray]]:
    """Record of the diagnosis, and its arrays for pictures (`record.maps`). kept : work of a run before.

    Raises InputError when nothing holds the body, ConvergenceError when no equilibrium is found.
    """
    options, kept = options or DiagnosisOptions(), kept or KeptWork()
    base = fit_body(problem, options, part(progress, 0.0, 0.3), kept)
    p = p_value(base)
    ranked = rivals(base, effects, kept, part(progress, 0.3, 0.95))
    decided = decide_body(base, ranked, p < options.decision_rules.level)
    verdict, probability = decided.verdict, decided.probability
    best = ranked[0] if ranked else None
    named = best if verdict not in (NONE, UNKNOWN, AMBIGUOUS) else None
    progress(0.95, "what the named effect leaves")
    cause = second_cause(base, named, ranked[1:], kept) if named is not None else None
    out = DiagnosisRecord(
        case=case,
        gap=record.gap(base, p),
        where=WhereRecord(map=MAP_FILE, regions=record.regions(base), peak_lps_mm=None),
        verdict=verdict,
        candidates=list(decided.candidates),
        ranking=[record.row(base, f, probability[f.effect.id]) for f in ranked],
        shrinkage=None if best is None or verdict == NONE else record.shrinkage(best),
        stiffness=StiffnessRecord(
            without_effect=record.plain_stiffness(base),
            with_effect=None if best is None or verdict in (NONE, UNKNOWN) else record.stiffness_with(best.fit),
        ),
        next_measurement=record.next_state(base, best) if verdict == AMBIGUOUS and best is not None else None,
        why=decided.why,
        decided_by=DecidedByRecord(decided.decided_by, decided.why),
        in_words=record.words(base, verdict, named),
        probability_unknown=probability.get(UNKNOWN, 0.0),
        flags=record.flags(base),
        states=record.states(base, best),
        remainder=None if named is None else record.remainder(base, named, cause),
        options=options,
    )
    return out, record.maps(base, best)
