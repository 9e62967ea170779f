"""Motion of everything as a whole: of contours, taken off before the fit; of images, told where the posterior tells nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.files.atomic import atomic_path
from palpate.core.identify.pair.rigid_pair import rigid_pair
from palpate.core.inference.posterior import unknown
from palpate.core.residual.case_data import arrays_of_state, load_state
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.surfaces.rigid_motion import rigid_motion

# Weighted square over its expectation up to which matched motion is called that of one rigid body: data that tell a
# stiffness are many times as far from one.
_RIGID = 2.0


def laid_on_itself(file: Path, folder: Path) -> tuple[Path, str]:
    """File of a deformed state to be fitted, and what its contours say of a motion as a whole; "" where they say another.

    file : of the state, as `arrays_of_state` gives it. Where contours of a body without bones are explained by a rigid motion,
    a file in `folder` without that motion takes its place: nothing says that they lie in one frame. Bones do, and images.
    """
    problem, bones = load_state(file)
    if problem.matched is not None:
        return file, ""
    pair = rigid_pair(problem)
    if not pair.nothing_deformed:
        return file, ""
    if bones is not None:
        return file, pair.in_words
    laid = folder / f"{file.stem}_laid.npz"
    with atomic_path(laid) as temporary, temporary.open("wb") as out:
        arrays: dict[str, Any] = arrays_of_state(pair.undone(problem), bones)
        np.savez(out, **arrays)
    return laid, pair.in_words


def motion_in_words(fit: PlainFit, of_contours: str) -> str:
    """Sentence on a motion as a whole, of the first state, for a fit that tells no stiffness; "" for any other.

    of_contours : what `laid_on_itself` says.
    """
    if not unknown(fit.posterior.of(fit.linearisation.first.scene.parameters.stiffness)).all():
        return ""
    return _of_images(fit) or of_contours


def _of_images(fit: PlainFit) -> str:
    motion, organ = fit.linearisation.first.scene.observation.motion, fit.linearisation.first.scene.observation.points
    if not motion.n:
        return ""
    pivot = organ.mean(axis=0)
    moves = np.stack([motion.modes_of(rigid_motion(motion.rows.nodes, pivot, unit)) for unit in np.eye(6)], axis=1)
    seen = motion.reader @ motion.rows.value
    found, *_ = np.linalg.lstsq(moves, seen, rcond=None)
    left = seen - moves @ found
    if left @ left > _RIGID * max(len(seen) - 6, 1):
        return ""
    return (
        f"by its images, the second scan shows prostate and surroundings moved as a whole, by {np.linalg.norm(found[:3]):.1f} mm and "
        f"{np.linalg.norm(found[3:]):.1f} degrees; what is left is within the images' noise"
    )
