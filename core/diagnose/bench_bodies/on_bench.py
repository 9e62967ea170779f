"""Effects as a body on a bench can have them: the same in all states, with variants that know each state's gravity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.problem import BodyProblem
from palpate.core.diagnose.effects import Effect, Surroundings, Variant
from palpate.core.forward.composition import Composition

# Resolution: places where an effect could be are this far apart, over the cube root of the body's volume.
_SPACING = 0.6


class BodySurroundings(Surroundings):
    """Places in a body whose size is not an organ's."""

    def spread_points(self, candidates: FloatArray, spacing_mm: float) -> FloatArray:
        """As `Surroundings.spread_points`, wider apart in a large body."""
        size = float(self.problem.mesh.volumes.sum()) ** (1.0 / 3.0)
        return super().spread_points(candidates, max(spacing_mm, _SPACING * size))


def on_bench(effects: Mapping[str, Effect], problem: BodyProblem) -> dict[str, Effect]:
    """The effects that a body can have. Each has one size in all states, and in each state the variant that its gravity
    gives."""
    return {name: _on_bench(e, problem) for name, e in effects.items() if e.on_bench}


def _on_bench(effect: Effect, problem: BodyProblem) -> Effect:
    def variants(_: Surroundings) -> list[Variant]:
        each = [effect.variants(_around(problem, k)) for k in range(len(problem.states))]
        if len({len(v) for v in each}) != 1:
            return []
        return [_by_state(v) for v in zip(*each, strict=True)]

    return replace(effect, parameters=[replace(p, own=False) for p in effect.parameters], variants=variants)


def _by_state(variants: Sequence[Variant]) -> Variant:
    """In each state its own form."""

    def change(composition: Composition, phi: FloatArray) -> Composition:
        return variants[composition.state].change(composition, phi)

    return Variant(change, variants[0].name, variants[0].where)


def _around(problem: BodyProblem, state: int) -> BodySurroundings:
    gravity = problem.states[state].gravity
    modelled = gravity if problem.model_gravity else (0.0, 0.0, 0.0)
    return BodySurroundings(problem.shell, (modelled, gravity), density_kg_m3=problem.density_kg_m3)
