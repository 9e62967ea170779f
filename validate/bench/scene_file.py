"""The scene that all contenders solve: the paper's sphere in a cube (Fig 7) of neo-Hookean solids, as one npz."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import ORGAN, TISSUE
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.scenes import MU, TISSUE_G, TISSUE_NU, sphere_scene, standard_sphere_mesh
from palpate.core.laws import NEO_HOOKEAN, bulk_modulus
from palpate.validate.bench.halved_sphere import HalvedSphere

# The halved sphere of the identification: its mesh, moduli of its halves and their Poisson's ratio, noise of the displacements.
_HALVED, _TRUTH_KPA, _HALVED_NU, _NOISE_MM = (4, 2, 4), {1: 20.0, 2: 60.0}, 0.49, 0.01


@dataclass(frozen=True)
class BenchScene:
    """cells : about how many tetrahedra. element : "p1", "p2" or "p2p1". ratio : v1 / mu of the sphere. drive : see `sphere_scene`.

    Both solids are neo-Hookean, the one law that all contenders have with the same energy: G = 4 mu, K = 2 v1 in the sphere.
    """

    cells: int
    element: str
    ratio: float = 50.0
    drive: str = "displacement"

    @property
    def materials(self) -> dict[int, Material]:
        """By region."""
        sphere = np.array([4.0 * MU, 2.0 * self.ratio * MU])
        tissue = np.array([TISSUE_G, bulk_modulus(TISSUE_G, TISSUE_NU)])
        return {ORGAN: Material(NEO_HOOKEAN, sphere), TISSUE: Material(NEO_HOOKEAN, tissue)}


@dataclass(frozen=True)
class SceneSize:
    """Numbers of cells and of unknowns that are solved for."""

    cells: int
    unknowns: int


def write_identification(path: Path) -> SceneSize:
    """Write a scene whose sphere's halves are to be found: their surface's displacements at other moduli than the start's, with noise."""
    built = HalvedSphere(_HALVED, "p1")
    space, mesh, free = built.space, built.space.mesh, built.assembler.free
    moduli = {r: np.array([G, bulk_modulus(G, _HALVED_NU)]) for r, G in _TRUTH_KPA.items()}
    moduli[TISSUE] = np.array([TISSUE_G, bulk_modulus(TISSUE_G, TISSUE_NU)])
    found = solve_equilibrium(
        built.assembler, {r: Material(NEO_HOOKEAN, v) for r, v in moduli.items()}, built.prescribed
    )
    assert found.converged, found.reason
    noise = np.random.default_rng(0).normal(scale=_NOISE_MM, size=(len(built.observed), 3))
    G, K = np.array([moduli[int(r)] for r in mesh.regions]).T
    np.savez(
        path,
        nodes=space.nodes,
        cells=space.cell_nodes,
        regions=mesh.regions,
        G=G,
        K=K,
        fixed=~free.reshape(-1, 3),
        prescribed=np.where(free, 0.0, built.prescribed).reshape(-1, 3),
        force=np.zeros((space.n_nodes, 3)),
        corners=len(mesh.points),
        mixed=False,
        element="p1",
        unknown=np.array(sorted(_TRUTH_KPA)),
        observed=built.observed,
        measured=found.u[built.observed] + noise,
    )
    return SceneSize(len(mesh.cells), len(built.assembler.kept))


def write_scene(scene: BenchScene, path: Path) -> SceneSize:
    """Write the file that `peers/protocol.py` describes."""
    mesh = standard_sphere_mesh(scene.cells)
    built = sphere_scene(mesh, scene.element, scene.ratio, scene.drive)
    space, assembler = built.space, built.assembler
    force = np.zeros(space.n_displacements)
    for term in assembler.terms:
        np.add.at(force, term.unknowns, -term.evaluate(np.zeros((space.n_nodes, 3)), 1.0, 1)[1])
    G, K = np.empty(len(mesh.cells)), np.empty(len(mesh.cells))
    for region, material in scene.materials.items():
        G[mesh.regions == region], K[mesh.regions == region] = np.asarray(material.values, dtype=float)
    free = assembler.free.reshape(-1, 3)
    np.savez(
        path,
        nodes=space.nodes,
        cells=space.cell_nodes,
        regions=mesh.regions,
        G=G,
        K=K,
        fixed=~free,
        prescribed=np.where(free, 0.0, built.prescribed.reshape(-1, 3)),
        force=np.where(free, force.reshape(-1, 3), 0.0),
        corners=len(mesh.points),
        mixed=space.n_pressures > 0,
        element=scene.element,
    )
    return SceneSize(len(mesh.cells), len(assembler.kept))
