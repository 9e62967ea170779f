"""The blind check's recipes: which effects are hidden, how far walls move, how stiff the halves are; all from one seed."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.validate.blind.noise_floor import noise_floor_mm
from palpate.validate.blind.recipe import Recipe
from palpate.validate.blind.simulator.effects import LIBRARY, OUTSIDE
from palpate.validate.simulated.contour_noise import SD_MM, ContourNoise
from palpate.validate.simulated.fillings import Filling, bladder_filling, rectum_filling, scaled_filling

# Pelves, of each of which many patients are made by stretching: the first half close to bladder and rectum, the others with fat between.
# Range of their two stiffnesses, kPa.
BUILDS, CLOSE_BUILDS, SHEAR_MODULI_KPA = 8, 4, (6.0, 60.0)
# Standard deviations that contours may have, mm; where even the strongest effect shows less than it shall, down to the best ones. What an
# effect shall show, in noise floors.
NOISE_MM, BEST_NOISE_MM, SHOWN_FLOORS = SD_MM, 0.12, (1.0, 6.0)
# In how many cases case.json states no size of the contours' error; where it does, the standard deviation of the logarithm of what it says
# over what is so. In how many the edge of the modelled region is free. Voxels in the slice and across, mm; errors of marks, mm.
_UNSTATED, _MISSTATED, _FREE_EDGE = 1 / 3, 0.2, 0.15
_VOXEL_MM, _MARKS_MM = ((0.8, 1.3), (0.8, 3.0)), (0.2, 0.6)
# For every patient that was looked at in vain the next one's walls move so much more, and its organ is so much softer; softest, kPa.
_FARTHER, _SOFTER, _SOFTEST_KPA = 1.15, 0.75, 4.0
# What the walls' motion cannot show while the region's edge is held: a body that is held all around carries its weight as a pressure.
_NEEDS_FREE_EDGE = "gravity_change"


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
    """Effects that leave one to six times the noise floor, where a pelvis can show it; in one of four the rectum empties.

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
        noise_floor_mm(noise) * float(np.exp(rng.uniform(*np.log(SHOWN_FLOORS)))),
        BEST_NOISE_MM,
        int(rng.integers(BUILDS)),
        rectum_filling(empties, rng),
        bladder_filling(empties, rng),
        marks=bool(rng.random() < 0.5),
    )
    own = recipe.random(7)  # so that patients are the same however many states they have
    return replace(_scanned(recipe), more=tuple(_filling(own) for _ in range(more)))


def _scanned(recipe: Recipe) -> Recipe:
    """With contour errors, voxels and an edge of its own."""
    rng = recipe.random(30)
    across, along = (round(float(rng.uniform(*limits)), 2) for limits in _VOXEL_MM)
    unstated, misstated = bool(rng.random() < _UNSTATED), float(np.exp(_MISSTATED * rng.standard_normal()))
    return replace(
        recipe,
        noise=ContourNoise.drawn(rng),
        stated_over_true=None if unstated else misstated,
        voxel_mm=(across, across, along),
        free_edge=_NEEDS_FREE_EDGE in recipe.effects or bool(rng.random() < _FREE_EDGE),
        marks_mm=float(rng.uniform(*_MARKS_MM)),
    )


def _filling(rng: np.random.Generator) -> Filling:
    """Of a further state, in which the rectum empties as often as it fills: so that states differ."""
    empties = bool(rng.random() < 0.5)
    return rectum_filling(empties, rng), bladder_filling(empties, rng)


def recipe_of(name: str, effects: Sequence[str], rng: np.random.Generator) -> Recipe:
    """One patient of one deformed state."""
    return _recipe(name, effects, rng, 0)


def another(recipe: Recipe) -> Recipe:
    """The same effects in another patient, one who shows more of them: of a close build, softer, with walls that move farther."""
    made = _recipe(recipe.name, tuple(recipe.effects), np.random.default_rng(recipe.seed), len(recipe.more))
    made = replace(made, instead_of=recipe.instead_of)
    if not recipe.effects:
        return made
    attempt = recipe.attempt + 1
    left, right = (max(_SOFTER**attempt * G, min(G, _SOFTEST_KPA)) for G in made.G)
    shown = replace(made, attempt=attempt, build=made.build % CLOSE_BUILDS, G=(round(left, 2), round(right, 2)))
    return _moved(shown, _FARTHER**attempt)


def instead(recipe: Recipe) -> Recipe:
    """Other effects than those tried first and last, as many, in another patient; without effects another patient."""
    if not recipe.effects:
        return another(recipe)
    kind = LIBRARY if set(recipe.effects) <= set(LIBRARY) else OUTSIDE
    others = sorted(set(kind) - set(recipe.effects) - set(recipe.instead_of))
    chosen = recipe.random(8).choice(others, len(recipe.effects), replace=False).tolist()
    first = recipe.instead_of or tuple(recipe.effects)
    begun = replace(recipe, effects=dict.fromkeys(chosen, 0.0), instead_of=first, attempt=-1)
    return another(begun)


def easier(recipe: Recipe, k: int) -> Recipe:
    """The recipe with walls that move less in every state, k times over."""
    share = 0.85**k
    return _moved(recipe, share)


def _moved(recipe: Recipe, share: float) -> Recipe:
    """With walls that move so much less or more in every state."""
    rectum, bladder = scaled_filling((recipe.rectum, recipe.bladder), share)
    return replace(recipe, rectum=rectum, bladder=bladder, more=tuple(scaled_filling(f, share) for f in recipe.more))
