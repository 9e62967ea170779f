"""Simulators of patients without anything hidden, by name: each another geometry, element and way in which walls move.

blind : the blind check's own: scikit-fem, quadratic displacement with one pressure a cell, its own pelves, walls that stick to the
tissue. phantom : the analytic phantom of `palpate simulate`, whose prostate lies in a centimetre of fat; the program's element p2p0,
tissue that glides along the walls. pressure : the blind check's pelves of other builds with the program's element p2p1; pressures in
rectum and bladder move the walls, so that how a wall moves along itself comes out of the equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.errors import ConvergenceError, InputError
from palpate.core.mesh import TetMesh
from palpate.imaging.labels import ORGAN_LABELS
from palpate.meshing.mesh_labels import MeshedCase, MeshOptions, mesh_labels
from palpate.simulate.inverse_map import BackwardMap
from palpate.simulate.solve import solve_deformed
from palpate.simulate.source import PhantomSource
from palpate.simulate.stiffness import Stiffness
from palpate.simulate.wall_motion import MovedWall
from palpate.simulate.walls import moved_walls
from palpate.validate.blind.patient import Pose, carried_walls
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.simulator.fem import Body
from palpate.validate.blind.simulator.patients import Carried, Patient
from palpate.validate.blind.simulator.pelvis import Pelvis
from palpate.validate.calibration.pressed_walls import solve_pressed
from palpate.validate.simulated.fillings import drawn_filling
from palpate.validate.simulated.moved_body import ForwardMap, wall_nodes
from palpate.validate.simulated.two_states import TwoStates

# Of the meshers' random numbers: no mesh of an identification has it.
_SEED = 77
# Patients that are looked at for one whose walls can move as was drawn; voxels that scans of them have, in the slice and across, mm.
_PATIENTS, VOXEL_MM = 8, ((0.8, 1.5), (0.8, 3.0))
_EDGE_MM = {"blind": 6.5, "phantom": 5.0, "pressure": 6.0}
_BUILDS = {"blind": range(4), "pressure": range(100, 104)}


@dataclass(frozen=True)
class Drawn:
    """What a simulator is asked for. rng : of everything else. G : of left and right, kPa. meshes : folder of kept meshes."""

    rng: np.random.Generator
    G: tuple[float, float]
    meshes: Path | None = None

    @property
    def by_label(self) -> dict[int, float]:
        """G by label, kPa."""
        return dict(zip(ORGAN_LABELS, self.G, strict=True))


Simulator = Callable[[Drawn], TwoStates]


def blind(drawn: Drawn) -> TwoStates:
    """See the module. Raises ConvergenceError when there is no equilibrium, InputError when the bladder cannot give off so much."""
    patient, meshed = _pelvis("blind", drawn)
    rectum, bladder = drawn_filling(drawn.rng)
    walls = carried_walls(patient, (rectum, bladder))
    body = Body(meshed.mesh.points, meshed.mesh.cells, meshed.mesh.regions)
    recipe = Recipe("plain", int(drawn.rng.integers(2**31)), G=drawn.G)
    pose = Pose(recipe, patient, body, meshed, walls)
    u = pose.without
    nodes = {name: np.unique(body.face_nodes(faces)) for name, faces in meshed.boundary.items()}
    warp = BackwardMap(body, u, nodes, walls)
    return _states(patient, warp, drawn)


def phantom(drawn: Drawn) -> TwoStates:
    """See the module. Raises as `blind`."""
    source = PhantomSource()
    meshed = mesh_labels(source.model_labels, MeshOptions(edge_mm=_EDGE_MM["phantom"], seed=_SEED), drawn.meshes)
    patient = Patient.of(source, drawn.rng)
    walls = {
        name: MovedWall(wall.surface.with_points(patient.made(wall.surface.points)), Carried(wall.motion, patient))
        for name, wall in moved_walls(source.model_labels, *drawn_filling(drawn.rng)).items()
    }
    state = solve_deformed(_in(patient, meshed), Stiffness(drawn.by_label), walls, "gliding", "p2p0")
    warp = BackwardMap(state.space, state.u, state.boundary, {name: wall.motion for name, wall in walls.items()})
    return _states(patient, warp, drawn)


def pressure(drawn: Drawn) -> TwoStates:
    """See the module. Raises ConvergenceError when there is no equilibrium."""
    patient, meshed = _pelvis("pressure", drawn)
    space, u, nodes = solve_pressed(meshed, Stiffness(drawn.by_label), drawn.rng)
    return _states(patient, BackwardMap(space, u, nodes, wall_nodes(space, u, nodes)), drawn)


SIMULATORS: Mapping[str, Simulator] = {"blind": blind, "phantom": phantom, "pressure": pressure}


def _pelvis(name: str, drawn: Drawn) -> tuple[Patient, MeshedCase]:
    """A stretched pelvis, and its mesh."""
    source = Pelvis.of(int(drawn.rng.choice(_BUILDS[name])))
    meshed = mesh_labels(source.model_labels, MeshOptions(edge_mm=_EDGE_MM[name], seed=_SEED), drawn.meshes)
    patient = Patient.of(source, drawn.rng)
    return patient, _in(patient, meshed)


def _in(patient: Patient, meshed: MeshedCase) -> MeshedCase:
    mesh = meshed.mesh
    return MeshedCase(TetMesh(patient.made(mesh.points), mesh.cells, mesh.regions), meshed.boundary, meshed.quality)


def _states(patient: Patient, warp: BackwardMap, drawn: Drawn) -> TwoStates:
    grid = patient.grid
    low, high = grid.to_lps(np.array([np.zeros(3), np.array(grid.array.shape) - 1.0]))
    moved = ForwardMap(warp)
    return TwoStates(patient.labels, warp.rest_points, moved.displacement, low, high, drawn.by_label)


def solved_states(simulator: str, rng: np.random.Generator, G: tuple[float, float], meshes: Path | None) -> TwoStates:
    """Both states of the first patient whose walls can move as was drawn. Raises ConvergenceError when none of eight can."""
    for _ in range(_PATIENTS):
        try:
            return SIMULATORS[simulator](Drawn(rng, G, meshes))
        except (ConvergenceError, InputError) as error:
            why = error
    raise ConvergenceError(f"none of {_PATIENTS} simulated patients has an equilibrium ({why})")
