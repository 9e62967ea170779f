"""A patient of the blind check in equilibrium: at rest and deformed, with what is hidden and without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from palpate.core.arrays import FloatArray, IntArray
from palpate.imaging.labels import ORGAN_LABELS
from palpate.meshing.mesh_labels import MeshedCase
from palpate.simulate.wall_motion import WallMotion
from palpate.simulate.walls import BladderSpec, RectumSpec, moved_walls
from palpate.validate.blind.noise_floor import noise_floor_mm
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.simulator.effects import LIBRARY, OUTSIDE, SIZES
from palpate.validate.blind.simulator.fem import Body
from palpate.validate.blind.simulator.patients import Carried, Patient
from palpate.validate.blind.simulator.simulated_body import Simulated
from palpate.validate.blind.simulator.states import Shown, shown, shown_further
from palpate.validate.blind.simulator.strength import strength
from palpate.validate.blind.simulator.visibility import effect_rows, joint_mm

# The walls' motions, and the displacement (n, 3) mm of a plain body that was not deformed at rest.
PlainState = tuple[Mapping[str, WallMotion], FloatArray]


@dataclass(frozen=True, eq=False)
class Further:
    """A further deformed state: the body as it is then, the state, and `without` as in `Made`. shares : see `Recipe.shares`."""

    shares: Mapping[str, float]
    hidden: Simulated
    deformed: Shown
    without: FloatArray


@dataclass(frozen=True, eq=False)
class Made:
    """A simulated patient: with its effects and without, its boundary's faces, walls, the state at rest and those deformed.

    without : (n, 3) mm, the deformed state of a plain body that was not deformed at rest. more : deformed states beside the first.
    """

    patient: Patient
    hidden: Simulated
    plain: Simulated
    boundary: Mapping[str, IntArray]
    walls: Mapping[str, WallMotion]
    rest: Shown
    deformed: Shown
    without: FloatArray
    more: tuple[Further, ...] = ()

    @cached_property
    def effect_mm(self) -> tuple[float, float]:
        """What is to be seen of the effects in all deformed states together, see `seen.joint_mm`."""
        one = (self.hidden, self.deformed, self.without)
        states = [one, *((more.hidden, more.deformed, more.without) for more in self.more)]
        return joint_mm([effect_rows(s, self.plain, self.boundary, self.rest, u, near) for s, u, near in states])


def carried_walls(patient: Patient, filling: tuple[RectumSpec, BladderSpec]) -> dict[str, WallMotion]:
    """A patient's walls, moved by a filling of rectum and bladder. Raises InputError when the bladder cannot give off so much."""
    moved = moved_walls(patient.source.model_labels, *filling)
    return {name: Carried(wall.motion, patient) for name, wall in moved.items()}


@dataclass(frozen=True, eq=False)
class Pose:
    """A patient whose walls are to move, before anything is hidden."""

    recipe: Recipe
    patient: Patient
    body: Body
    meshed: MeshedCase
    walls: Mapping[str, WallMotion]
    known: list[tuple[dict[str, float], Made]] = field(default_factory=list)

    @property
    def boundary(self) -> Mapping[str, IntArray]:
        """Faces (f, 3) of what holds or moves the body, by name."""
        return {n: f for n, f in self.meshed.boundary.items() if n != "outer" or not self.recipe.free_edge}

    @cached_property
    def without(self) -> FloatArray:
        return shown(self._plain(), self.boundary, self.walls)[1].u

    def _plain(self) -> Simulated:
        faces, _ = self.meshed.mesh.region_boundary(ORGAN_LABELS)
        return Simulated.plain(self.body, faces, dict(zip(ORGAN_LABELS, self.recipe.G, strict=True)))

    def _hidden(self, effects: Mapping[str, float]) -> Simulated:
        """Places and directions of an effect do not depend on its size."""
        hidden = self._plain()
        for name, size in effects.items():
            (LIBRARY | OUTSIDE)[name](hidden, size, self.recipe.random(5))
        return hidden

    def made(self, effects: Mapping[str, float]) -> Made:
        """With effects of these sizes."""
        alike = [(sizes, made) for sizes, made in self.known if set(sizes) == set(effects)]
        if alike and alike[-1][0] == dict(effects):
            return alike[-1][1]
        hidden = self._hidden(effects)
        boundary = self.boundary
        near = alike[-1][1].deformed.u if alike else self.without
        states = shown(hidden, boundary, self.walls, near)
        out = Made(self.patient, hidden, self._plain(), boundary, self.walls, *states, self.without)
        self.known.append((dict(effects), out))
        return out

    def strength(self, name: str) -> float:
        """Size at which an effect alone shows what the recipe wants. Raises as `strength.strength`."""
        wanted = self.recipe.shown_mm
        assert wanted is not None

        def shown_mm(size: float) -> float:
            return self.made({name: size}).effect_mm[1]

        return strength(wanted, SIZES[name], shown_mm, noise_floor_mm(self.recipe.best_noise_mm))

    def plain_further(self) -> list[PlainState]:
        """The recipe's further states before anything is hidden. Raises ConvergenceError, InputError as `carried_walls`."""
        walls = [carried_walls(self.patient, filling) for filling in self.recipe.more]
        return [(w, shown(self._plain(), self.boundary, w)[1].u) for w in walls]

    def further(self, effects: Mapping[str, float], made: Made, plain: Sequence[PlainState]) -> Made:
        """The patient in further deformed states too, of which `plain` is what `plain_further` gave. Raises ConvergenceError."""
        more = []
        for (walls, without), shares in zip(plain, self.recipe.shares(), strict=True):
            hidden = self._hidden({name: size * shares.get(name, 1.0) for name, size in effects.items()})
            near = made.rest.u + without
            deformed = shown_further(hidden, self.boundary, made.rest, walls, near)
            more.append(Further(shares, hidden, deformed, without))
        return replace(made, more=tuple(more)) if more else made
