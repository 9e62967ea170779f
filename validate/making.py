"""The cases of a study, made one after the other or by several processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

from palpate.core.worker.progress import Progress

Item = TypeVar("Item")


def make_each(make: Callable[[Item], object], items: Sequence[Item], workers: int, progress: Progress) -> None:
    """make(item) for all items. With more than one worker `make` and the items must be picklable. Raises what `make` raises."""
    count = len(items)
    if workers < 2:
        for k, item in enumerate(items):
            progress(k / count, f"making {k + 1} of {count}")
            make(item)
        return
    with ProcessPoolExecutor(workers) as pool:
        running = [pool.submit(make, item) for item in items]
        for k, done in enumerate(as_completed(running)):
            done.result()
            progress((k + 1) / count, f"made {k + 1} of {count}")
