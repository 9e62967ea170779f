"""Independent parts of one computation in threads of this process, with the same result for any number of them."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from palpate.core.worker.executors import cores

A = TypeVar("A")
T = TypeVar("T")


def in_threads(part: Callable[[A], T], items: Iterable[A]) -> list[T]:
    """`part` of every item, in their order; parts that release the interpreter's lock run side by side.

    Parts may not depend on each other, nor on how many threads there are. A worker of a pool computes on one thread, as
    its fellows take the other cores. Raises what a part raises.
    """
    todo = list(items)
    threads = min(1 if multiprocessing.parent_process() is not None else cores(), len(todo))
    if threads <= 1:
        return [part(item) for item in todo]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(part, todo))
