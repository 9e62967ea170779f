"""Walls of rectum and bladder moved by pressures in them, on the program's quadratic Taylor-Hood element."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.newton import NewtonOptions, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.pressure import FollowerPressure
from palpate.meshing.mesh_labels import MeshedCase
from palpate.simulate.stiffness import Stiffness

ELEMENT = "p2p1"
# The first pressure, kPa; by how much it may grow at a time, how many are tried, and from which share on of what was drawn the wall has
# moved enough.
_FIRST_KPA, _GROWS, _TRIES, _ENOUGH = 3.0, 2.5, 6, 0.9
# How far rectum and bladder move in the largest quarter of their nodes, mm: filling and emptying.
_FILLS_MM, _EMPTIES_MM = (4.0, 9.0), (3.0, 6.0)
# A wall that folds fights for minutes, and another patient is drawn in its place.
_OPTIONS = NewtonOptions(rtol=1e-6, stability=False, max_factorisations=40)


def solve_pressed(
    meshed: MeshedCase, stiffness: Stiffness, rng: np.random.Generator
) -> tuple[Space, FloatArray, dict[str, IntArray]]:
    """The space, displacement (n, 3) mm of its nodes, and nodes of the boundary by name; bone and the region's edge are held.

    The rectum fills and the bladder empties, or (one in four) the other way round. Pressure rises until the rectum's wall has moved
    as far as is drawn. Raises ConvergenceError when no pressure does so.
    """
    space = Space.of(meshed.mesh, ELEMENT)
    nodes = {name: np.unique(space.face_nodes(faces)) for name, faces in meshed.boundary.items()}
    free = np.ones((space.n_nodes, 3), dtype=bool)
    for name in ("bone", "outer"):
        free[nodes.get(name, np.zeros(0, dtype=np.int64))] = False
    empties = bool(rng.random() < 0.25)
    wanted = float(rng.uniform(*(_EMPTIES_MM if empties else _FILLS_MM)))
    share = {"rectum": -1.0 if empties else 1.0, "bladder": float(rng.uniform(0.2, 0.8)) * (1.0 if empties else -1.0)}
    pressure = _FIRST_KPA
    state: State | None = None
    found: FloatArray | None = None
    for _ in range(_TRIES):
        terms = [FollowerPressure.on(space, meshed.boundary[n], p * pressure) for n, p in share.items() if n in nodes]
        solved = solve_equilibrium(
            Assembler(space, free.ravel(), terms), stiffness.materials(), start=state, options=_OPTIONS
        )
        if not solved.converged:
            break
        found, state = solved.u, State(solved.u, solved.p)
        moved = _moved(found, nodes)
        if moved >= _ENOUGH * wanted:
            break
        pressure *= min(wanted / moved, _GROWS)
    if found is None or _moved(found, nodes) < 0.6 * wanted:
        raise ConvergenceError("no pressure moves the simulated walls as far as was drawn")
    return space, found, nodes


def _moved(u: FloatArray, nodes: Mapping[str, IntArray]) -> float:
    """How far the rectum's wall moved, mm: the upper quartile."""
    return float(np.quantile(np.linalg.norm(u[nodes["rectum"]], axis=1), 0.75))
