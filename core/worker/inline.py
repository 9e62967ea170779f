"""Run of a job in the caller's own process, for callers that are worker processes themselves."""

from __future__ import annotations

import json
from collections.abc import Callable

from palpate.core.worker.job import Job
from palpate.core.worker.messages import Message, Reporter, encode

# Function that runs a job: `process.run_job` in a new process, `run_inline` in this one. Its second argument receives
# every message.
DoJob = Callable[[Job, Callable[[Message], None]], dict[str, object]]


def run_inline(job: Job, on_message: Callable[[Message], None]) -> dict[str, object]:
    """Run a job here; return its result in the form of a worker process: arrays as lists, null for NaN.

    Raises the job's exceptions.
    """
    result = {"result": job.function()(job, Reporter(on_message))}
    return dict(json.loads(encode(result))["result"])
