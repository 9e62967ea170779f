"""Diagnosis of a body on a bench, in the form of diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies import record
from palpate.core.diagnose.bench_bodies.fit import fit_body
from palpate.core.diagnose.bench_bodies.judge import BodyDiagnosis, judged
from palpate.core.diagnose.bench_bodies.problem import BodyProblem
from palpate.core.diagnose.diagnosis_record import DecidedByRecord, DiagnosisRecord, StiffnessRecord, WhereRecord
from palpate.core.diagnose.effects import Effect, library
from palpate.core.diagnose.options import DiagnosisJob, DiagnosisOptions
from palpate.core.diagnose.verdict.ranking import ranking
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE, UNKNOWN
from palpate.core.errors import InputError
from palpate.core.worker.checkpoint import save_checkpoint
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
    diagnosis, maps = diagnose_body(problem, effects, options.case, reporter.progress, options.numbers, job.seed)
    save_checkpoint(Path(job.folder) / MAP_FILE, maps, job.fingerprint())
    return diagnosis


def diagnose_body(
    problem: BodyProblem,
    effects: Mapping[str, Effect],
    case: str,
    progress: Progress = silent,
    options: DiagnosisOptions | None = None,
    seed: int = 1,
) -> tuple[DiagnosisRecord, dict[str, FloatArray]]:
    """Record of the diagnosis, and its arrays for pictures (`record.maps`).

    Raises InputError when nothing holds the body, ConvergenceError when no equilibrium is found.
    """
    options = options or DiagnosisOptions()
    base = fit_body(problem, options, part(progress, 0.0, 0.3))
    found = judged(base, effects, seed, part(progress, 0.3, 0.95))
    return _record(found, case), record.maps(base, found.lead)


def _record(diagnosis: BodyDiagnosis, case: str) -> DiagnosisRecord:
    """diagnosis.json for a body of this name."""
    base, found, decided, best = diagnosis.base, diagnosis.found, diagnosis.verdict, diagnosis.lead
    verdict, probability = decided.verdict, decided.probability
    told = best if verdict not in (NONE, UNKNOWN) else None
    return DiagnosisRecord(
        case=case,
        gap=record.gap(base, found.test),
        where=WhereRecord(map=MAP_FILE, regions=record.regions(base), peak_lps_mm=None),
        verdict=verdict,
        candidates=list(decided.candidates),
        ranking=ranking(base.plain, found.screened, found.refits, probability, record.gains_mm(diagnosis)),
        shrinkage=None if best is None or verdict == NONE else record.shrinkage(diagnosis, best),
        stiffness=StiffnessRecord(
            without_effect=record.plain_stiffness(base),
            with_effect=None if told is None else record.stiffness_with(told),
        ),
        next_measurement=record.next_state(base, best) if verdict == AMBIGUOUS and best is not None else None,
        why=decided.why,
        decided_by=DecidedByRecord(decided.decided_by, decided.why),
        in_words=record.words(base, verdict, diagnosis.named),
        probability_unknown=probability.get(UNKNOWN, 0.0),
        flags=record.flags(base),
        states=record.states(diagnosis, best),
        remainder=None if diagnosis.named is None else record.remainder(base, diagnosis.named),
        options=base.options,
        posterior=dict(decided.posterior),
    )
