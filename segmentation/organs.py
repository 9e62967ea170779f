"""Bladder, rectum and prostate of a scene, each found with what was found before it out of the way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from palpate.core.statistics import rms
from palpate.core.worker.progress import Progress, silent
from palpate.segmentation.bladder.bladder import find_bladder
from palpate.segmentation.points_fit import claim_of
from palpate.segmentation.prompts import ORGANS, Prompts
from palpate.segmentation.prostate.prostate import find_prostate
from palpate.segmentation.rectum.rectum import find_rectum
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.working_grid import Mask, box_around, distance_of, distance_to

# A click this deep, as a share of the organ's greatest depth, and points so near to its surface, mm rms, confirm it. Chosen on
# 12 variants (tests/benchmarks/surface_error_fit.py draws such).
DEEP_SHARE, ON_SURFACE_MM = 0.5, 1.0


def find_organs(
    scene: Scene, prompts: Prompts, given: Mapping[str, Found], progress: Progress = silent
) -> dict[str, Found]:
    """Organs by name: the given ones as they are, the others as the picture shows them; absent where nothing is found."""
    organs = dict(given)
    own = {name: claim_of(scene, prompts, name) for name in ORGANS}
    taken = {name: _any(own[other] for other in ORGANS if other != name) & ~own[name] for name in ORGANS}
    progress(0.0, "bladder")
    if "bladder" not in organs:
        _keep(organs, "bladder", _led(scene, prompts, "bladder", lambda p: find_bladder(scene, p, taken["bladder"])))
    progress(0.45, "rectum")
    if "rectum" not in organs:
        bladder = _others(organs, ("bladder",), own["rectum"])
        avoid = taken["rectum"] if bladder[0] is None else taken["rectum"] | bladder[0]
        _keep(organs, "rectum", _led(scene, prompts, "rectum", lambda p: find_rectum(scene, p, avoid)))
    progress(0.6, "prostate")
    if "prostate" not in organs:
        others = _others(organs, ("bladder", "rectum"), own["prostate"])
        _keep(organs, "prostate", _led(scene, prompts, "prostate", lambda p: find_prostate(scene, p, *others)))
    return organs


def confirms(scene: Scene, mask: Mask, prompts: Prompts, organ: str) -> bool:
    """Whether what a person points at only confirms an organ as it was found without: a click deep inside of it, or six
    points on its surface."""
    if prompts.mode(organ) == "click":
        near = box_around(mask, 0.0)
        depth = np.zeros(mask.shape)
        depth[near] = distance_to(~mask[near], 1.0)
        return bool(depth[scene.index(prompts.seeds[organ])] >= DEEP_SHARE * depth.max())
    points = prompts.extremes.get(organ)
    if points is None:
        return False
    away = distance_of(np.asarray(points, dtype=float), mask, scene.grid)
    return rms(away) <= ON_SURFACE_MM


def _led(scene: Scene, prompts: Prompts, organ: str, find: Callable[[Prompts], Found | None]) -> Found | None:
    """The organ as points lead to it, or as it is found without them where they only confirm that: a click where the
    automatic result is right anyway draws it no better, and may draw it worse."""
    mode = prompts.mode(organ)
    if mode not in ("click", "extremes"):
        return find(prompts)
    alone = find(prompts.without(organ))
    if alone is not None and alone.mask.any() and confirms(scene, alone.mask, prompts, organ):
        return replace(alone, method=mode)
    return find(prompts)


def _keep(organs: dict[str, Found], name: str, found: Found | None) -> None:
    if found is not None and found.mask.any():
        organs[name] = found


def _others(organs: Mapping[str, Found], names: Sequence[str], own: Mask) -> list[Mask | None]:
    """Masks of organs that were found, but for what a person's points make another organ's own."""
    return [np.asarray(organs[name].mask) & ~own if name in organs else None for name in names]


def _any(masks: Iterable[Mask]) -> Mask:
    return np.logical_or.reduce(list(masks))
