"""How far the walls slid, as contours, landmarks and bones have it, and the scene with walls that slide so far.

In the fit the slip is an unknown with a normal prior that is marginalised: its response R is part of the covariance S
of the data. Its posterior mean is -R' S^-1 r at the residual r of these data. Matched motion is left out: what it says of a slip
holds together with what it says of the region's edge, the alignment and the local error, which no scene shows. That slip alone would
put the organ's surface farther from its contour than the fit has it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.wall_motion import WallMotion
from palpate.core.residual.noise_covariance import data_per_force, slide_responses
from palpate.core.residual.plain_fit import PlainFit


def likely_slips(fit: PlainFit, state: int) -> dict[str, WallMotion]:
    """The walls' motions of a deformed state, with the likeliest slip; unchanged where none is known."""
    at, rows = fit.linearisation.each[state], fit.model.rows[state]
    scene, data = at.scene, fit.model.data_vectors[state]
    out = dict(scene.geometry.motions)
    if all(motion.slip is None for motion in out.values()):
        return out
    per_force = data_per_force(scene, data, at.equilibrium)
    weighted = _without_motion(fit)[rows]
    for (name, motion), wall in zip(scene.geometry.motions.items(), scene.walls, strict=True):
        if motion.slip is None:
            continue
        half = motion.slip.at(wall.rest - wall.points.displacements(scene.shift))
        amplitude = -float(np.dot(slide_responses(scene, per_force, wall, half[None])[:, 0], weighted))
        slip = replace(motion.slip, factor=motion.slip.factor + amplitude)
        out[name] = replace(motion, slip=slip)
    return out


def _without_motion(fit: PlainFit) -> FloatArray:
    """S^-1 r (n,) of all data but matched motion, 0 there."""
    r, told = fit.linearisation.residual, np.ones(fit.model.n, dtype=bool)
    for rows, data in zip(fit.model.rows, fit.model.data_vectors, strict=True):
        told[rows][data.motion] = False
    out = np.zeros(len(r))
    out[told] = Weighting(fit.weighting.covariance[np.ix_(told, told)]).apply(r[told])
    return out


def slid(fit: PlainFit, state: int, scene: CompositionScene) -> CompositionScene:
    """A scene of the fit's deformed state, of any element, with walls that slide as far as is likely."""
    if not scene.geometry.motions:
        return scene
    return CompositionScene(replace(scene.geometry, motions=likely_slips(fit, state)), scene.composition)
