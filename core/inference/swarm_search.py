"""The swarm's search with evaluations in parallel."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

from palpate.core.arrays import FloatArray
from palpate.core.inference.swarm import Swarm

# Value of a position (N,); inf where it could not be evaluated.
Objective = Callable[[FloatArray], float]


def search(
    swarm: Swarm, executor: Executor, objective: Objective, after: Callable[[Swarm], None] | None = None
) -> Swarm:
    """Evaluate and move until a stopping rule is met; `after` is called with the swarm after every iteration.

    The order of values is the order of particles, whichever worker is done first: the number of workers changes nothing.
    """
    while not swarm.should_stop():
        swarm.tell(list(executor.map(objective, swarm.ask())))
        if after is not None:
            after(swarm)
    return swarm
