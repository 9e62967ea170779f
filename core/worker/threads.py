"""Independent parts of one computation in threads of this process, with the same result for any number of them."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
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


@contextmanager
def beside(part: Callable[[A], T], items: Iterable[A]) -> Iterator[Callable[[], list[T]]]:
    """`part` of every item, one after another, in a thread beside what is done in the block.

    Yields a function that waits for all of them; it raises what a part raises. A block that raises starts no further
    part.
    """
    pool = ThreadPoolExecutor(1)
    try:
        parts = [pool.submit(part, item) for item in items]
        yield lambda: [one.result() for one in parts]
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
