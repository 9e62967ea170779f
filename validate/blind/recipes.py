"""The blind check's recipes: which effects are hidden, how far walls move, how stiff the halves are; all from one seed."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.simulate.walls import BladderSpec, RectumSpec
from palpate.validate.blind.noise_floor import noise_floor_mm
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.simulator.effects import LIBRARY, OUTSIDE

# Pelves, of each of which many patients are made by stretching, and the range of their two stiffnesses.
BUILDS, SHEAR_MODULI_KPA = 4, (6.0, 60.0)
# Standard deviations that contours may have, mm. With one alone no pelvis shows more than three times the noise of most effects, and
# nothing would be learnt of the larger ones.
NOISE_MM = (0.12, 0.4)


@dataclass(frozen=True)
class StudyOptions:
    """cases : how many. seed : of everything random. workers : processes at a time. timeout_s : for one diagnosis.

    states : deformed states of every patient. effect_free : nothing is hidden in any case.
    """

    cases: int = 60
    seed: int = 1
    workers: int = 1
    timeout_s: float = 900.0
    states: int = 1
    effect_free: bool = False


def recipes_of(options: StudyOptions) -> list[Recipe]:
    """A fifth without an effect, a fifth outside the library, a tenth with two effects, the others with one; all effects take turns.

    Effect-free alone: that fifth of five times as many.
    """
    if options.effect_free:
        return [r for r in recipes_of(replace(options, cases=5 * options.cases, effect_free=False)) if not r.effects]
    rng = np.random.default_rng(options.seed)
    inside, outside = (itertools.cycle(rng.permutation(sorted(names)).tolist()) for names in (LIBRARY, OUTSIDE))
    out = []
    for k in range(options.cases):
        chosen: Sequence[str] = ()
        if k % 10 in (2, 7):
            chosen = (next(outside),)
        elif k % 10 == 4:
            chosen = tuple(rng.choice(sorted(LIBRARY), 2, replace=False).tolist())
        elif k % 10 not in (0, 5):
            chosen = (next(inside),)
        out.append(_recipe(f"gap_{k:03d}", chosen, rng, options.states - 1))
    return out


def _recipe(name: str, chosen: Sequence[str], rng: np.random.Generator, more: int) -> Recipe:
    """Effects that leave one to ten times the noise floor, where a pelvis can show it; in one of four the rectum empties.

    more : deformed states beside the first.
    """
    low, high = (float(np.log(G)) for G in SHEAR_MODULI_KPA)
    G = np.exp(rng.uniform(low, high, 2)).round(2).tolist()
    empties = rng.random() < 0.25
    noise = round(float(np.exp(rng.uniform(*np.log(NOISE_MM)))), 3)
    recipe = Recipe(
        name,
        int(rng.integers(2**31)),
        dict.fromkeys(chosen, 0.0),
        (G[0], G[1]),
        noise,
        noise_floor_mm(noise) * float(10.0 ** rng.uniform()),
        NOISE_MM[0],
        int(rng.integers(BUILDS)),
        _rectum(empties, rng),
        _bladder(empties, rng),
        marks=bool(rng.random() < 0.5),
    )
    own = recipe.random(7)  # so that patients are the same however many states they have
    return replace(recipe, more=tuple(_filling(own) for _ in range(more)))


def _filling(rng: np.random.Generator) -> tuple[RectumSpec, BladderSpec]:
    """Of a further state, in which the rectum empties as often as it fills: so that states differ."""
    empties = bool(rng.random() < 0.5)
    return _rectum(empties, rng), _bladder(empties, rng)


def _rectum(empties: bool, rng: np.random.Generator) -> RectumSpec:
    back = float(rng.uniform(1.0, 3.0) if empties else -rng.uniform(2.0, 6.0))
    return RectumSpec(
        inflate_mm=float(rng.uniform(-7.0, -5.0) if empties else rng.uniform(6.5, 10.0)),
        bias=(float(rng.uniform(-0.4, 0.4)), float(rng.uniform(-0.2, 0.2))),
        push_mm=(float(rng.uniform(-1.5, 1.5)), back, 0.0),
        middle_mm=float(rng.uniform(-8.0, 8.0)),
        half_length_mm=float(rng.uniform(28.0, 38.0)),
    )


def _bladder(empties: bool, rng: np.random.Generator) -> BladderSpec:
    up = float(-rng.uniform(2.0, 5.0) if empties else rng.uniform(0.0, 2.0))
    return BladderSpec(balance=float(rng.uniform(0.3, 1.0)), push_mm=(0.0, float(rng.uniform(0.0, 2.0)), up))


def another(recipe: Recipe) -> Recipe:
    """The same effects in another patient."""
    made = _recipe(recipe.name, tuple(recipe.effects), np.random.default_rng(recipe.seed), len(recipe.more))
    return replace(made, instead_of=recipe.instead_of)


def instead(recipe: Recipe) -> Recipe:
    """Other effects, as many of the library or beside it, in another patient; without effects another patient."""
    if not recipe.effects:
        return another(recipe)
    kind = LIBRARY if set(recipe.effects) <= set(LIBRARY) else OUTSIDE
    others = sorted(set(kind) - set(recipe.effects))
    chosen = recipe.random(8).choice(others, len(recipe.effects), replace=False).tolist()
    first = recipe.instead_of or tuple(recipe.effects)
    return replace(another(recipe), effects=dict.fromkeys(chosen, 0.0), instead_of=first)


def easier(recipe: Recipe, k: int) -> Recipe:
    """The recipe with walls that move less in every state, k times over."""
    share = 0.85**k
    rectum, bladder = _less((recipe.rectum, recipe.bladder), share)
    return replace(recipe, rectum=rectum, bladder=bladder, more=tuple(_less(filling, share) for filling in recipe.more))


def _less(filling: tuple[RectumSpec, BladderSpec], share: float) -> tuple[RectumSpec, BladderSpec]:
    rectum, bladder = filling
    return (
        replace(rectum, inflate_mm=share * rectum.inflate_mm, push_mm=_scaled(rectum.push_mm, share)),
        replace(bladder, push_mm=_scaled(bladder.push_mm, share)),
    )


def _scaled(v: tuple[float, float, float], share: float) -> tuple[float, float, float]:
    return share * v[0], share * v[1], share * v[2]
