"""Fall of the organs of cases onto dishes, with the identified stiffness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from palpate.applications.dynamics.drop import Drop, DropOptions, dish_for, drop
from palpate.applications.dynamics.rigid import RigidSurface
from palpate.case.case_folder import CaseFolder
from palpate.case.identified import identified_shear
from palpate.case.problem import facts_of
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.fem.materials import Material
from palpate.core.laws import MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.mesh import TetMesh
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, part, silent
from palpate.imaging.labels import ORGAN_LABELS


@dataclass(frozen=True, eq=False)
class IdentifiedOrgan:
    """name : "A", "B", never a patient's. mesh : the organ's cells alone, LPS mm. stiffness_kpa : organ label -> G."""

    name: str
    mesh: TetMesh
    stiffness_kpa: dict[int, float]
    poisson_ratio: float

    @property
    def materials(self) -> dict[int, Material]:
        """The laws that the identification used."""
        return {r: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(G, bulk_modulus(G, self.poisson_ratio)))
                for r, G in self.stiffness_kpa.items()}  # fmt: skip


def organ_of(case: CaseFolder, name: str) -> IdentifiedOrgan:
    """The organ of a case. Raises InputError naming the file when its mesh or its stiffness is missing or wrong."""
    for needed, step in (("mesh.npz", "mesh"), ("result.json", "identify")):
        if not case.has(needed):
            raise InputError(f"{case.file(needed)} is not there; run `palpate {step}` on the case first")
    arrays, path = case.read_npz("mesh.npz"), case.file("mesh.npz")
    try:
        mesh = TetMesh(arrays["points"], arrays["cells"], arrays["regions"])
    except (KeyError, InputError) as error:
        raise InputError(f"{path} contains no valid mesh ({error}); remove it and run `palpate mesh` again") from error
    regions = tuple(r for r in ORGAN_LABELS if (mesh.regions == r).any())
    if not regions:
        raise InputError(f"{path} has no cell in the organ (regions 1, 2); run `palpate mesh` again")
    return IdentifiedOrgan(
        name, mesh.submesh(regions)[0], identified_shear(case, regions), facts_of(case).organ_poisson_ratio
    )


def run(cases: Sequence[CaseFolder], options: DropOptions | None = None, progress: Progress = silent) -> Dropped:
    """Fall of the organ of each case onto a dish of its own. All dishes have one size, wide enough for the widest
    organ.

    Raises InputError where a case is not identified, ConvergenceError where a motion cannot be followed.
    """
    options = options or DropOptions()
    organs = [organ_of(case, chr(ord("A") + k)) for k, case in enumerate(cases)]
    dish, drops = dish_for([organ.mesh for organ in organs]), list[Drop]()
    with one_thread():
        for k, organ in enumerate(organs):
            share = part(progress, k / len(organs), (k + 1) / len(organs))
            named = _named(share, organ.name) if len(organs) > 1 else share
            try:
                drops.append(drop(organ.mesh, organ.materials, dish, options, named))
            except ConvergenceError as error:
                raise ConvergenceError(f"organ {organ.name}: {error}; drop it from less height") from error
    return Dropped(tuple(organs), tuple(drops), dish)


@dataclass(frozen=True, eq=False)
class Dropped:
    """Organs, the fall of each, and the shape of their dishes."""

    organs: tuple[IdentifiedOrgan, ...]
    drops: tuple[Drop, ...]
    dish: RigidSurface


def _named(progress: Progress, name: str) -> Progress:
    return lambda fraction, message: progress(fraction, f"organ {name}, {message}")
