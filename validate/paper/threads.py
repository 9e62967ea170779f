"""The paper's Fig 14: how the time for the particles falls with the number of workers."""

from __future__ import annotations

import os
from dataclasses import replace

from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.workers import WorkerFigures, worker_scaling


class ThreadsTable(WorkerFigures):
    """The bench's figures by number of workers, with the paper's words."""

    study: str
    paper: str


def threads(workers: tuple[int, ...] = (), quick: bool = False, progress: Progress = silent) -> ThreadsTable:
    """Seconds, speed-up and efficiency by number of worker processes; by default one, two and as many as there are cores."""
    cores = os.cpu_count() or 1
    workers = workers or tuple(sorted({1, 2, cores}))
    options = replace(BenchOptions(quick=quick).effective(), workers=workers)
    with one_thread():
        found = worker_scaling(options, progress)
    progress(1.0, "done")
    return {"study": "threads", **found, "paper": "the time falls almost linearly with the number of threads"}
