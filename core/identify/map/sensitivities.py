"""Derivative of the plain fit's weighted data in ln G of each patch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.sensitivity import Direction, direct
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.identify.map.patches import Patches
from palpate.core.identify.misfit import Misfit
from palpate.core.residual.plain_fit import PlainFit


def patch_sensitivities(
    fit: PlainFit, solved: Sequence[tuple[CompositionScene, Equilibrium]], patches: Patches
) -> FloatArray:
    """(rows of all states' data, n) at the fit. solved : every deformed state there, with the element that is to be used; one
    back-substitution a patch."""
    at, moves = [], []
    for scene, equilibrium in solved:
        points = scene.observation.all_points
        fields = direct(equilibrium.tangent, patch_directions(scene, fit.linearisation.theta, patches))
        at.append(points @ scene.seen(equilibrium.u))
        moves.append(np.stack([points @ field for field in fields]))
    return Misfit.of(fit).jacobian(at, moves)


def patch_directions(scene: CompositionScene, theta: FloatArray, patches: Patches) -> list[Direction]:
    """Derivatives of the laws' parameters in ln G of each patch, where every region has its value of theta (t,): every
    parameter is proportional to G."""
    values = scene.parameters.materials(theta)
    regions = scene.problem.mesh.regions[patches.cells]
    out: list[Direction] = []
    for j, region in enumerate(patches.region):
        inside = (patches.patch == j)[regions == region]
        out.append({int(region): inside[:, None] * np.asarray(values[int(region)].values)})
    return out
