"""Executor on a Dask cluster, with the interface of local processes (`concurrent.futures.Executor`)."""

from __future__ import annotations

import importlib
from concurrent.futures import Executor
from types import ModuleType
from typing import Any

from palpate.core.errors import InputError
from palpate.core.worker.executors import make_executor

_SECONDS_TO_ANSWER = 10.0


def study_executor(workers: int, cluster: str | None = None) -> Executor:
    """Executor of `workers` local processes, or of the Dask scheduler at `cluster` ("tcp://host:8786"), for calls
    without preparation.

    Every worker of the cluster needs this program in the same version. Results do not depend on the executor.
    Raises InputError when Dask is not installed here or the address does not answer.
    """
    if cluster is None:
        return make_executor(workers)
    distributed = _distributed()
    try:
        client: Any = distributed.Client(cluster, timeout=_SECONDS_TO_ANSWER)
        executor: Executor = client.get_executor(pure=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"no Dask scheduler answers at {cluster} ({error}); give the address that `dask scheduler` prints"
        ) from error
    return executor


def _distributed() -> ModuleType:
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise InputError(
            "--cluster needs Dask, which is not installed: `pip install distributed`, or leave --cluster out"
        ) from error
