"""Bladder, rectum and prostate of a scene, each found with what was found before it out of the way."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.worker.progress import Progress, silent
from palpate.segmentation.bladder.bladder import find_bladder
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.prostate.prostate import find_prostate
from palpate.segmentation.rectum.rectum import find_rectum
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.working_grid import Mask


def find_organs(
    scene: Scene, prompts: Prompts, given: Mapping[str, Found], progress: Progress = silent
) -> dict[str, Found]:
    """Organs by name: the given ones as they are, the others as the picture shows them; absent where nothing is found."""
    organs = dict(given)
    progress(0.0, "bladder")
    if "bladder" not in organs:
        _keep(organs, "bladder", find_bladder(scene, prompts))
    progress(0.45, "rectum")
    if "rectum" not in organs:
        _keep(organs, "rectum", find_rectum(scene, prompts, _mask(organs, "bladder")))
    progress(0.6, "prostate")
    if "prostate" not in organs:
        found = find_prostate(scene, prompts, _mask(organs, "bladder"), _mask(organs, "rectum"))
        _keep(organs, "prostate", found)
    return organs


def _keep(organs: dict[str, Found], name: str, found: Found | None) -> None:
    if found is not None and found.mask.any():
        organs[name] = found


def _mask(organs: Mapping[str, Found], name: str) -> Mask | None:
    found = organs.get(name)
    return None if found is None else np.asarray(found.mask)
