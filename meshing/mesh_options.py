"""What mesh a caller wants."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MeshOptions:
    """What mesh is wanted.

    target_tets : number of cells to aim at; not looked at when ``edge_mm`` is given. 7,000 suits quadratic elements.
    edge_mm : wished edge on the organ's surface. far_factor : edges far away are at most this much longer.
    grading : growth of the edge per mm of distance from the organ. seed : of the mesher's random numbers: another is another mesh.
    """

    target_tets: int = 7000
    edge_mm: float | None = None
    far_factor: float = 4.0
    grading: float = 0.5
    seed: int = 0
