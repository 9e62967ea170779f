"""Parallel evaluations through `concurrent.futures`, with the same result for any number of workers.

Every process computes on one thread: threads inside a solve change the order of sums, and processes scale better here.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

T = TypeVar("T")

ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


def make_executor(
    workers: int, initializer: Callable[..., None] | None = None, initargs: tuple[object, ...] = ()
) -> Executor:
    """Executor of `workers` workers, each prepared by `initializer(*initargs)`; `map` gives results in order.

    One worker is this process itself. More are new processes, so functions and arguments must be importable and
    picklable. They end with this process, however it ends.
    """
    if workers <= 1:
        return SerialExecutor(initializer, initargs)
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, context, _prepare_worker, (initializer, initargs))


def one_more_process() -> Executor:
    """Executor of one new process, on one thread, beside this one; see `make_executor`."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _prepare_worker, (None, ()))


class SerialExecutor(Executor):
    """Executor that makes each call at once in this process, on one thread. `submit` raises the call's exception."""

    def __init__(self, initializer: Callable[..., None] | None = None, initargs: tuple[object, ...] = ()) -> None:
        self._limits = one_thread()
        if initializer is not None:
            initializer(*initargs)

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """A future that is done."""
        future: Future[T] = Future()
        future.set_result(fn(*args, **kwargs))
        return future

    def map(
        self, fn: Callable[..., T], *iterables: Iterable[Any], timeout: float | None = None, chunksize: int = 1
    ) -> Iterator[T]:
        """Results, each computed on demand, so that a caller can report progress."""
        return map(fn, *iterables)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Gives the process its threads back."""
        self._limits.restore_original_limits()


def one_thread() -> threadpool_limits:
    """Limit BLAS and OpenMP to one thread: loaded libraries by their own call, later ones by the environment.

    Numba refuses a change of its variable once its threads run; our kernels use no threads.
    """
    os.environ.update({k: v for k, v in ONE_THREAD.items() if k != "NUMBA_NUM_THREADS" or "numba" not in sys.modules})
    return threadpool_limits(1)


def _prepare_worker(initializer: Callable[..., None] | None, initargs: tuple[object, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that owns the pool decides
    threading.Thread(target=_end_with_parent, daemon=True).start()
    one_thread()
    if initializer is not None:
        initializer(*initargs)


def _end_with_parent() -> None:
    """End this worker when its parent ends. It would not notice while it waits for work: it holds both ends of the
    queue.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
