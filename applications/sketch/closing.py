"""The residual of smooth forces, closed by springs that pull the rim onto the keyframe's line.

Few smooth forces do not reach every drawn pose. Every observed point of the rim gets a spring to its partner on the
line; all springs have one stiffness, the least that reaches the keyframe. Their targets can be moved, so that the path
between two keyframes consists of equilibria too, where forces alone let the figure snap through.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.applications.sketch.figure import Figure
from palpate.applications.sketch.fit import HIT, Fit, hits
from palpate.applications.sketch.matching import matched
from palpate.applications.sketch.outline import hausdorff
from palpate.applications.sketch.residual import Target
from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State

# Stiffness of the springs, see `Figure.loaded`, tried in turn; rounds of matching with each.
_STIFFNESS = (30.0, 120.0, 500.0)
_ROUNDS = 3
# Rounds end at this share of `HIT`.
_ENOUGH = 0.6


def closed(figure: Figure, targets: tuple[Target, ...], fit: Fit) -> Fit:
    """The fit with springs added where its smooth forces miss a keyframe; unchanged where they hit, or where springs do
    not help.
    """
    if hits(figure, targets, fit):
        return fit
    basis = figure.force_basis(fit.degree)
    best, lowest = fit, max(_off(figure, e, t) for e, t in zip(fit.states, targets, strict=True))
    states, solves = list(fit.states), fit.solves
    for stiffness in _STIFFNESS:
        goals = []
        for k, target in enumerate(targets):
            states[k], goal, more = _drawn(
                figure, fit, np.tensordot(fit.forces[k], basis, 1), (states[k], target), stiffness
            )
            goals.append(goal)
            solves += more
        off = max(_off(figure, e, t) for e, t in zip(states, targets, strict=True))
        if off < lowest:
            lowest = off
            best = replace(fit, states=tuple(states), goals=np.stack(goals), spring=stiffness, solves=solves)
        if off < _ENOUGH * HIT:
            break
    return best


def _drawn(
    figure: Figure, fit: Fit, force: FloatArray, pair: tuple[Equilibrium, Target], stiffness: float
) -> tuple[Equilibrium, FloatArray, int]:
    """Equilibrium with springs of this stiffness, their goal (q, 3) mm and the number of solves."""
    (state, target), solves = pair, 0
    goal = _goal(figure, state.u, target)
    for k in range(_ROUNDS):
        wanted = goal if k == 0 else _goal(figure, state.u, target)
        figure.loaded(force, wanted, stiffness)
        end = figure.equilibrium(fit.theta, State(state.u, state.p))
        solves += 1
        if not end.converged:
            break
        state, goal = end, wanted
    return state, goal, solves


def _goal(figure: Figure, u: FloatArray, target: Target) -> FloatArray:
    """Vectors (q, 3) mm from each point of the rim at rest to its partner, matched at the present rim."""
    flat = matched(figure.rim_at(u), target.outline) - figure.outline.points
    return np.column_stack([flat, np.zeros(len(flat))])


def _off(figure: Figure, end: Equilibrium, target: Target) -> float:
    """Hausdorff distance of the outlines, in figure sizes."""
    return hausdorff(figure.rim_at(end.u), target.outline) / figure.outline.size
