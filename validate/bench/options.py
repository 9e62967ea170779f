"""What `palpate bench` measures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

PARTS = ("equilibrium", "scaling", "reduced_model", "workers", "identification")


@dataclass(frozen=True)
class BenchOptions:
    """quick : small scenes, under a minute, no environment is made for the peers.

    parts : what to measure: of `PARTS`, or "steps", which takes minutes (`bench.steps`).
    sizes : about how many tetrahedra. ratios : v1 / mu. elements : "p1" at every ratio and drive, the others at `costly_ratio`.
    repeats : rounds in which all contenders solve in turn. rtol : relative residual. limit_s : for one solve.
    peers : names to look for (felupe, scikit-fem, calculix, dolfinx), None for all. peers_dir : where FElupe's and scikit-fem's
    environment is or shall be; None for the user's cache.
    scaling_sizes, scaling_elements : cost and memory. workers : worker counts. particles : solved by them.
    reduced_divisions : of the reduced model's scene; unseen : particles it is judged by.
    """

    quick: bool = False
    parts: tuple[str, ...] = PARTS
    sizes: tuple[int, ...] = (4000, 20000)
    ratios: tuple[float, ...] = (50.0, 200.0, 1000.0)
    drives: tuple[str, ...] = ("displacement", "traction")
    elements: tuple[str, ...] = ("p1", "p2", "p2p1")
    costly_ratio: float = 200.0
    repeats: int = 5
    rtol: float = 1e-8
    limit_s: float = 300.0
    peers: tuple[str, ...] | None = None
    peers_dir: Path | None = None
    scaling_sizes: tuple[int, ...] = (4000, 10000, 20000, 50000, 100000)
    scaling_elements: tuple[str, ...] = ("p1", "p1p1", "p2p1")
    workers: tuple[int, ...] = (1, 2, 4)
    particles: int = 40
    reduced_divisions: tuple[int, int, int] = (4, 2, 4)
    unseen: int = 200

    def effective(self) -> BenchOptions:
        """With the quick mode's own sizes put in."""
        if not self.quick:
            return self
        return replace(
            self,
            sizes=(1500,),
            ratios=(50.0,),
            drives=("displacement",),
            elements=("p1",),
            repeats=3,
            limit_s=20.0,
            scaling_sizes=(700, 1500, 4000),
            scaling_elements=("p1",),
            workers=(1, 2),
            particles=10,
            reduced_divisions=(2, 1, 2),
            unseen=50,
        )
