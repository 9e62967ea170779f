"""Run a job in this process: for a caller that is a worker process itself."""

from __future__ import annotations

import json
from collections.abc import Callable

from palpate.core.worker.job import Job
from palpate.core.worker.messages import Message, Reporter, encode

# How a job is done: `process.run_job` in a process of its own, `run_inline` in this one. The second argument hears every message.
DoJob = Callable[[Job, Callable[[Message], None]], dict[str, object]]


def run_inline(job: Job, on_message: Callable[[Message], None]) -> dict[str, object]:
    """Do a job here and return its result, as it would have come from a worker process: arrays as lists, no NaN.

    Raises what the job raises.
    """
    result = {"result": job.function()(job, Reporter(on_message))}
    return dict(json.loads(encode(result))["result"])
