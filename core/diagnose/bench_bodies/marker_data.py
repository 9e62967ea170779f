"""Data of one state of a body on a bench: motion of the markers along the axes seen, and reaction forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.diagnose.bench_bodies.markers import Markers
from palpate.core.diagnose.bench_bodies.problem import BodyProblem, BodyState
from palpate.core.diagnose.bench_bodies.reactions import Reaction
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.space import Space
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.residual.data_vector import DataVector


@dataclass(frozen=True, eq=False, kw_only=True)
class MarkerData(DataVector):
    """A data vector (n,) without surface and bones: first the markers' motion, mm, marker by marker, then reactions, N.

    moved (k, 3) mm : as seen. seen (k, 3) : which of it there is. covariance (n, n) : of measurement. common : see `on`.
    """

    markers: Markers
    moved: FloatArray
    seen: BoolArray
    reactions: tuple[Reaction, ...]
    covariance: FloatArray
    common: float

    @classmethod
    def on(cls, problem: BodyProblem, state: int, space: Space, common: float) -> MarkerData:
        """Data of the state of this index. common : share of the variance that markers on holders have in common."""
        stated = problem.states[state]
        markers = Markers.of(space, np.array(stated.rest))
        reactions = tuple(_reactions(problem, state, space))
        blocks = [_of_markers(stated, markers.off_body, common), *([[r.sd**2]] for r in reactions)]
        return cls(
            np.zeros((0, 0)),
            0,
            None,
            markers=markers,
            moved=stated.moved,
            seen=stated.seen,
            reactions=reactions,
            covariance=np.asarray(block_diag(*blocks), dtype=np.float64),
            common=common,
        )

    @property
    def n(self) -> int:
        """Length of the data vector."""
        return len(self.covariance)

    @property
    def n_seen(self) -> int:
        """Number of the markers' rows."""
        return int(self.seen.sum())

    def residual(self, scene: CompositionScene, u: FloatArray) -> FloatArray:
        """See `DataVector.residual`."""
        forces = [r.force(scene, u) - r.observed for r in self.reactions]
        return np.concatenate([(self.markers.motion(u) - self.moved)[self.seen], forces])

    def response(self, scene: CompositionScene, u: FloatArray, moves: FloatArray) -> FloatArray:
        """See `DataVector.response`; the materials stay as they are."""
        out = np.zeros((self.n, len(moves)))
        for j, move in enumerate(moves):
            out[: self.n_seen, j] = self.markers.change(u, move)[self.seen]
            out[self.n_seen :, j] = [r.change(scene, u, move) for r in self.reactions]
        return out

    def in_theta(
        self, scene: CompositionScene, theta: FloatArray, equilibrium: Equilibrium, sensitivities: FloatArray
    ) -> FloatArray:
        """See `DataVector.in_theta`; reactions by their adjoint, for they hang on the materials themselves too."""
        out = np.zeros((self.n, len(theta)))
        for j, move in enumerate(sensitivities):
            out[: self.n_seen, j] = self.markers.change(equilibrium.u, move)[self.seen]
        for row, reaction in enumerate(self.reactions, self.n_seen):
            out[row] = reaction.in_theta(scene, theta, equilibrium)
        return out

    def missed(self, residual: FloatArray) -> FloatArray:
        """Residual (k, 3) mm of every marker, NaN along axes that are not seen, from that of the data (n,)."""
        out = np.full(self.seen.shape, np.nan)
        out[self.seen] = residual[: self.n_seen]
        return out


def _of_markers(state: BodyState, off_body: BoolArray, common: float) -> FloatArray:
    """Covariance (m, m) mm2 of the markers' motion along the axes seen.

    Markers on one holder err as a whole to `common` of their variance; those on the body each by itself, unless the
    state says what they have in common.
    """
    k = len(off_body)
    on_holder = np.ones(k, dtype=bool) if state.common is not None else off_body
    share = common if state.common is None else state.common
    together = share * np.outer(on_holder, on_holder) + np.diag(1.0 - share * on_holder)
    variance = np.array([0.0 if sd is None else sd**2 for sd in state.sd_mm])
    seen = state.seen.ravel()
    return np.asarray(np.kron(together, np.diag(variance))[np.ix_(seen, seen)])


def _reactions(problem: BodyProblem, state: int, space: Space) -> list[Reaction]:
    out = []
    for patch in problem.patches_in(state):
        nodes = np.unique(space.face_nodes(patch.faces))
        for axis, (force, sd) in enumerate(zip(patch.facts.reaction_n, patch.facts.reaction_sd_n, strict=True)):
            if force is not None and sd is not None:
                out.append(Reaction(nodes, axis, force, sd))
    return out
