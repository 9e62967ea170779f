"""Diagnosis as a job of the worker process: case data in one file, content of diagnosis.json and maps out."""

from __future__ import annotations

from pathlib import Path

import msgspec

from palpate.core.diagnose.diagnose import FITTED, diagnose
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.options import DiagnosisJob
from palpate.core.diagnose.verdict.record import MAP_FILE, maps, record
from palpate.core.residual.case_data import load
from palpate.core.residual.fit_file import FILE, fit_of
from palpate.core.worker.checkpoint import save_checkpoint
from palpate.core.worker.executors import one_thread
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.core.worker.progress import part


def run(job: Job, reporter: Reporter) -> DiagnosisRecord:
    """Job kind "palpate.core.diagnose.job:run".

    paths: data (npz of `case_data.arrays`). options: `DiagnosisJob`.

    Writes the maps, and a fit that `identify` has not kept, into the job's folder and returns diagnosis.json.
    """
    one_thread()  # the order of sums, and with it the last bits, must not depend on the machine's cores
    data = load(Path(job.paths["data"]))
    options = job.options_as(DiagnosisJob)
    numbers, files = options.numbers, [Path(job.folder) / FILE]
    if options.fit is not None:
        files.insert(0, Path(options.fit))
    progress = part(reporter.progress, 0.0, FITTED)
    fit, notes = fit_of(data, numbers.noise_model, numbers.wall_motion, files, progress)
    diagnosis = diagnose(data, library(options.folder), reporter.progress, job.seed, numbers, fit)
    save_checkpoint(Path(job.folder) / MAP_FILE, maps(diagnosis), job.fingerprint())
    found = record(diagnosis, options.case)
    return msgspec.structs.replace(found, flags=[*found.flags, *notes])
