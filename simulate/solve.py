"""The deformed state of a simulation: equilibrium on a fine mesh of an element that no identification uses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.labels import ORGAN_LABELS
from palpate.meshing.mesh_labels import MeshedCase
from palpate.simulate.gliding_wall import Glide
from palpate.simulate.hidden_effects import HiddenEffect, with_effects
from palpate.simulate.hidden_figures import HiddenFigures, hidden_figures
from palpate.simulate.stiffness import Stiffness
from palpate.simulate.strain_figures import SolverFigures, organ_strain, smallest_volume_ratio, solver_figures
from palpate.simulate.wall_motion import MovedWall

ELEMENT = "p2"
# Gliding walls have found their place when a round moves them by less (rms), mm.
SETTLED_MM = 0.01
ROUNDS = 30
# Least and largest share of a change that is gone.
_PACES = (0.2, 1.5)
# On the rough walls of real contours they go on swinging: below this, an eighth of contour noise, that is said and kept.
ENOUGH_MM = 0.05
_OPTIONS = NewtonOptions(rtol=1e-6, stability=False)


@dataclass(frozen=True, eq=False)
class DeformedState:
    """What the simulation found.

    space : of the mesh at rest. u : (n, 3) mm at its nodes. boundary : name -> its nodes. strain : see `organ_strain`.
    solver : figures of the solve. hidden : what hidden effects do, None where there are none.
    """

    space: Space
    u: FloatArray
    boundary: Mapping[str, IntArray]
    strain: dict[str, float]
    solver: SolverFigures
    hidden: HiddenFigures | None = None


def solve_deformed(
    meshed: MeshedCase,
    stiffness: Stiffness,
    walls: Mapping[str, MovedWall],
    contact: str = "gliding",
    element: str = ELEMENT,
    progress: Progress = silent,
    hidden: Sequence[HiddenEffect] = (),
) -> DeformedState:
    """Equilibrium with bone and the region's edge fixed and the walls of hollow organs where their motions put them.

    contact : "tied", every wall point goes where its motion says, or "gliding", the wall's shape is that of the motion
    but the tissue slides along it without friction, as along an organ that gas or liquid has filled. hidden : what no analysis is told.

    Raises InputError where a hidden effect meets no cell, ConvergenceError when there is no equilibrium or the tissue would
    fold over itself.
    """
    space = Space.of(meshed.mesh, element)
    nodes = {name: np.unique(space.face_nodes(faces)) for name, faces in meshed.boundary.items()}
    prescribed = _prescribed(space, nodes, walls)
    free = np.ones((space.n_nodes, 3), dtype=bool)
    free[np.concatenate(list(nodes.values()))] = False
    assembler = Assembler(space, free.ravel())
    materials = with_effects(meshed.mesh, stiffness.materials(), hidden)
    progress(0.0, f"solving {len(meshed.mesh.cells)} cells, walls tied")
    found = solve_equilibrium(assembler, materials, prescribed.ravel(), options=_OPTIONS)
    _require(found)
    figures = solver_figures(space, found)
    if contact == "gliding":
        moving = {name: wall for name, wall in walls.items() if name in nodes}
        glides = [
            Glide.of(space, space.face_nodes(meshed.boundary[name]), wall, found.u, stiffness.tissue)
            for name, wall in moving.items()
        ]
        held = np.concatenate([points for name, points in nodes.items() if name not in moving])
        assembler, found, rounds, moved = _glide(space, held, glides, materials, found, progress)
        figures |= {"glide_rounds": rounds, "glide_last_motion_mm": moved}
    F = assembler.deformation_gradients(found.u)
    near = {name: (space.nodes[nodes[name]], found.u[nodes[name]]) for name in walls if name in nodes}
    figures |= {"contact": contact, "smallest_volume_ratio": smallest_volume_ratio(meshed, F, near)}
    organ = np.isin(meshed.mesh.regions, ORGAN_LABELS)
    strain = organ_strain(F[organ], assembler.weight[organ])

    def without(other: Mapping[int, Material]) -> Equilibrium:
        return solve_equilibrium(assembler, other, prescribed.ravel(), State(found.u, found.p), _OPTIONS)

    done = hidden_figures(meshed.mesh, found.u, stiffness, without) if hidden else None
    return DeformedState(space, found.u, nodes, strain, figures, done)


def _prescribed(space: Space, nodes: Mapping[str, IntArray], walls: Mapping[str, MovedWall]) -> FloatArray:
    """Displacements (n, 3) mm of the boundary's nodes; where boundaries meet, bone and the region's edge have the last word."""
    u = np.zeros((space.n_nodes, 3))
    for name, wall in walls.items():
        if name in nodes:
            u[nodes[name]] = wall.motion.displacement(space.nodes[nodes[name]])
    for name in {"bone", "outer"} & set(nodes):
        u[nodes[name]] = 0.0
    return u


def _glide(
    space: Space,
    held: IntArray,
    glides: Sequence[Glide],
    materials: Mapping[int, Material],
    tied: Equilibrium,
    progress: Progress,
) -> tuple[Assembler, Equilibrium, int, float]:
    """From the state with tied walls, let the walls slide along their new shapes until they stay where they are. held : other nodes of
    the boundary. Returns the assembler with the walls at that place, the state, rounds taken, and how far the last one moved, mm.
    """
    free = np.ones((space.n_nodes, 3), dtype=bool)
    free[held] = False
    assembler = Assembler(space, free.ravel(), glides)
    found, moved, pace, target, last = tied, np.inf, 1.0, tied.u, None
    for number in range(1, ROUNDS + 1):
        progress(
            number / (ROUNDS + 1),
            f"solving {len(space.mesh.cells)} cells, walls gliding, round {number} of at most {ROUNDS}",
        )
        assembler.terms = tuple(glide.linearised(target) for glide in glides)
        found = solve_equilibrium(assembler, materials, start=State(found.u, found.p), options=_OPTIONS)
        _require(found)
        change = found.u - target
        moved = max(glide.sliding(change) for glide in glides)
        if moved < SETTLED_MM:
            return assembler, found, number, float(moved)
        pace = pace if last is None else _relaxed(pace, last, change)
        target, last = target + pace * change, change
    if moved < ENOUGH_MM:
        return assembler, found, ROUNDS, float(moved)
    raise ConvergenceError(
        f"the gliding walls still move by {moved:.2f} mm after {ROUNDS} rounds; make the walls move less or set contact to 'tied'"
    )


def _relaxed(pace: float, last: FloatArray, change: FloatArray) -> float:
    """Share of the next change that is gone, from the last two: Aitken's relaxation (Küttler & Wall 2008), within `_PACES`."""
    turn = change - last
    share = -pace * float((last * turn).sum()) / max(float((turn**2).sum()), 1e-300)
    return float(np.clip(share, *_PACES))


def _require(found: Equilibrium) -> None:
    if not found.converged:
        raise ConvergenceError(
            f"the simulated deformation has no equilibrium ({found.reason}); make the walls move less"
        )
